//! Taking a capture: when robot and image have come to rest, what the average of some images is, and whether it is
//! any good. Decisions only: images come in with their times, nothing here waits, reads a clock or knows a thread.
//!
//! | part | decides |
//! | --- | --- |
//! | [`Watch`] | whether robot and image are at rest |
//! | [`Average`] | the mean of images and depths |
//! | [`Scatter`] | scatter of corners from image to image |
//! | [`nearest_similar`] | whether there is a capture from almost the same pose |
//! | [`Machine`] | what comes next, from the request to the average |
//!
//! ```
//! use handeye_capture::Scatter;
//! use handeye_geometry::targets::observation::Corner;
//! use nalgebra::Vector2;
//!
//! let mut scatter = Scatter::default();
//! for off_px in [-0.1, 0.0, 0.1] {
//!     let corners: Vec<_> = (0..50).map(|i| Corner::new(i, Vector2::new(10.0 * i as f64 + off_px, 100.0 - off_px))).collect();
//!     scatter.add(&corners);
//! }
//! let sigma_px = scatter.sigma_px().expect("three images");
//! assert!((sigma_px - 0.1).abs() < 1e-6, "{sigma_px}");
//! ```
//!
//! Never depends on a detector or an estimator.

#![warn(missing_docs)]

mod average;
mod cells;
mod machine;
mod scatter;
mod similar;
mod watch;

pub use average::Average;
pub use machine::{Machine, NO_IMAGES_S, Plan, Progress, Refusal, Taken, Wait};
pub use scatter::Scatter;
pub use similar::{Similar, nearest_similar};
pub use watch::{Rest, RobotRate, STILL_RATE_RAD_S, Watch};

use image::{GrayImage, RgbImage};

use handeye_geometry::depth::DepthImage;
use handeye_geometry::frames::{Base, Pose, Tip};

/// A pair of images with what is known of its instant.
#[derive(Debug, Clone, Copy)]
pub struct Shot<'a> {
    /// Counts images.
    pub number: u64,
    /// Simulated time \[s\].
    pub sim_time_s: f64,
    /// When it arrived, on the caller's clock \[s\].
    pub received_s: f64,
    /// The tip as the controller reports it.
    pub base_from_tip: Pose<Base, Tip>,
    /// Positions of the joints \[rad\]; empty where the robot does not report them.
    pub joints_rad: &'a [f64],
    /// Colour.
    pub rgb: &'a RgbImage,
    /// The same in grey, see `handeye_images::gray_from_rgb`.
    pub grey: &'a GrayImage,
    /// Depth, from a camera that measures it.
    pub depth: Option<&'a DepthImage>,
    /// The depth sensor's far plane \[m\]: depths there are not a surface.
    pub far_plane_m: f32,
}

#[cfg(test)]
mod instant_for_tests;
#[cfg(test)]
mod machine_tests;
#[cfg(test)]
mod parts_tests;
