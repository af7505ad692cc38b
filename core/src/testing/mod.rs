//! What tests, studies and benchmarks of all packages share. Feature `testing`.
//!
//! [`Scene`] makes images of boards whose corners are known, [`sessions`] chains of robot and camera whose links are known,
//! [`faulty`] such with something wrong, [`arms`] arms that are not built in, and [`skip`] is how a test says that the machine lacks what it needs.

pub mod arms;
mod board_views;
pub mod clutter;
mod drawn;
mod exact;
pub mod faulty;
#[cfg(test)]
pub(crate) mod flat_board;
pub mod guided_cell;
pub mod hand;
mod machine;
#[cfg(test)]
#[cfg_attr(not(feature = "opencv"), expect(dead_code, reason = "without the tracker only goals of the TCP use it"))]
pub(crate) mod moving_board;
mod scene;
pub mod sessions;
mod views;

pub use board_views::{BoardViews, SharedErrors};
pub use machine::{Need, data_folder, programs, python, skip};
pub use scene::Scene;
pub use views::{looking_at, looking_at_point};
