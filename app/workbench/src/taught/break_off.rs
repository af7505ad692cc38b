//! The end of a sequence before its last pose.

use crate::messages::state::Severity;
use crate::model::Model;
use crate::session::state::PoseSequence;
use crate::shell::state::Pane;
use crate::text::Text;
use handeye_wording::text;

/// Interrupts a sequence, and reports why if that is known.
pub(crate) fn break_off(model: &mut Model, why: Option<Text>) {
    model.sequence_runs = false;
    model.asked = None;
    let pane = model.sequence.as_ref().map_or(Pane::Taught, pane_of);
    let reported = match why {
        Some(why) => text!("The sequence was broken off, and what was captured is kept: {why}", why = why),
        None => text!("The sequence was broken off; what was captured is kept"),
    };
    model.notify_in(pane, Severity::Warning, reported);
}

/// The pane that reports how it went.
pub(super) fn pane_of(sequence: &PoseSequence) -> Pane {
    match sequence {
        sequence if sequence.guided.is_some() => Pane::Poses,
        sequence if sequence.is_planned() => Pane::Verify,
        _ => Pane::Taught,
    }
}
