//! Moves that wait until the user has seen how far they are and allows them: of every sequence, to a place that was chosen by its
//! name, and home.

use crate::app::context::Context;
use crate::messages::state::Severity;
use crate::model::Model;
use crate::motion::state::PendingMove;
use crate::motion::update::start_motion;
use crate::motion::way::Way;
use crate::shell::state::Pane;
use crate::text::Text;
use handeye_link::MotionGoal;
use handeye_wording::text;

/// Moves the arm there, once the user allows it where confirmation is needed.
pub(crate) fn set_out(cx: &mut Context, goal: MotionGoal, what: Text) {
    if asks_before(&cx.model, &goal) {
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

/// To where the arm was when the cell was connected.
pub(crate) fn go_home(cx: &mut Context) {
    let Some(home) = cx.model.home else {
        return cx.model.notify(Severity::Warning, text!("The position of the arm is not known: connect first"));
    };
    if may_set_out(&mut cx.model) {
        set_out(cx, MotionGoal::Joints(home), text!("home"));
    }
}

/// Whether a move to the next pose of a sequence, or to a place that was chosen by its name, waits until the user has seen how
/// far it is. Where the arm may be real the first one always does.
pub(crate) fn asks_before(model: &Model, goal: &MotionGoal) -> bool {
    // An arm that is read-only refuses with the reason, and one that is already there does not move.
    if !model.is_armed() || Way::to(goal, model).is_some_and(|way| way.is_none()) {
        return false;
    }
    let sequence = model.sequence.as_ref().filter(|_| model.sequence_runs);
    let is_first = sequence.is_none() || !model.let_go;
    let each = match sequence {
        Some(sequence) if sequence.planned.is_some() => model.confirms_moves(),
        // The user has been at taught poses.
        Some(_) => model.view.confirm_moves == Some(true),
        None => false,
    };
    each || is_first && model.may_be_real()
}
