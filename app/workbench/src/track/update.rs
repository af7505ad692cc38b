//! Tracking the board and following it.

use std::sync::Arc;

use handeye_track::{MotionModel, Setup};

use crate::app::App;
use crate::model::{
    BoardMotion, FollowStatus, FollowWish, MAX_TRACK_POINTS, Motion, MotionId, MotionOutcome, Pane, Severity,
    TrackPoint, Tracked,
};
use crate::text::Text;
use crate::worker::{ControlTask, Request, VisionTask};
use handeye_wording::text;

/// χ² of three degrees of freedom at 95 %, as a radius.
const RADIUS_95: f64 = 2.795_483_482_915_108;

impl App {
    pub(crate) fn set_tracking(&mut self, on: bool) {
        if on && self.model.calibrated().is_none() {
            self.say(Severity::Warning, text!("Tracking needs a calibration: capture poses and solve first"));
            return;
        }
        let before = std::mem::replace(&mut self.model.track.on, on);
        if before != on {
            self.model.track.newest = None;
            self.model.track.history.clear();
            self.send_tracking();
        }
        if !on {
            self.set_follow(None);
        }
    }

    /// Has the vision thread track with the newest calibration, or no more.
    pub(crate) fn send_tracking(&mut self) {
        let setup = self.model.calibrated().filter(|_| self.model.track.on).map(|calibrated| {
            Box::new(Setup {
                target: self.model.document().meta.target,
                calibrated: calibrated.clone(),
                motion: MotionModel::default(),
            })
        });
        let asked = self.workers.ask_vision(VisionTask::Track(setup));
        self.expect(text!("Tracking was not changed"), asked);
    }

    pub(crate) fn tracked(&mut self, tracked: Arc<Tracked>) {
        let track = &mut self.model.track;
        // What was on its way when tracking was ended.
        if !track.on {
            return;
        }
        let estimate = tracked.update.estimate.as_ref();
        let radius_m = |covariance: &nalgebra::Matrix6<f64>| {
            let largest = covariance.fixed_view::<3, 3>(0, 0).into_owned().symmetric_eigenvalues().max();
            largest.max(0.0).sqrt() * RADIUS_95
        };
        track.history.push_back(TrackPoint {
            time_s: tracked.update.time_s,
            position_m: estimate.map(|estimate| estimate.base_from_target.translation().into()),
            position_95_m: estimate.map(|estimate| radius_m(&estimate.covariance)),
            error: tracked.error,
            latency_s: tracked.latency_s,
        });
        while track.history.len() > MAX_TRACK_POINTS {
            track.history.pop_front();
        }
        track.newest = Some(tracked);
    }

    pub(crate) fn track_failed(&mut self, why: Text) {
        self.say(Severity::Error, text!("The board is not tracked: {why}", why = why));
        self.set_tracking(false);
    }

    pub(crate) fn set_follow(&mut self, wish: Option<FollowWish>) {
        self.model.track.wish = wish;
        let Some(wish) = wish else {
            if self.numbers.follow.is_some() {
                self.workers.cancel_motion();
            }
            return;
        };
        if !self.model.track.on {
            self.follow_ended(MotionOutcome::Refused(text!("The board is not tracked: start tracking first")));
            return;
        }
        self.numbers.motion = MotionId(self.numbers.motion.0 + 1);
        let id = self.numbers.motion;
        match self.workers.follow(id, wish, self.model.speed()) {
            Ok(()) => {
                self.numbers.follow = Some(id);
                self.model.track.follow = FollowStatus::Off;
                let what = text!("the board");
                self.model.motion = Motion::Moving { id, what, since_s: self.model.now_s };
                self.say(Severity::Info, text!("The arm follows the board"));
            }
            Err(busy) => self.follow_ended(MotionOutcome::Refused(busy.into())),
        }
    }

    /// Following goes on. What was on its way when it ended says nothing now.
    pub(crate) fn follow_goes(&mut self, status: FollowStatus) {
        if self.numbers.follow.is_some() {
            self.model.track.follow = status;
        }
    }

    pub(crate) fn follow_ended(&mut self, outcome: MotionOutcome) {
        self.numbers.follow = None;
        self.model.track.wish = None;
        let (severity, why) = match outcome {
            MotionOutcome::Arrived | MotionOutcome::Stopped => (Severity::Info, text!("it was stopped")),
            MotionOutcome::Refused(why)
            | MotionOutcome::Unreached(why)
            | MotionOutcome::Failed(why)
            | MotionOutcome::Held(why) => (Severity::Warning, why),
        };
        let said = text!("The arm does not follow the board: {why}", why = why.clone());
        match severity {
            Severity::Info => self.say(severity, said),
            _ => self.say_in(Pane::Track, severity, said),
        }
        self.model.track.follow = FollowStatus::Ended(why);
    }

    pub(crate) fn move_board(&mut self, motion: BoardMotion) {
        let asked = self.workers.ask_control(Request::Do(ControlTask::MoveBoard(motion)));
        if asked.is_ok() {
            self.model.track.board = motion;
        }
        self.expect(text!("The board was not moved"), asked);
    }

    pub(crate) fn hide_board(&mut self, hidden: bool) {
        let asked = self.workers.ask_control(Request::Do(ControlTask::HideBoard(hidden)));
        if asked.is_ok() {
            self.model.track.board_hidden = hidden;
        }
        self.expect(text!("The board was not hidden"), asked);
    }
}
