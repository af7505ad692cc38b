//! Visiting all taught poses, or poses that are planned to verify at, with a capture at each.

use handeye_arm::JointValues;
use handeye_coppeliasim::cell::BoardInView;
use handeye_estimate::handeye::HandEye;

use crate::app::App;
use crate::model::{
    CapturePurpose, CaptureRefused, MotionGoal, MotionId, MotionOutcome, Pane, PoseSequence, Severity, StopOutcome,
};
use crate::text::Text;
use crate::worker::ViewsRequest;
use handeye_wording::text;

/// Poses that are planned to verify at: enough for an average and a scatter, and over within a minute or two.
const VERIFYING: usize = 5;
/// Chooses them: the same question gets the same poses.
const VIEWS_SEED: u64 = 1;

impl App {
    pub(crate) fn run_sequence(&mut self, purpose: Option<CapturePurpose>) {
        let names: Vec<String> = self.model.taught().iter().map(|pose| pose.name.clone()).collect();
        if names.is_empty() {
            self.say(Severity::Warning, text!("There are no taught poses: teach some, or take the reference poses"));
            return;
        }
        if purpose.is_some() && self.refuses_without_robot() {
            return;
        }
        self.begin_sequence(PoseSequence {
            names,
            planned: None,
            purpose,
            outcomes: Vec::new(),
            began_s: self.model.now_s,
            guided: None,
        });
    }

    pub(crate) fn begin_sequence(&mut self, sequence: PoseSequence) {
        // What the arm does is then no longer what a person does.
        self.model.by_hand = None;
        self.model.sequence = Some(sequence);
        self.model.sequence_runs = true;
        self.model.let_go = false;
        self.next_stop();
    }

    /// Goes on with a sequence that was broken off: the pose at which that was is visited again.
    pub(crate) fn continue_sequence(&mut self) {
        if self.model.capture.is_some() {
            // It would be taken for that of the pose.
            return self.say(Severity::Warning, text!("A capture is under way: wait until it is kept"));
        }
        if self.continue_guided() {
            return;
        }
        let left = self.model.sequence.as_ref().and_then(PoseSequence::current);
        if left.is_some() && !self.model.sequence_runs && !self.model.planning {
            self.model.sequence_runs = true;
            self.model.let_go = false;
            self.next_stop();
        }
    }

    /// Has poses planned that differ from all captures, to verify at.
    pub(crate) fn plan_verification(&mut self) {
        if self.model.sequence_runs || self.model.planning {
            return;
        }
        let board = self.model.calibrated().and_then(|calibrated| match calibrated.hand_eye {
            HandEye::EyeInHand { tip_from_camera, base_from_target } => Some(BoardInView {
                base_from_target,
                target: self.model.document().meta.target,
                intrinsics: calibrated.intrinsics,
                tip_from_camera,
            }),
            HandEye::EyeToHand { .. } => None,
        });
        let Some(board) = board else {
            let why = text!("Poses to verify at are planned with a calibration of a camera on the tip only");
            return self.say_in(Pane::Verify, Severity::Warning, why);
        };
        let taken =
            self.model.document().captures.iter().filter(|it| !it.excluded).filter_map(|it| it.base_from_tip).collect();
        self.numbers.motion = MotionId(self.numbers.motion.0 + 1);
        self.model.messages.is_over_in(Pane::Verify);
        let request = ViewsRequest { board, taken, count: VERIFYING, seed: VIEWS_SEED };
        let asked = self.workers.plan_views(self.numbers.motion, request);
        self.model.planning = asked.is_ok();
        self.numbers.plan = asked.is_ok().then_some(self.numbers.motion);
        self.expect(text!("No poses are planned"), asked);
    }

    /// The poses are planned, or cannot be.
    pub(crate) fn planned(&mut self, id: MotionId, views: Result<Vec<JointValues>, Text>) {
        // After a stop nothing begins by itself now.
        if self.numbers.plan != Some(id) || !self.model.planning {
            return;
        }
        self.model.planning = false;
        match views {
            Ok(joints) => self.begin_sequence(PoseSequence {
                names: (1..=joints.len()).map(|number| format!("V{number}")).collect(),
                planned: Some(joints),
                purpose: Some(CapturePurpose::Verify),
                outcomes: Vec::new(),
                began_s: self.model.now_s,
                guided: None,
            }),
            Err(why) => {
                let said = text!("There are no poses to verify at: {why}", why = why);
                self.say_in(Pane::Verify, Severity::Warning, said);
            }
        }
    }

    /// Nothing is planned after all: the arm does something else, or was stopped.
    pub(crate) fn plan_refused(&mut self, outcome: &MotionOutcome) {
        self.model.planning = false;
        if let Some(why) = outcome.why() {
            let said = text!("There are no poses to verify at: {why}", why = why.clone());
            self.say_in(Pane::Verify, Severity::Warning, said);
        }
    }

