//! Sessions and images with known ground truth, for tests, studies and benchmarks. No shipped program contains this
//! crate.
//!
//! Lenses, links and arms are written out here: only types and the numbers of data sheets come from `handeye_geometry` and
//! `handeye_arm`, so that an estimator is not judged by its own formulas.
//!
//! | module | sessions |
//! | --- | --- |
//! | [`session`] | poses and corners of a robot with a camera, with one [`Fault`](session::Fault) or several if wanted |
//! | [`BoardViews`] | corners of a camera without a robot |
//! | [`lens`], [`links`] | what these are made of |
//!
//! | module | images |
//! | --- | --- |
//! | [`Scene`] | any target, as it is printed, through a lens |
//! | [`moving_board`] | a chessboard that moves, with depths |
//! | [`flat_board`] | a chessboard seen straight on, whose blur, by a motion too, is a Gaussian and known |
//!
//! Chessboards are drawn by `handeye_render`, except for `flat_board`: it has neither motion nor a pixel without an area, and
//! neither marks nor dots.
//!
//! ```
//! use handeye_geometry::camera::Intrinsics;
//! use handeye_geometry::targets::Grid;
//! use handeye_simulate::Scene;
//! use nalgebra::Isometry3;
//!
//! let grid = Grid { columns: 9, rows: 6, square_m: 0.025 };
//! let scene = Scene::new(Intrinsics::pinhole(640, 480, 600.0), grid, Isometry3::translation(-0.1, -0.0625, 0.5));
//! assert_eq!((scene.render(1).dimensions(), scene.truth().len()), ((640, 480), 54));
//! ```

mod arm;
mod board_views;
#[cfg(feature = "print")]
mod drawn;
pub mod flat_board;
pub mod lens;
pub mod links;
pub mod moving_board;
mod scene;
pub mod session;

pub use arm::{LinkErrors, Servo};
pub use board_views::{BoardViews, SharedErrors};
pub use scene::Scene;
