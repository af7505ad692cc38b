//! Moving and jogging the arm.

use handeye_arm::JointValues;
use handeye_geometry::frames::{Camera, Pose, Tip};
use handeye_session::CaptureId;

use crate::app::App;
use crate::model::{Jog, JogStep, Motion, MotionGoal, MotionId, MotionOutcome, MotionRequest, Pane, Severity};
use crate::text::Text;
use handeye_wording::text;

impl App {
    /// Moves the arm to a place that the words name.
    pub(crate) fn start_motion(&mut self, goal: MotionGoal, what: Text) {
        self.model.asked = None;
        self.numbers.motion = MotionId(self.numbers.motion.0 + 1);
        let id = self.numbers.motion;
        let request = MotionRequest { id, goal, speed: self.model.speed() };
        self.model.messages.is_over_in(Pane::Jog);
        match self.workers.move_to(request) {
            Ok(()) => {
                self.model.motion = Motion::Moving { id, what, since_s: self.model.now_s };
            }
            Err(busy) => {
                self.moved(id, MotionOutcome::Failed(busy.into()));
            }
        }
    }

    pub(crate) fn go_to_capture(&mut self, id: CaptureId) {
        if !self.may_set_out() {
            return;
        }
        let Some(capture) = self.model.document().capture(id) else { return };
        let joints = capture.joints_rad.as_deref().and_then(|joints| JointValues::try_from(joints).ok());
        let of_arm = self.model.cell.as_ref().map(|cell| cell.joints.len());
        // Joints bring the arm back exactly; a recorded session may have the pose alone, or be of another arm.
        let joints = joints.filter(|joints| of_arm.is_none_or(|count| count == joints.len()));
        let goal = joints.map(MotionGoal::Joints).or(capture.base_from_tip.map(MotionGoal::Tip));
        let Some(goal) = goal else {
            let why = text!("Capture {id} has no pose of the robot", id = id);
            return self.say_in(Pane::Jog, Severity::Warning, why);
        };
        self.set_out(goal, text!("pose of capture {id}", id = id));
    }

    pub(crate) fn moved(&mut self, id: MotionId, outcome: MotionOutcome) {
        let what = match &self.model.motion {
            Motion::Moving { id: moving, what, .. } if *moving == id => Some(what.clone()),
            _ => None,
        };
        if what.is_some() {
            self.model.motion = Motion::Idle;
        }
        let what = what.unwrap_or_else(|| text!("the goal"));
        if self.model.planning && self.numbers.plan == Some(id) {
            return self.plan_refused(&outcome);
        }
        if self.numbers.follow == Some(id) {
            return self.follow_ended(outcome);
        }
        match &outcome {
            MotionOutcome::Arrived => {}
            MotionOutcome::Stopped => {
                self.say_in(Pane::Jog, Severity::Warning, text!("Stopped on the way to {what}", what = what));
            }
            MotionOutcome::Refused(why) => {
                let why = why.clone();
                let said = text!("The arm does not move to {what}: {why}", what = what, why = why);
                self.say_in(Pane::Jog, Severity::Warning, said);
            }
            MotionOutcome::Unreached(why) | MotionOutcome::Failed(why) | MotionOutcome::Held(why) => {
                let said = text!("The arm did not get to {what}: {why}", what = what, why = why.clone());
                self.say_in(Pane::Jog, Severity::Error, said);
            }
        }
        // What an earlier motion still has to say does not move a sequence on.
        if self.model.sequence_runs && id == self.numbers.motion {
            self.sequence_moved(&outcome);
        }
    }

    /// A press of a jog button: one step, or the beginning of holding it.
    pub(crate) fn jog(&mut self, jog: Jog) {
        self.model.messages.is_over_in(Pane::Jog);
        match self.model.jog_step() {
            JogStep::Hold => {
                self.hold_jog(jog);
                self.model.motion = Motion::Jogging(jog);
            }
            JogStep::Step { metres, radians } => {
                self.numbers.motion = MotionId(self.numbers.motion.0 + 1);
                let id = self.numbers.motion;
                let speed = self.model.speed();
                let length = if jog.is_length(|joint| self.model.joint_kind(joint)) { metres } else { radians };
                match self.workers.jog_step(id, jog, length, speed, self.camera_on_tip()) {
                    Ok(()) => {
                        let (what, since_s) = (text!("the next step"), self.model.now_s);
                        self.model.motion = Motion::Moving { id, what, since_s };
                    }
                    Err(busy) => self.say_in(Pane::Jog, Severity::Warning, busy.into()),
                }
            }
        }
    }

    /// The button is still held. A jog that has ended by itself does not begin anew before the next press.
    pub(crate) fn hold_jog(&mut self, jog: Jog) {
        if self.model.jog_step() != JogStep::Hold {
            return;
        }
        self.workers.hold_jog(jog, self.model.speed(), self.camera_on_tip());
    }

    pub(crate) fn release_jog(&mut self) {
        self.workers.release_jog();
    }

    pub(crate) fn jog_ended(&mut self, why: Option<Text>) {
        if matches!(self.model.motion, Motion::Jogging(_)) {
            self.model.motion = Motion::Idle;
        }
        if let Some(why) = why {
            self.say_in(Pane::Jog, Severity::Warning, text!("Jogging has ended: {why}", why = why));
        }
    }

    /// A motion whose connection broke ended with it.
    pub(crate) fn motion_lost(&mut self) {
        if let Motion::Moving { id, .. } = self.model.motion {
            self.moved(id, MotionOutcome::Failed(text!("the connection broke on the way")));
        }
        self.model.motion = Motion::Idle;
    }

    /// The camera on the tip as calibrated, or else as the scene says: only to choose the axes that a person jogs along.
    fn camera_on_tip(&self) -> Option<Pose<Tip, Camera>> {
        let said = || Some(self.model.cell.as_ref()?.truth.as_ref()?.tip_from_camera);
        self.model.tip_from_camera().or_else(said)
    }
}
