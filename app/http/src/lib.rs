//! What is served over HTTP: the page of the workbench, and the recordings that Rerun's viewers read.
//!
//! Requests and responses are axum's; a [`door::Door`] serves its routes. `axum::serve` would hold any number of connections,
//! for as long as a client likes that sends no request or reads no answer; so a door handles connections itself. Never depends
//! on another crate of the workbench.
//!
//! ```
//! use axum::{Router, routing::get};
//! use handeye_http::door::{Door, Limits};
//!
//! let runtime = tokio::runtime::Runtime::new()?;
//! let routes = Router::new().route("/", get(|| async { "hello" }));
//! let door = Door::open(runtime.handle(), Limits::USUAL, routes)?;
//! assert!(door.address().ip().is_loopback());
//! # Ok::<(), std::io::Error>(())
//! ```

pub mod door;
pub mod names;