    pub(crate) fn stop_sequence(&mut self) {
        if self.model.sequence_runs {
            self.stop();
        }
    }

    /// Sets out for the next pose, or ends the sequence.
    pub(crate) fn next_stop(&mut self) {
        let Some(sequence) = self.model.sequence.as_ref().filter(|_| self.model.sequence_runs) else { return };
        if let Some(name) = sequence.current() {
            let name = name.to_owned();
            let planned = sequence.planned.as_ref().and_then(|joints| joints.get(sequence.outcomes.len()));
            match planned.copied() {
                Some(joints) => self.set_out(MotionGoal::Joints(joints), text!("pose {name}", name = name)),
                None => self.go_to_taught(&name),
            }
            return;
        }
        if self.guided_is_over() || self.guided_waits() {
            return;
        }
        let Some(sequence) = self.model.sequence.as_ref() else { return };
        let pane = pane_of(sequence);
        let of = sequence.names.len();
        let done = sequence.outcomes.iter().filter(|outcome| **outcome == StopOutcome::Done).count();
        let took_s = self.model.now_s - sequence.began_s;
        self.model.sequence_runs = false;
        let severity = if done == of { Severity::Info } else { Severity::Warning };
        let took = format!("{took_s:.0}");
        let said =
            text!("Sequence ended: {done} of {of} {of|pose|poses} in {took} s", done = done, of = of, took = took);
        match severity {
            Severity::Info => self.say(severity, said),
            _ => self.say_in(pane, severity, said),
        }
    }

    pub(crate) fn end_stop(&mut self, outcome: StopOutcome) {
        self.guided_visited(&outcome);
        if let Some(sequence) = &mut self.model.sequence {
            sequence.outcomes.push(outcome);
        }
        self.next_stop();
    }

    /// The motion of the sequence has ended.
    pub(crate) fn sequence_moved(&mut self, outcome: &MotionOutcome) {
        let Some(sequence) = &self.model.sequence else { return };
        if sequence.current().is_none() {
            // No pose is under way but the choice of one, and that ended without one.
            return self.break_off(outcome.why().cloned());
        }
        let (purpose, name) = (sequence.purpose, sequence.current().map(str::to_owned));
        match outcome {
            MotionOutcome::Arrived => {
                self.guided_arrived();
                match purpose {
                    Some(purpose) => self.capture(purpose, name),
                    None => self.end_stop(StopOutcome::Done),
                }
            }
            // A pose that cannot be reached is left out; the others can still be visited.
            MotionOutcome::Refused(why) if self.guided_was_refused() => self.break_off(Some(why.clone())),
            MotionOutcome::Refused(why) | MotionOutcome::Unreached(why) => {
                self.end_stop(StopOutcome::Skipped(why.clone()));
            }
            MotionOutcome::Stopped | MotionOutcome::Failed(_) | MotionOutcome::Held(_) => {
                self.break_off(outcome.why().cloned());
            }
        }
    }

    /// The capture of the sequence is on the disk.
    pub(crate) fn sequence_captured(&mut self) {
        // One that somebody took between two poses is none of the sequence's.
        let is_at_pose = self.model.sequence.as_ref().is_some_and(|sequence| sequence.current().is_some());
        if self.model.sequence_runs && is_at_pose {
            self.end_stop(StopOutcome::Done);
        }
    }

    /// There is no capture at this pose.
    pub(crate) fn sequence_refused(&mut self, refused: &CaptureRefused) {
        if !self.model.sequence_runs {
            return;
        }
        if refused.kind.concerns_the_pose() {
            self.end_stop(StopOutcome::Skipped(refused.why.clone()));
        } else {
            self.break_off(Some(refused.why.clone()));
        }
    }

    /// Ends a sequence before its end, and says why where that is known.
    pub(crate) fn break_off(&mut self, why: Option<Text>) {
        self.model.sequence_runs = false;
        self.model.asked = None;
        let pane = self.model.sequence.as_ref().map_or(Pane::Taught, pane_of);
        let said = match why {
            Some(why) => text!("The sequence was broken off, and what was captured is kept: {why}", why = why),
            None => text!("The sequence was broken off; what was captured is kept"),
        };
        self.say_in(pane, Severity::Warning, said);
    }
}

/// Where it says how it went.
fn pane_of(sequence: &PoseSequence) -> Pane {
    match sequence {
        sequence if sequence.guided.is_some() => Pane::Poses,
        sequence if sequence.is_planned() => Pane::Verify,
        _ => Pane::Taught,
    }
}
