//! What the user decides about a move that waits: it begins, or it is skipped. Moves of sequences, to captures and home wait alike;
//! it is decided here because a sequence continues with it.

use crate::app::context::Context;
use crate::guided::update::{guided_chooses_again, guided_skips};
use crate::motion::ask::asks_before;
use crate::motion::state::PendingMove;
use crate::motion::update::start_motion;
use crate::session::state::StopOutcome;
use crate::taught::sequence::end_stop;
use handeye_wording::text;

/// The user allows the move.
pub(crate) fn confirm_move(cx: &mut Context) {
    let Some(PendingMove { goal, what }) = cx.model.asked.take() else { return };
    if guided_chooses_again(&mut cx.model) {
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
    if cx.model.asked.as_ref().is_some_and(|asked| !asks_before(&cx.model, &asked.goal)) {
        confirm_move(cx);
    }
}
