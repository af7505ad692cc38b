//! Tracking the board in live images: every image becomes a pose of the board, for who watches and for the arm.

use std::sync::Arc;

use handeye_geometry::frames::{Base, Pose, Target};
use handeye_geometry::targets::TargetSpec;
use handeye_track::{Image, Setup, TrackError as CannotTrack, Tracker};

use super::follow_line::FollowLine;
use crate::model::{TrackError, Tracked};
use crate::worker::rate::RateMeter;

/// An image with what is known of it.
pub struct TrackedImage<'a> {
    /// Counts images.
    pub number: u64,
    /// When it arrived.
    pub received_s: f64,
    /// The image.
    pub image: Image<'a>,
    /// Where the board was, if the cell publishes it; only ever compared with.
    pub base_from_target_true: Option<Pose<Base, Target>>,
}

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
            .map(|(estimate, truth)| error_of(&estimate.base_from_target, &truth, &self.target));
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
