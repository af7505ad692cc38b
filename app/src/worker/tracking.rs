//! Tracking the board in live pictures: every picture becomes a pose of the board, for the window and for the arm.

use std::sync::Arc;

use handeye_core::frames::{Base, Pose, Target};
use handeye_core::image::GrayImage;
use handeye_core::target::TargetSpec;
use handeye_core::track::{Picture, Setup, TrackError as CannotTrack, Tracker};

use crate::model::{LiveDetection, LiveFrame, TrackError, Tracked};
use crate::worker::follow_line::FollowLine;
use crate::worker::rate::RateMeter;

/// A tracker at work.
pub struct Tracking {
    tracker: Tracker,
    target: TargetSpec,
    line: Arc<FollowLine>,
    rate: RateMeter,
}

impl Tracking {
    /// Begins; what is seen goes to `line` at once.
    ///
    /// # Errors
    /// As [`Tracker::new`].
    pub fn new(setup: Setup, line: Arc<FollowLine>) -> Result<Self, CannotTrack> {
        let target = setup.target;
        line.set_up(Some(setup.clone()));
        Ok(Self { tracker: Tracker::new(setup)?, target, line, rate: RateMeter::default() })
    }

    /// The board in a picture, at a time on the clock of the pictures' arrival.
    ///
    /// # Errors
    /// As [`Tracker::see`].
    pub fn see(
        &mut self,
        frame: &LiveFrame,
        grey: &GrayImage,
        dropped: u64,
        now_s: &dyn Fn() -> f64,
    ) -> Result<(Tracked, LiveDetection), CannotTrack> {
        let info = &frame.info;
        let began_s = now_s();
        let update = self.tracker.see(&Picture {
            time_s: info.sim_time_s,
            grey,
            depth: Some(&frame.images.depth),
            far_plane_m: info.far_plane_m,
            base_from_tip: info.base_from_tip,
        })?;
        self.line.see(&update);
        let published_s = now_s();
        self.rate.arrived(published_s);
        let detection = LiveDetection {
            frame: info.number,
            corners: update.seen.as_ref().map(|seen| seen.corners.clone()),
            camera_from_target: update.seen.as_ref().map(|seen| seen.camera_from_target),
            base_from_tip: info.base_from_tip,
            took_s: published_s - began_s,
            problem: None,
            dropped,
        };
        let truth = info.base_from_target_true;
        let error = update
            .estimate
            .as_ref()
            .zip(truth)
            .map(|(estimate, truth)| error_of(&estimate.base_from_target, &truth, &self.target));
        let tracked = Tracked {
            frame: info.number,
            latency_s: published_s - info.received_s,
            rate_hz: self.rate.rate_hz(),
            update,
            error,
            truth,
        };
        Ok((tracked, detection))
    }
}

impl Drop for Tracking {
    fn drop(&mut self) {
        self.line.set_up(None);
    }
}

/// How far an estimate is from the truth, at the middle of the board.
pub fn error_of(estimate: &Pose<Base, Target>, truth: &Pose<Base, Target>, target: &TargetSpec) -> TrackError {
    let centre = target.centre();
    TrackError {
        position_m: (estimate.isometry() * centre - truth.isometry() * centre).norm(),
        rotation_rad: estimate.rotation().angle_to(&truth.rotation()),
    }
}
