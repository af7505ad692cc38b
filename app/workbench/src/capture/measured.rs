//! A capture that is good.

use std::fmt;
use std::sync::Arc;

use handeye_arm::JointValues;
use handeye_geometry::depth::DepthImage;
use handeye_geometry::frames::{Base, Pose, Tip};
use handeye_geometry::targets::TargetSpec;
use handeye_geometry::targets::depth_plane::DepthPlane;
use handeye_geometry::targets::observation::Corners;
use handeye_session::{Capture, CaptureId, Role, SessionError, Store};
use image::{RgbImage, imageops};

use crate::capture::state::CapturePurpose;

/// Width of a thumbnail \[px\].
const THUMBNAIL_WIDTH: u32 = 160;

/// A capture that is good.
#[derive(Clone, PartialEq)]
pub struct Measured {
    /// Its number, from the request.
    pub number: u64,
    pub purpose: CapturePurpose,
    /// What was looked for.
    pub target: TargetSpec,
    /// Mean of the images.
    pub rgb: Arc<RgbImage>,
    /// Mean of the depths \[m\], from a camera that measures them.
    pub depth: Option<DepthImage>,
    /// The tip as the controller reported it with the last of the images.
    pub base_from_tip: Pose<Base, Tip>,
    /// The joints at the same instant \[rad\]; empty where the robot does not report them.
    pub joints_rad: JointValues,
    /// Simulated time of the last image \[s\].
    pub sim_time_s: f64,
    /// How many images there were.
    pub frames: u32,
    /// Simulated time \[s\] until robot and image had come to rest.
    pub settled_s: f64,
    /// Standard deviation of a corner in *one* of the images \[px\], see [`handeye_capture::Scatter::sigma_px`];
    /// `None` below three images in which the quick search found the board.
    pub corner_noise_px: Option<f64>,
    /// The board's points in the mean image.
    pub corners: Corners,
    /// The plane of the target by its depths.
    pub depth_plane: Option<DepthPlane>,
    /// Name of the pose, from the request.
    pub pose_name: Option<String>,
    /// The mean image, small, with nothing drawn on it.
    pub thumbnail: RgbImage,
}

/// Without pixels.
impl fmt::Debug for Measured {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Measured")
            .field("number", &self.number)
            .field("base_from_tip", &self.base_from_tip)
            .field("sim_time_s", &self.sim_time_s)
            .field("frames", &self.frames)
            .field("settled_s", &self.settled_s)
            .field("corner_noise_px", &self.corner_noise_px)
            .finish_non_exhaustive()
    }
}

impl Measured {
    /// Records it in a session.
    ///
    /// # Errors
    /// As [`Store::add_capture`].
    pub fn record(&self, session: &mut Store) -> Result<CaptureId, SessionError> {
        session.add_capture(&Capture {
            image: &self.rgb,
            depth_m: self.depth.as_ref(),
            base_from_tip: Some(self.base_from_tip),
            joints_rad: Some(&*self.joints_rad).filter(|joints| !joints.is_empty()),
            sim_time_s: Some(self.sim_time_s),
            role: match self.purpose {
                CapturePurpose::Calibrate => Role::Calibration,
                CapturePurpose::Verify => Role::Verification,
            },
            frames: self.frames,
            corner_noise_px: self.corner_noise_px,
            settled_s: Some(self.settled_s),
            pose_name: self.pose_name.as_deref(),
        })
    }
}

/// A small copy.
pub fn thumbnail(rgb: &RgbImage) -> RgbImage {
    let (width, height) = rgb.dimensions();
    if width <= THUMBNAIL_WIDTH {
        return rgb.clone();
    }
    let scaled = u64::from(height) * u64::from(THUMBNAIL_WIDTH) / u64::from(width);
    imageops::thumbnail(rgb, THUMBNAIL_WIDTH, (scaled as u32).max(1))
}
