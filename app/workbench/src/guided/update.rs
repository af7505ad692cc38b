//! How a guided sequence goes on.

use std::sync::Arc;

use handeye_estimate::Method;
use handeye_plan::guided::choose::Proposal;
use handeye_plan::guided::{CHECKS, Ending, Next};

use super::state::{Choice, ChoiceOutcome, ChosenStep, GuideRequest, GuidedProgress, Waits, ended, options};
use crate::app::App;
use crate::model::{CapturePurpose, MotionId, Pane, PoseSequence, Severity, SolveStatus, StopOutcome};
use crate::motion::way::has_moved;
use crate::session::archive::ArchiveTask;
use crate::text::Text;
use handeye_session::guided::guided_record;
use handeye_wording::text;

impl App {
    /// From the board in view to the goal. Captures that there are count; without any the first is taken here.
    pub(crate) fn calibrate_for_me(&mut self) {
        if self.model.sequence_runs || self.model.planning {
            return;
        }
        let Some(joints) = self.model.robot.as_ref().map(|robot| robot.joints_rad) else { return };
        let views = self.model.document().in_use().filter(|it| self.corners(it.id).is_some()).count();
        let options = options(self.model.view.goal.0, views);
        // What a view adds is known of the joint estimate alone.
        self.set_method(Method::Joint.name());
        self.model.messages.is_over_in(Pane::Poses);
        let here = if views > 0 { Vec::new() } else { vec![joints] };
        self.begin_sequence(PoseSequence {
            names: here.iter().map(|_| pose_name(1)).collect(),
            planned: Some(here),
            purpose: Some(CapturePurpose::Calibrate),
            outcomes: Vec::new(),
            began_s: self.model.now_s,
            guided: Some(Box::new(GuidedProgress::new(options, self.model.now_s))),
        });
    }

    /// Whether the last sequence is a guided one that was broken off: it goes on with a choice from where the arm is now,
    /// because the way to the pose that was left out is another one than was checked.
    pub(crate) fn continue_guided(&mut self) -> bool {
        let is_idle = !self.model.sequence_runs && !self.model.planning;
        let has_captures = !self.model.document().captures.is_empty();
        let Some(sequence) = self.model.sequence.as_mut().filter(|_| is_idle) else { return false };
        let (visited, Some(guided)) = (sequence.outcomes.len(), sequence.guided.as_deref_mut()) else { return false };
        if !has_captures {
            self.calibrate_for_me();
            return true;
        }
        guided.waits = Waits::Answer;
        guided.refused_moves = 0;
        guided.ahead.clear();
        guided.since = (self.model.now_s, visited);
        sequence.names.truncate(visited);
        if let Some(planned) = &mut sequence.planned {
            planned.truncate(visited);
        }
        self.model.sequence_runs = true;
        self.model.let_go = false;
        self.guided_step();
        true
    }

    fn guided_mut(&mut self) -> Option<&mut GuidedProgress> {
        let runs = self.model.sequence_runs;
        self.model.sequence.as_mut().filter(|_| runs)?.guided.as_deref_mut()
    }

    /// All poses that were chosen have been visited; whether that is for the guide to go on with.
    pub(crate) fn guided_waits(&mut self) -> bool {
        let has_captures = !self.model.document().captures.is_empty();
        let left_out = self.model.sequence.as_ref().and_then(|sequence| sequence.last_skipped().cloned());
        let Some(guided) = self.guided_mut() else { return false };
        guided.waits = Waits::Answer;
        if !has_captures {
            self.guided_ends(Severity::Warning, left_out.unwrap_or_else(|| Ending::NoStart.text()));
        }
        true
    }

    /// The robot does not move to a pose of a guided sequence; whether it did not to the one before, either. A chosen pose is
    /// within the limits of the joints and free to reach, so it is then not the pose that is in the way.
    pub(crate) fn guided_was_refused(&mut self) -> bool {
        let Some(guided) = self.guided_mut() else { return false };
        guided.refused_moves += 1;
        guided.refused_moves > 1
    }

    /// The arm is at a pose of a guided sequence.
    pub(crate) fn guided_arrived(&mut self) {
        if let Some(guided) = self.guided_mut() {
            guided.refused_moves = 0;
        }
    }

