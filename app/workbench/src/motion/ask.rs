//! Moves that wait until a person has seen how far they are and lets the arm go: of every sequence, to a place that somebody chose by
//! its name, and home.

use crate::app::App;
use crate::model::{AskedMove, CellSource, MotionGoal, Pane, Severity, StopOutcome};
use crate::text::Text;
use handeye_wording::text;

impl App {
    /// Moves the arm there, once a person lets it where that has to be asked.
    pub(crate) fn set_out(&mut self, goal: MotionGoal, what: Text) {
        if self.model.asks_before(&goal) {
            self.model.messages.is_over_in(Pane::Jog);
            self.model.asked = Some(AskedMove { goal, what });
        } else {
            self.start_motion(goal, what);
        }
    }

    /// Whether somebody may send the arm somewhere now; a sequence would take the end of that motion for that of its own.
    pub(crate) fn may_set_out(&mut self) -> bool {
        if self.model.sequence_runs {
            self.say_in(
                Pane::Jog,
                Severity::Warning,
                text!("A sequence is under way: stop it to move the arm yourself"),
            );
        }
        !self.model.sequence_runs
    }

    /// A person lets the arm go.
    pub(crate) fn confirm_move(&mut self) {
        let Some(AskedMove { goal, what }) = self.model.asked.take() else { return };
        if self.guided_chooses_anew() {
            return;
        }
        self.model.let_go = true;
        self.start_motion(goal, what);
    }

    /// A person leaves the move out: a sequence goes on with another pose.
    pub(crate) fn skip_move(&mut self) {
        if self.model.asked.take().is_none() || self.guided_skips() {
            return;
        }
        if self.model.sequence_runs {
            self.end_stop(StopOutcome::Skipped(text!("skipped by the user")));
        }
    }

    /// Whether every move to a chosen pose waits. One that waits now begins where that is no longer wanted.
    pub(crate) fn set_confirm_moves(&mut self, confirm: bool) {
        self.model.view.confirm_moves = Some(confirm);
        if self.model.asked.as_ref().is_some_and(|asked| !self.model.asks_before(&asked.goal)) {
            self.confirm_move();
        }
    }

    /// To where the arm stood when the cell was connected.
    pub(crate) fn go_home(&mut self) {
        let Some(home) = self.model.home else {
            return self.say(Severity::Warning, text!("The position of the arm is not known: connect first"));
        };
        if self.may_set_out() {
            self.set_out(MotionGoal::Joints(home), text!("home"));
        }
    }

    /// Starts the built-in cell again: arm and board are where they are at first.
    pub(crate) fn reset_cell(&mut self) {
        if let CellSource::BuiltIn(_) = self.model.source {
            self.connect(self.model.source.clone());
        }
    }
}
