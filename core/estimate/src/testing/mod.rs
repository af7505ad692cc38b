//! Simulated sessions for tests, studies and benchmarks: [`sessions`] are chains of robot and camera whose links are known,
//! [`faulty`] such with something wrong, [`BoardViews`] those of a camera without a robot. Feature `testing`.

mod board_views;
pub mod faulty;
pub mod sessions;

pub use board_views::{BoardViews, SharedErrors};
