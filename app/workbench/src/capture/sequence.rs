//! The capture that is under way, and what comes out of it.

use std::sync::Arc;

use handeye_capture::{self as capture, Machine, Plan, Progress, Refusal, Shot, Taken, Wait};

use handeye_detect::{self as detect, Sighting};
use handeye_geometry::frames::{Base, Pose, Tip};
use handeye_geometry::progress::CancelToken;
use handeye_geometry::targets::TargetSpec;
use handeye_geometry::targets::depth_plane::DepthPlane;
use handeye_geometry::targets::observation::{Corner, Corners};
use image::GrayImage;

use super::refusal::{self, Why};
use super::{CaptureRequest, Measured, thumbnail};
use crate::capture::state::{CaptureOptions, CaptureWait};
use crate::live::state::{FrameInfo, LiveFrame};

/// The capture that is under way: takes in images one by one, from the request on, and reports what it waits for. Never
/// waits itself.
#[derive(Debug)]
pub struct Sequence {
    request: CaptureRequest,
    target: TargetSpec,
    machine: Machine,
    /// What belongs to the last image that was taken in.
    last: Option<(Pose<Base, Tip>, FrameInfo)>,
    /// Why there is no capture where the newest image came without a pose of the robot.
    lacks_pose: Option<Why>,
}

impl Sequence {
    /// A request at a time on the clock of the image arrivals, for the board that is looked for.
    pub(crate) fn new(request: CaptureRequest, target: TargetSpec, now_s: f64) -> Self {
        let CaptureOptions { frames, least_distance_m, least_angle_rad, settle_limit_s } = request.options;
        let others = request.others.clone();
        let plan = Plan { frames, settle_limit_s, least_distance_m, least_angle_rad, others };
        Self { request, target, machine: Machine::new(plan, now_s), last: None, lacks_pose: None }
    }

    /// The number of the request.
    pub(crate) fn number(&self) -> u64 {
        self.request.number
    }

    /// Takes in an image; whether it was the last that is needed.
    pub(crate) fn see(&mut self, frame: &LiveFrame, grey: &GrayImage) -> bool {
        let LiveFrame { info, images } = frame;
        self.lacks_pose = info.base_from_tip.is_none().then(|| refusal::no_pose(info.no_pose.as_deref()));
        let Some(base_from_tip) = info.base_from_tip else { return self.is_complete() };
        let shot = Shot {
            number: info.number,
            sim_time_s: info.sim_time_s,
            received_s: info.received_s,
            base_from_tip,
            joints_rad: &info.joints_rad,
            rgb: &images.rgb,
            grey,
            depth: images.depth.as_ref().map(|depth| &depth.metres),
            far_plane_m: info.far_plane_m,
        };
        if !self.is_complete() {
            self.last = Some((base_from_tip, info.clone()));
        }
        self.machine.see(&shot);
        self.is_complete()
    }

    /// Whether all images are there.
    pub(crate) fn is_complete(&self) -> bool {
        self.machine.progress() == Progress::Complete
    }

    /// Whether [`Self::saw_board`] of the last image matters: where corners are to be compared from image to image, and
    /// the image belongs to the average.
    pub(crate) fn compares_corners(&self) -> bool {
        let averages = matches!(self.machine.progress(), Progress::Waits(Wait::Averaging { .. }) | Progress::Complete);
        averages && self.request.options.frames >= capture::Scatter::LEAST_IMAGES
    }

    /// Reports where the board was in the last image that was taken in.
    pub(crate) fn saw_board(&mut self, number: u64, corners: &[Corner]) {
        self.machine.saw_board(number, corners);
    }

    /// See [`Machine::pass_time`].
    pub(crate) fn pass_time(&mut self, now_s: f64, camera_heard_s: Option<f64>) {
        self.machine.pass_time(now_s, camera_heard_s);
    }

    /// What it waits for, or why it has ended.
    pub(crate) fn state(&self) -> Result<CaptureWait, Why> {
        match self.machine.progress() {
            Progress::Waits(wait) => Ok(CaptureWait::Images(wait)),
            Progress::Complete => Ok(CaptureWait::Measuring),
            Progress::Refused(why) => Err(match (&self.lacks_pose, why) {
                (Some(no_pose), Refusal::NoImages | Refusal::Paused) => no_pose.clone(),
                _ => refusal::of_machine(&why),
            }),
        }
    }

    /// Looks for the target in the average with all effort; dots or markers that are not there may take seconds. `None`
    /// before all images are there.
    pub(crate) fn measure(&self, cancel: &CancelToken) -> Option<Result<Measured, Why>> {
        let (taken, last) = (self.machine.finish()?, self.last.as_ref()?);
        Some(match detect::observe_image(&taken.rgb, &self.target, cancel) {
            Err(error) => Err(refusal::not_searched(&error)),
            Ok(None) => Err(refusal::no_board(&self.target)),
            Ok(Some(Sighting { blur: Some(blur), .. })) if blur.is_too_blurred() => Err(refusal::blurred(&blur)),
            Ok(Some(Sighting { corners, .. })) => Ok(self.measured(taken, corners, last)),
        })
    }

    fn measured(
        &self,
        taken: Taken,
        corners: Corners,
        (base_from_tip, last): &(Pose<Base, Tip>, FrameInfo),
    ) -> Measured {
        let Taken { rgb, depth, frames, settled_s, corner_noise_px } = taken;
        Measured {
            number: self.request.number,
            purpose: self.request.purpose,
            target: self.target,
            thumbnail: thumbnail(&rgb),
            depth_plane: depth.as_ref().and_then(|it| DepthPlane::new(it, rgb.dimensions(), &corners, &self.target)),
            rgb: Arc::new(rgb),
            depth,
            base_from_tip: *base_from_tip,
            joints_rad: last.joints_rad,
            sim_time_s: last.sim_time_s,
            frames,
            settled_s,
            corner_noise_px,
            corners,
            pose_name: self.request.pose_name.clone(),
        }
    }
}
