//! Captures for verification at poses that the program plans and visits automatically.

use egui::{Button, Spinner, Ui};
use handeye_estimate::handeye::Mode;

use crate::shell::reasons::immovable;
use crate::shell::reasons::unknown_arm;
use crate::shell::sequence;
use crate::style::parts;
use crate::style::theme::{Palette, Tone};
use handeye_workbench::command::Outbox;
use handeye_workbench::model::{CapturePurpose, Model, Motion, Pane, PoseSequence};
use handeye_workbench::taught;
use handeye_workbench::tr;

/// The start button, or the progress; and the outcome.
pub fn planned_ui(ui: &mut Ui, model: &Model, outbox: &mut Outbox) {
    let language = model.view.language;
    if !model.takes_chosen_poses() {
        return;
    }
    let verifies = |sequence: &&PoseSequence| sequence.purpose == Some(CapturePurpose::Verify);
    match model.sequence.as_ref().filter(verifies) {
        Some(sequence) if model.sequence_runs => {
            sequence::progress_ui(ui, model, sequence, outbox);
            return;
        }
        _ if model.planning => {
            ui.horizontal(|ui| {
                ui.add(Spinner::new().size(14.0).color(Palette::of(ui).busy));
                ui.label(tr!(language, "Planning poses that are not in the fit…"));
            });
            return;
        }
        _ => {}
    }
    let button = Button::new(tr!(language, "Verify at planned poses"));
    let what = tr!(
        language,
        "Plans a few poses with the whole board in view that differ from all captures, moves the arm to each, and captures \
         there for verification. Stop the sequence and STOP end it; what was captured is kept"
    );
    if parts::gated_ui(ui, blocked(model), button).on_hover_text(what).clicked() {
        outbox.send(taught::Command::VerifyAtPlanned);
    }
    if let Some(message) = model.messages.shown_in(Pane::Verify) {
        parts::notice_ui(ui, Tone::Warning, &message.text.in_language(language), |_| ());
    }
    if let Some(sequence) = model.sequence.as_ref().filter(|sequence| sequence.is_planned()) {
        went_ui(ui, model, sequence, outbox);
    }
}

/// Why it cannot start.
fn blocked(model: &Model) -> Option<&'static str> {
    let language = model.view.language;
    let is_hand = model.calibrated().is_some_and(|calibrated| calibrated.hand_eye.mode() == Mode::EyeToHand);
    if !model.camera.is_connected() {
        Some(tr!(language, "Not connected: there is nothing to capture"))
    } else if let Some(reason) = immovable(model) {
        Some(reason)
    } else if model.calibrated().is_none() {
        Some(tr!(language, "There is no calibration to verify yet."))
    } else if is_hand {
        Some(tr!(language, "Poses are planned for a camera on the tip only: take these captures yourself"))
    } else if let Some(why) = unknown_arm(model) {
        Some(why)
    } else if model.capture.is_some() {
        Some(tr!(language, "A capture is under way"))
    } else if model.motion != Motion::Idle {
        Some(tr!(language, "The arm is moving: wait until it stands, or stop it"))
    } else {
        None
    }
}

fn went_ui(ui: &mut Ui, model: &Model, sequence: &PoseSequence, outbox: &mut Outbox) {
    sequence::summary_ui(ui, model, sequence, outbox);
    sequence::skipped_ui(ui, model, sequence);
}
