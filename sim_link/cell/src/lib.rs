//! The built-in simulated cell: an arm with an RGB-D camera and a board.
//!
//! No protocol, no socket, no clock: `handeye_server` serves it.
//!
//! ```
//! use handeye_cell::scene::Scene;
//!
//! let scene = Scene::reference()?.resolve(1)?;
//! let tip = scene.base_from_target.translation();
//! assert!(tip.norm() < 1.5, "the board is within reach");
//! # Ok::<(), handeye_cell::scene::SceneError>(())
//! ```

pub mod props;
pub mod scene;
pub mod world;

pub use handeye_render as render;
