//! Taught poses: the places that a sequence visits, in their order.

mod row;
mod teach;

use egui::Ui;

use crate::shell::sequence::sequence_ui;
use crate::style::parts;
use crate::style::theme::Tone;
use handeye_wording::text;
use handeye_workbench::command::Outbox;
use handeye_workbench::model::Model;
use handeye_workbench::taught;
use handeye_workbench::tr;

/// The pane.
pub fn taught_ui(ui: &mut Ui, model: &Model, outbox: &mut Outbox) {
    let language = model.view.language;
    let poses = model.taught();
    parts::body_ui(ui, "taught poses", |ui| {
        teach::teach_ui(ui, model, outbox);
        sequence_ui(ui, model, outbox);
        elsewhere_ui(ui, model, poses.len(), outbox);
        if poses.is_empty() {
            let detail = if model.has_reference_poses() {
                tr!(
                    language,
                    "Jog the arm to where the camera sees the board and teach that place, or begin with the ten reference \
                     poses."
                )
            } else {
                tr!(language, "Move the arm to where the camera sees the board and teach that place.")
            };
            parts::empty_ui(ui, tr!(language, "No taught poses yet"), detail);
        }
        for (index, pose) in poses.iter().enumerate() {
            row::row_ui(ui, model, &poses, index, pose, outbox);
        }
    });
}

/// The poses of other cells, and a button to state that this is the same one.
fn elsewhere_ui(ui: &mut Ui, model: &Model, here: usize, outbox: &mut Outbox) {
    let language = model.view.language;
    let count = model.document().taught.len().saturating_sub(here);
    if count == 0 {
        return;
    }
    if model.cell.is_none() {
        let reported = text!("{n} taught {n|pose is|poses are} shown once the arm is connected", n = count);
        return parts::hint_ui(ui, &reported.in_language(language));
    }
    let reported = text!(
        "{n} {n|pose was|poses were} taught with another arm, base or target, and the arm is not sent there",
        n = count
    );
    parts::notice_ui(ui, Tone::Busy, &reported.in_language(language), |ui| {
        let what = tr!(
            language,
            "Only where arm, base and target stand as they did: the arm goes to the same places in its own base"
        );
        let reason = model.sequence_runs.then(|| tr!(language, "A sequence is under way"));
        let button = parts::small_button(ui, tr!(language, "Use them here"));
        if parts::gated_ui(ui, reason, button).on_hover_text(what).clicked() {
            outbox.send(taught::Command::Adopt);
        }
    });
}

#[cfg(test)]
mod tests;
