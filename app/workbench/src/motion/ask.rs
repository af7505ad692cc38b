//! Moves that wait until the user has seen how far they are and allows them: of every sequence, to a place that was chosen by its
//! name, and home.

use crate::app::Context;
use crate::guided::update::{guided_chooses_anew, guided_skips};
use crate::model::{Model, MotionGoal, Pane, PendingMove, Severity, StopOutcome};
use crate::motion::update::start_motion;
use crate::taught::sequence::end_stop;
use crate::text::Text;
use handeye_wording::text;

/// Moves the arm there, once the user allows it where confirmation is needed.
pub(crate) fn set_out(cx: &mut Context, goal: MotionGoal, what: Text) {
    if cx.model.asks_before(&goal) {
        cx.model.messages.is_over_in(Pane::Jog);
        cx.model.asked = Some(PendingMove { goal, what });
    } else {
        start_motion(cx, goal, what);
    }
}

/// Whether the user may send the arm somewhere now; a sequence would take the end of that motion for that of its own.
pub(crate) fn may_set_out(model: &mut Model) -> bool {
    if model.sequence_runs {
        model.notify_in(
            Pane::Jog,
            Severity::Warning,
            text!("A sequence is under way: stop it to move the arm yourself"),
        );
    }
    !model.sequence_runs
}

/// The user allows the move.
pub(crate) fn confirm_move(cx: &mut Context) {
    let Some(PendingMove { goal, what }) = cx.model.asked.take() else { return };
    if guided_chooses_anew(&mut cx.model) {
        return;
    }
    cx.model.let_go = true;
    start_motion(cx, goal, what);
}

/// The user skips the move: a sequence continues with another pose.
pub(crate) fn skip_move(cx: &mut Context) {
    if cx.model.asked.take().is_none() || guided_skips(cx) {
        return;
    }
    if cx.model.sequence_runs {
        end_stop(cx, StopOutcome::Skipped(text!("skipped by the user")));
    }
}

/// Whether every move to a chosen pose waits. A waiting one begins if that is no longer wanted.
pub(crate) fn set_confirm_moves(cx: &mut Context, confirm: bool) {
    cx.model.view.confirm_moves = Some(confirm);
    if cx.model.asked.as_ref().is_some_and(|asked| !cx.model.asks_before(&asked.goal)) {
        confirm_move(cx);
    }
}

/// To where the arm was when the cell was connected.
pub(crate) fn go_home(cx: &mut Context) {
    let Some(home) = cx.model.home else {
        return cx.model.notify(Severity::Warning, text!("The position of the arm is not known: connect first"));
    };
    if may_set_out(&mut cx.model) {
        set_out(cx, MotionGoal::Joints(home), text!("home"));
    }
}
