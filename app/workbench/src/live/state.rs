//! The newest images, and how they are viewed.

use std::fmt;
use std::path::PathBuf;
use std::sync::Arc;

use handeye_arm::JointValues;
use handeye_estimate::verify::MeasuredPoint;
use handeye_geometry::depth::{ColourMap, DepthError, DepthImage, DepthSample};
use handeye_geometry::frames::{Base, Pose, Target, Tip};
use image::RgbImage;
use serde::{Deserialize, Serialize};

use crate::text::Text;

/// What is known about a frame in addition to its pixels.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct FrameInfo {
    /// Counts the frames since the start of the program; grows with every frame that the camera worker takes.
    pub number: u64,
    /// Simulated time of the images \[s\]; of images from a driver, time of the workbench.
    pub sim_time_s: f64,
    /// How far apart in time they and the pose and joints may be \[s\]: zero if all are from one instant.
    pub image_age_s: f64,
    /// How far the tip may have moved meanwhile \[m\], at its speed since the images before; a rotation counts as at one
    /// metre from the tip.
    #[serde(default)]
    pub image_off_m: f64,
    /// When they arrived.
    pub received_s: f64,
    /// Frames per second that arrive.
    pub rate_hz: f64,
    /// Depths \[m\] at the two ends of the colour map.
    pub depth_range_m: [f32; 2],
    /// The sensor's far plane \[m\]: depths there are no surface.
    pub far_plane_m: f32,
    /// The tip as the controller reported it at the instant of the images; not known if the states of a robot leave a
    /// gap, or it has not been typed.
    pub base_from_tip: Option<Pose<Base, Tip>>,
    /// Why that is not known.
    #[serde(default)]
    pub no_pose: Option<Box<Text>>,
    /// The joints at the same instant \[rad\]; empty where the robot does not report them.
    pub joints_rad: JointValues,
    /// Where the board was at that instant, if the cell publishes it; only used for comparison.
    pub base_from_target_true: Option<Pose<Base, Target>>,
    /// For a robot and a camera that are two drivers: what is added to a stamp of the camera to get one of the robot, and how well
    /// that is known \[s\].
    pub clocks: Option<[f64; 2]>,
}

/// The pixels of a frame.
#[derive(Clone, PartialEq)]
pub struct FrameImages {
    /// Colour, row 0 on top.
    pub rgb: RgbImage,
    /// Depth, from a camera that measures it.
    pub depth: Option<ColouredDepth>,
}

/// A depth image and how it is shown.
#[derive(Clone, PartialEq)]
pub struct ColouredDepth {
    /// Depth in metres, row 0 on top.
    pub metres: DepthImage,
    /// As the window shows it, of the same size.
    pub colours: RgbImage,
}

impl ColouredDepth {
    /// Depths with the colours of `map` from `near_m` to `far_m`; those at the far plane of the sensor have their own.
    ///
    /// # Errors
    /// As [`DepthImage::colours`].
    pub(crate) fn new(
        metres: DepthImage,
        map: ColourMap,
        [near_m, far_m]: [f32; 2],
        far_plane_m: f32,
    ) -> Result<Self, DepthError> {
        let bytes = metres.colours(map, near_m, far_m, far_plane_m)?;
        // Three bytes for each of its pixels.
        let colours = RgbImage::from_raw(metres.width, metres.height, bytes).unwrap_or_default();
        Ok(Self { metres, colours })
    }
}

/// Sizes only: a million pixels are useless in a log.
impl fmt::Debug for FrameImages {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { rgb, depth } = self;
        let depth = depth.as_ref().map(|depth| (depth.metres.width, depth.metres.height));
        f.debug_struct("FrameImages").field("rgb", &rgb.dimensions()).field("depth", &depth).finish()
    }
}

impl FrameImages {
    /// Colour of a pixel; `None` outside.
    pub fn rgb_at(&self, point: ImagePoint) -> Option<[u8; 3]> {
        self.rgb.get_pixel_checked(point.column, point.row).map(|pixel| pixel.0)
    }

    /// Depth at a pixel of the colour image; the depth image may have another size.
    pub fn depth_at(&self, point: ImagePoint, far_plane_m: f32) -> DepthSample {
        let Some(ColouredDepth { metres: depth, .. }) = &self.depth else { return DepthSample::Invalid };
        let (width, height) = self.rgb.dimensions();
        if point.column >= width || point.row >= height {
            return DepthSample::Invalid;
        }
        let scaled = |at: u32, of: u32, to: u32| (u64::from(at) * u64::from(to) / u64::from(of)) as u32;
        let column = scaled(point.column, width, depth.width);
        let row = scaled(point.row, height, depth.height);
        depth.sample(column, row, far_plane_m)
    }
}

/// A pair of images with its metadata.
#[derive(Debug, Clone, PartialEq)]
pub struct LiveFrame {
    /// When, how often, which range.
    pub info: FrameInfo,
    /// The pixels.
    pub images: Arc<FrameImages>,
}

/// A pixel of the colour image; (0, 0) is the top left one.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct ImagePoint {
    /// Column from the left.
    pub column: u32,
    /// Row from the top.
    pub row: u32,
}

/// What is drawn over the images.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default)]
#[expect(clippy::struct_excessive_bools, reason = "each is a switch of its own, and all combinations make sense")]
pub struct Overlays {
    /// Corners that were found, coloured by row.
    pub corners: bool,
    /// The axes of the board.
    pub axes: bool,
    /// The board where robot pose and calibration predict it.
    pub predicted: bool,
    /// Outlines of the boards of past captures.
    pub coverage: bool,
    /// Residuals as arrows.
    pub residuals: bool,
}

impl Default for Overlays {
    fn default() -> Self {
        Self { corners: true, axes: true, predicted: true, coverage: false, residuals: true }
    }
}

/// The part of the images that is shown, the same in both.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Viewport {
    /// Its middle as parts of width and height.
    pub centre: [f32; 2],
    /// How many times larger than to fit.
    pub zoom: f32,
}

impl Default for Viewport {
    fn default() -> Self {
        Self { centre: [0.5, 0.5], zoom: 1.0 }
    }
}

/// A point that was picked in the live image.
#[derive(Debug, Clone)]
pub struct PickedPoint {
    pub pixel: ImagePoint,
    /// With the tip pose as it is reported: for uncorrected commands.
    pub as_reported: MeasuredTwice,
    /// With the tip pose corrected for the errors of the arm: for corrected commands. `None` if these are not known.
    pub corrected: Option<MeasuredTwice>,
}

/// Where a point is in the base, in two ways.
#[derive(Debug, Clone)]
pub struct MeasuredTwice {
    /// From the depth at the pixel; or why not.
    pub from_depth: Result<MeasuredPoint, Text>,
    /// Where the ray through the pixel meets the board as estimated by PnP; or why not.
    pub from_board: Result<MeasuredPoint, Text>,
}

/// The session's default place for exports.
pub fn exports_of(session: &std::path::Path) -> PathBuf {
    session.join("exports")
}