    /// A pose of a guided sequence is over.
    pub(crate) fn guided_visited(&mut self, outcome: &StopOutcome) {
        let Some(guided) = self.guided_mut() else { return };
        if guided.ending.is_some() {
            guided.tried += 1;
            guided.checked += usize::from(*outcome == StopOutcome::Done);
            return;
        }
        match outcome {
            StopOutcome::Done => guided.guide.captured(),
            StopOutcome::Skipped(_) => guided.guide.failed(),
        }
    }

    /// Asks for the next pose as soon as the answer from all captures is there. Looked at after every event, because the
    /// answer may come in several ways, or not at all.
    pub(crate) fn guided_step(&mut self) {
        let waits = self.guided_mut().map(|guided| guided.waits);
        if waits != Some(Waits::Answer) || self.model.capture.is_some() {
            return;
        }
        if matches!(self.model.solve.status, SolveStatus::Running { .. }) || !self.is_asked() {
            return;
        }
        let solved = self.model.solve.solved.clone().filter(|_| self.model.solve.fresh);
        let document = Arc::clone(&self.model.session.document);
        let observations = self.seen(&document).observations;
        let (speed, tool_box) = (self.model.speed(), self.chosen_box());
        let Some(sequence) = self.model.sequence.as_mut() else { return };
        let elapsed_s = self.model.now_s - sequence.began_s;
        let Some(guided) = sequence.guided.as_deref_mut() else { return };
        guided.waits = Waits::Choice;
        guided.guide.work_in(tool_box);
        let check = guided.ending.as_ref().map(|_| guided.tried);
        let request = GuideRequest { guide: guided.guide.clone(), observations, solved, elapsed_s, speed, check };
        self.numbers.motion = MotionId(self.numbers.motion.0 + 1);
        if self.workers.guide(self.numbers.motion, request).is_err() {
            self.break_off(None);
        }
    }

    /// The next pose is chosen, or there is none.
    pub(crate) fn guided_chosen(&mut self, id: MotionId, outcome: ChoiceOutcome) {
        // After a stop nothing begins by itself now.
        if id != self.numbers.motion || self.guided_mut().is_none_or(|guided| guided.waits != Waits::Choice) {
            return;
        }
        let Choice { guide, step, views_left, chosen_at } = match outcome {
            Ok(choice) => *choice,
            // As where the connection broke: nothing says that there are no more poses.
            Err(why) => return self.break_off(Some(why)),
        };
        let Some(guided) = self.guided_mut() else { return };
        guided.guide = guide;
        guided.waits = Waits::Nothing;
        guided.views_left = views_left;
        guided.chosen_at = Some(chosen_at);
        match step {
            ChosenStep::Next(next) => match *next {
                Next::Go { plan, why } => {
                    guided.why = Some(why);
                    guided.ahead = plan.proposals;
                    if guided.ahead.is_empty() {
                        self.choice_ended(Ending::NothingInReach { candidates: plan.candidates });
                    } else {
                        self.guided_sets_out();
                    }
                }
                Next::End(ending) => self.choice_ended(ending),
            },
            ChosenStep::Check(Some(proposal)) => {
                guided.ahead = vec![*proposal];
                self.guided_sets_out();
            }
            ChosenStep::Check(None) => self.guided_finished(),
        }
        self.keep_guided();
    }

    /// To the pose that is next.
    fn guided_sets_out(&mut self) {
        if self.guided_is_elsewhere() {
            return;
        }
        if let Some(next) = self.guided_mut().and_then(|guided| guided.ahead.first().cloned()) {
            self.guided_goes_to(&next);
        }
    }

    /// Whether the arm is not where the way to the next pose was checked from; then another one is chosen.
    fn guided_is_elsewhere(&mut self) -> bool {
        let now = self.model.robot.as_ref().map(|robot| robot.joints_rad);
        // To the place where it begins there is no way.
        let Some(guided) = self.guided_mut().filter(|guided| !guided.ahead.is_empty()) else { return false };
        if !has_moved(guided.chosen_at.as_ref(), now.as_ref()) {
            return false;
        }
        guided.waits = Waits::Answer;
        let said =
            text!("The arm is elsewhere than when this pose was chosen: another one is chosen from where it is now");
        self.say(Severity::Info, said);
        true
    }

    /// The same for a pose that a person has just let the arm go to.
    pub(crate) fn guided_chooses_anew(&mut self) -> bool {
        let is_elsewhere = self.guided_is_elsewhere();
        if is_elsewhere {
            self.guided_leaves_out();
        }
        is_elsewhere
    }

