//! What is served over HTTP: the page of the workbench, and the recordings that Rerun's viewers read.
//!
//! What is asked for and answered is axum's; a [`door::Door`] serves its routes. `axum::serve` would hold any number of
//! connections, for as long as somebody likes who asks nothing or takes nothing of an answer; so connections are a door's own.
//! Never depends on another crate of the workbench.
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
