//! Tracking the board in live images: every image becomes a pose of the board, for display and for the arm.

use std::sync::Arc;

use handeye_arm::JointValues;
use handeye_estimate::corrected_arm::CorrectedArm;
use handeye_geometry::frames::{Base, Pose, Target, Tip};
use handeye_geometry::targets::TargetSpec;
use handeye_track::{Image, Setup, TrackError as CannotTrack, Tracker};

use super::follow_line::FollowLine;
use crate::track::state::{TrackError, Tracked};
use crate::worker::rate::RateMeter;

/// What tracks, and the arm with its errors where tip poses are corrected for them: the board is then where it really is in the base.
#[derive(Debug, Clone)]
pub struct TrackedBy {
    /// The target, the calibration that goes with these poses, and how boards move.
    pub setup: Setup,
    /// The arm with its errors.
    pub arm: Option<Arc<CorrectedArm>>,
}

impl TrackedBy {
    /// Where the tip is when it is reported there with these joint values; `None` if these are needed and do not belong to the
    /// arm.
    pub fn base_from_tip(&self, reported: Pose<Base, Tip>, joints_rad: &JointValues) -> Option<Pose<Base, Tip>> {
        self.arm.as_ref().map_or(Some(reported), |arm| arm.actual(joints_rad).ok())
    }

    /// What to command so that the tip gets there, given its error at these joint values: nearby the error is the same, so an arm
    /// that comes to rest there is in the right place. `None` as for [`Self::base_from_tip`].
    pub(crate) fn command(&self, goal: Pose<Base, Tip>, joints_rad: &JointValues) -> Option<Pose<Base, Tip>> {
        let Some(arm) = &self.arm else { return Some(goal) };
        let actual_from_reported = arm.actual(joints_rad).ok()?.inverse() * arm.arm.forward(joints_rad).ok()?;
        Some(goal * actual_from_reported)
    }
}

/// An image with what is known of it.
pub struct TrackedImage<'a> {
    /// Counts images.
    pub number: u64,
    /// When it arrived.
    pub received_s: f64,
    pub image: Image<'a>,
    /// Where the board was, if the cell publishes it; only used for comparison.
    pub base_from_target_true: Option<Pose<Base, Target>>,
}

/// A tracker at work.
pub struct Tracking {
    tracker: Tracker,
    by: TrackedBy,
    line: Arc<FollowLine>,
    rate: RateMeter,
}

impl Tracking {
    /// Starts; what is seen goes to `line` at once.
    ///
    /// # Errors
    /// As [`Tracker::new`].
    pub fn new(by: TrackedBy, line: Arc<FollowLine>) -> Result<Self, CannotTrack> {
        line.set_up(Some(by.clone()));
        Ok(Self { tracker: Tracker::new(by.setup.clone())?, by, line, rate: RateMeter::default() })
    }

    pub fn by(&self) -> &TrackedBy {
        &self.by
    }

    /// The board in an image; `now_s` is on the clock of its arrival.
    ///
    /// # Errors
    /// As [`Tracker::see`].
    pub fn see(&mut self, sight: &TrackedImage<'_>, now_s: &dyn Fn() -> f64) -> Result<Tracked, CannotTrack> {
        let update = self.tracker.see(&sight.image)?;
        self.line.see(&update);
        let published_s = now_s();
        self.rate.arrived(published_s);
        let truth = sight.base_from_target_true;
        let error = update
            .estimate
            .as_ref()
            .zip(truth)
            .map(|(estimate, truth)| error_of(&estimate.base_from_target, &truth, &self.by.setup.target));
        Ok(Tracked {
            frame: sight.number,
            latency_s: published_s - sight.received_s,
            rate_hz: self.rate.rate_hz(),
            update,
            error,
            truth,
        })
    }
}

impl Drop for Tracking {
    fn drop(&mut self) {
        self.line.set_up(None);
    }
}

/// How far an estimate is from the truth, at the middle of the board.
fn error_of(estimate: &Pose<Base, Target>, truth: &Pose<Base, Target>, target: &TargetSpec) -> TrackError {
    let centre = target.centre();
    TrackError {
        position_m: (estimate.isometry() * centre - truth.isometry() * centre).norm(),
        rotation_rad: estimate.rotation().angle_to(&truth.rotation()),
    }
}
