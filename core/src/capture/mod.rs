//! Taking a capture: when robot and image have come to rest, what the average of some images is, and whether it is
//! any good. Decisions only: images come in with their times, nothing here waits, reads a clock or knows a thread.
//!
//! | part | decides |
//! | --- | --- |
//! | [`Watch`] | whether robot and image are at rest |
//! | [`Average`] | the mean of images and depths |
//! | [`Scatter`] | how much corners differ from image to image |
//! | [`EdgeBlur`] | how blurred the board's edges are |
//! | [`nearest_similar`] | whether there is a capture from almost the same pose |
//! | [`Machine`] | what comes next, from the request to the average |
//! | [`observe_image`] | corners and blur of an image, fresh or from a file |

mod average;
pub(crate) mod cells;
pub(crate) mod edge_blur;
mod machine;
#[cfg(feature = "opencv")]
mod observe;
mod scatter;
mod similar;
mod watch;

pub use crate::capture::edge_blur::{EdgeBlur, MAX_BLUR_SHARE};
pub use average::Average;
pub use machine::{Machine, NO_IMAGES_S, Plan, Progress, Refusal, Taken, Wait};
#[cfg(feature = "opencv")]
pub use observe::{Sighting, observe_gray, observe_image};
pub use scatter::Scatter;
pub use similar::{Similar, nearest_similar};
pub use watch::{Rest, RobotRate, STILL_RATE_RAD_S, Watch};

use image::{GrayImage, RgbImage};

use crate::depth::DepthImage;
use crate::geometry::frames::{Base, Pose, Tip};

/// A pair of images with what is known of its instant.
#[derive(Debug, Clone, Copy)]
pub struct Shot<'a> {
    /// Counts images.
    pub number: u64,
    /// Simulated time \[s\].
    pub sim_time_s: f64,
    /// When it arrived, on the clock of whoever asks \[s\].
    pub received_s: f64,
    /// The tip as the controller reports it.
    pub base_from_tip: Pose<Base, Tip>,
    /// Positions of the joints \[rad\]; none where the robot does not report them.
    pub joints_rad: &'a [f64],
    /// Colour.
    pub rgb: &'a RgbImage,
    /// The same in grey, see [`crate::project::files::image_file::gray_from_rgb`].
    pub grey: &'a GrayImage,
    /// Depth, from a camera that measures it.
    pub depth: Option<&'a DepthImage>,
    /// The depth sensor's far plane \[m\]: depths there are no surface.
    pub far_plane_m: f32,
}

#[cfg(test)]
mod machine_tests;
#[cfg(test)]
mod parts_tests;
