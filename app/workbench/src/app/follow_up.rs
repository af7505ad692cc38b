//! What follows in other features from what one of them has reported.

use crate::app::context::Context;
use crate::by_hand::update::captured_by_hand;
use crate::capture;
use crate::connect::update::forget_typed_pose;
use crate::motion;
use crate::taught::sequence::{plan_refused, sequence_captured, sequence_moved, sequence_refused};

/// A capture has ended: a sequence continues, and so does the user who is guided.
pub(super) fn capture_ended(cx: &mut Context, ended: capture::update::Ended) {
    match ended {
        capture::update::Ended::Refused(refused) => {
            sequence_refused(cx, &refused);
            cx.model.refused = Some(refused);
        }
        capture::update::Ended::Kept(role) => {
            sequence_captured(cx);
            captured_by_hand(&mut cx.model, role);
            forget_typed_pose(&mut cx.model, &cx.workers);
        }
    }
}

/// A motion has ended that others wait for.
pub(super) fn motion_ended(cx: &mut Context, ended: motion::update::Ended) {
    match ended {
        motion::update::Ended::Plan(outcome) => plan_refused(&mut cx.model, &outcome),
        motion::update::Ended::Sequence(outcome) => sequence_moved(cx, &outcome),
    }
}