    /// The last pose of the sequence is none of it after all.
    fn guided_leaves_out(&mut self) {
        let Some(sequence) = self.model.sequence.as_mut() else { return };
        sequence.names.pop();
        if let Some(planned) = &mut sequence.planned {
            planned.pop();
        }
    }

    /// A person leaves out the pose that is next; whether it was one of a guided sequence.
    pub(crate) fn guided_skips(&mut self) -> bool {
        if self.guided_mut().is_none() {
            return false;
        }
        self.guided_leaves_out();
        let Some(guided) = self.guided_mut() else { return true };
        guided.ahead.clear();
        guided.waits = Waits::Answer;
        if guided.ending.is_some() {
            guided.tried += 1;
            if self.guided_is_over() {
                return true;
            }
        } else {
            guided.guide.skipped();
        }
        self.guided_step();
        true
    }

    /// Has what was proposed and what came of it written beside the captures. The next one has it all again, so that one
    /// for which the disk is too busy is no loss.
    fn keep_guided(&mut self) {
        let guided = self.model.sequence.as_ref().and_then(|sequence| sequence.guided.as_deref());
        if let (Some(guided), Some(folder)) = (guided, self.model.session.folder.clone()) {
            let task = ArchiveTask::Guided { folder, record: Box::new(guided_record(&guided.guide)) };
            if self.desk.archive(task).is_err() {
                tracing::debug!("the record of guided capture is written later");
            }
        }
    }

    fn guided_goes_to(&mut self, proposal: &Proposal) {
        let Some(joints) = proposal.joints else {
            return self.guided_ends(Severity::Warning, text!("The kinematics of the arm is not known"));
        };
        let Some(sequence) = self.model.sequence.as_mut() else { return };
        let name = match sequence.purpose {
            Some(CapturePurpose::Verify) => format!("C{}", sequence.names.len() + 1),
            _ => pose_name(sequence.names.len() + 1),
        };
        sequence.names.push(name);
        sequence.planned.get_or_insert_default().push(joints);
        self.next_stop();
    }

    /// No more poses for the fit. Where there is an answer it is checked.
    fn choice_ended(&mut self, ending: Ending) {
        if matches!(self.model.solve.status, SolveStatus::Running { .. }) {
            // The captures or the goal are others than those that were chosen by.
            if let Some(guided) = self.guided_mut() {
                guided.waits = Waits::Answer;
            }
            return;
        }
        let (has_answer, said) = (self.model.solve.fresh, ending.text());
        let Some(sequence) = self.model.sequence.as_mut() else { return };
        if let Some(guided) = sequence.guided.as_deref_mut() {
            guided.ending = Some(ending);
            guided.why = None;
            guided.ahead.clear();
            guided.waits = Waits::Answer;
        }
        if !has_answer {
            return self.guided_ends(Severity::Warning, said);
        }
        sequence.purpose = Some(CapturePurpose::Verify);
        self.guided_step();
    }

    /// Whether the sequence is guided and over: then it has been said how it went.
    pub(crate) fn guided_is_over(&mut self) -> bool {
        if self.guided_mut().is_some_and(|guided| guided.checked >= CHECKS || guided.tried >= 2 * CHECKS) {
            self.guided_finished();
            return true;
        }
        false
    }

    fn guided_finished(&mut self) {
        let Some((severity, said)) =
            self.guided_mut().and_then(|guided| Some(ended(guided.ending.as_ref()?, guided.checked)))
        else {
            return;
        };
        self.guided_ends(severity, said);
    }

    /// A guided sequence is of one target and one set-up.
    pub(crate) fn forget_guided(&mut self) {
        self.model.by_hand = None;
        if self.model.sequence.as_ref().is_some_and(|sequence| sequence.guided.is_some()) {
            self.stop_sequence();
            self.model.sequence = None;
        }
    }

    fn guided_ends(&mut self, severity: Severity, why: Text) {
        self.keep_guided();
        if let Some(guided) = self.guided_mut() {
            guided.is_over = true;
        }
        self.model.sequence_runs = false;
        self.model.asked = None;
        match severity {
            Severity::Info => self.say(severity, why),
            _ => self.say_in(Pane::Poses, severity, why),
        }
    }
}

fn pose_name(number: usize) -> String {
    format!("G{number}")
}
