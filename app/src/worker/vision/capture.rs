//! The capture that is under way, and what comes out of it.

use std::fmt;
use std::sync::Arc;

use handeye_core::capture::{self, Machine, Plan, Progress, Shot, Sighting, Taken, Wait};
use handeye_core::depth::DepthImage;
use handeye_core::frames::{Base, Pose, Tip};
use handeye_core::image::{GrayImage, RgbImage, imageops};
use handeye_core::observation::Corner;
use handeye_core::target::TargetSpec;
use handeye_sim_link::client::cell::JointAngles;

use super::refusal::{self, Why};
use crate::model::{CaptureOptions, CapturePurpose, CaptureWait, FrameInfo, LiveFrame, RefusalKind};
use crate::text::Text;

/// Width of a thumbnail [px].
const THUMBNAIL_WIDTH: u32 = 160;

/// A capture that is asked for.
#[derive(Debug, Clone, PartialEq)]
pub struct CaptureRequest {
    /// Its number, which everything that is reported of it carries.
    pub number: u64,
    /// What it is for.
    pub purpose: CapturePurpose,
    /// How it is taken.
    pub options: CaptureOptions,
    /// Name of the pose that it is taken at, where it has one.
    pub pose_name: Option<String>,
    /// The captures that there are, by number, against which it must be different.
    pub others: Vec<(u32, Pose<Base, Tip>)>,
}

/// A capture that is good.
#[derive(Clone, PartialEq)]
pub struct Measured {
    /// Its number, from the request.
    pub number: u64,
    /// What it is for.
    pub purpose: CapturePurpose,
    /// What was looked for.
    pub target: TargetSpec,
    /// Mean of the pictures.
    pub rgb: Arc<RgbImage>,
    /// Mean of the depths [m].
    pub depth: DepthImage,
    /// The tip as the controller reported it with the last of the pictures.
    pub base_from_tip: Pose<Base, Tip>,
    /// The joints at the same instant [rad].
    pub joints_rad: JointAngles,
    /// Simulated time of the last picture [s].
    pub sim_time_s: f64,
    /// How many pictures there were.
    pub frames: u32,
    /// Simulated time [s] until robot and picture had come to rest.
    pub settled_s: f64,
    /// Standard deviation of a corner in *one* of the pictures [px], see [`capture::Scatter::sigma_px`]; `None` below
    /// three pictures in which the live search found the board.
    pub corner_noise_px: Option<f64>,
    /// The board's points in the mean picture.
    pub corners: Vec<Corner>,
    /// Name of the pose, from the request.
    pub pose_name: Option<String>,
    /// The mean picture, small, with nothing drawn on it.
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

/// The capture that is under way.
pub struct UnderWay {
    pub request: CaptureRequest,
    pub machine: Machine,
    /// What was reported last.
    pub told: Option<CaptureWait>,
}

impl UnderWay {
    pub fn new(request: CaptureRequest, now_s: f64) -> Self {
        let CaptureOptions { frames, least_distance_m, least_angle_rad, settle_limit_s } = request.options;
        let others = request.others.clone();
        let plan = Plan { frames, settle_limit_s, least_distance_m, least_angle_rad, others };
        Self { request, machine: Machine::new(plan, now_s), told: None }
    }

    /// Takes in a picture; whether it was the last that is needed.
    pub fn see(&mut self, frame: &LiveFrame, grey: &GrayImage) -> bool {
        let LiveFrame { info, images } = frame;
        let shot = Shot {
            number: info.number,
            sim_time_s: info.sim_time_s,
            received_s: info.received_s,
            joints_rad: &info.joints_rad,
            rgb: &images.rgb,
            grey,
            depth: &images.depth,
            far_plane_m: info.far_plane_m,
        };
        self.machine.see(&info.base_from_tip, &shot) == Progress::Complete
    }

    /// What it waits for, or why it has ended.
    pub fn state(&self) -> Result<CaptureWait, Why> {
        match self.machine.progress() {
            Progress::Waits(Wait::ForPicture) => Ok(CaptureWait::ForPicture),
            Progress::Waits(Wait::RobotMoves) => Ok(CaptureWait::RobotMoves),
            Progress::Waits(Wait::PictureChanges) => Ok(CaptureWait::PictureChanges),
            Progress::Waits(Wait::Averaging { done, of }) => Ok(CaptureWait::Averaging { done, of }),
            Progress::Complete => Ok(CaptureWait::Measuring),
            Progress::Refused(why) => Err(refusal::of_machine(&why)),
        }
    }
}

/// What the measurement of an average says.
pub enum Look {
    Good(Box<Good>),
    Refused(RefusalKind, Text),
}

/// An average with the board in it.
pub struct Good {
    taken: Taken,
    target: TargetSpec,
    corners: Vec<Corner>,
}

/// Looks for the board in an average with all effort.
pub fn measure(taken: Taken, target: &TargetSpec) -> Look {
    let refused = |(kind, why): Why| Look::Refused(kind, why);
    match capture::observe_image(&taken.rgb, target) {
        Err(error) => refused(refusal::not_searched(&error)),
        Ok(None) => refused(refusal::no_board(target)),
        Ok(Some(Sighting { blur: Some(blur), .. })) if blur.is_too_blurred() => refused(refusal::blurred(&blur)),
        Ok(Some(Sighting { corners, .. })) => Look::Good(Box::new(Good { taken, target: *target, corners })),
    }
}

impl Good {
    /// With what belongs to it: the request and the last of its pictures.
    pub fn into_measured(self, request: CaptureRequest, last: &FrameInfo) -> Measured {
        let Self { taken: Taken { rgb, depth, frames, settled_s, corner_noise_px }, target, corners } = self;
        let CaptureRequest { number, purpose, pose_name, .. } = request;
        Measured {
            number,
            purpose,
            target,
            thumbnail: thumbnail(&rgb),
            rgb: Arc::new(rgb),
            depth,
            base_from_tip: last.base_from_tip,
            joints_rad: last.joints_rad,
            sim_time_s: last.sim_time_s,
            frames,
            settled_s,
            corner_noise_px,
            corners,
            pose_name,
        }
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
