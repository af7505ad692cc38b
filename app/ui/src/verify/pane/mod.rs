//! How good the calibration is on new data: captures that never entered the fit, and points that are picked.

mod captures;
mod picked;
mod planned;
mod summary;

use egui::{Button, Ui};
use handeye_session::Role;

use crate::style::parts;
use crate::style::theme::Tone;
use handeye_wording::text;
use handeye_workbench::capture;
use handeye_workbench::command::Outbox;
use handeye_workbench::model::{CapturePurpose, Model};
use handeye_workbench::tr;

/// The pane.
pub fn verify_ui(ui: &mut Ui, model: &Model, outbox: &mut Outbox) {
    let language = model.view.language;
    parts::body_ui(ui, "verify", |ui| {
        parts::hint_ui(
            ui,
            tr!(
                language,
                "Captures at places that are not in the fit, with the board in view: at poses that are planned for it, or \
                 where you move the arm yourself. The calibration predicts where the board is; the image says where it is \
                 seen. The board has to stay where it was."
            ),
        );
        capture_ui(ui, model, outbox);
        planned::planned_ui(ui, model, outbox);
        match model.solve.solved.as_ref().map(|solved| (solved, &solved.verification)) {
            None => parts::hint_ui(ui, tr!(language, "There is no calibration to verify yet.")),
            Some((_, None)) => parts::hint_ui(ui, without_verification(model)),
            Some((_, Some(Err(error)))) => {
                let reported = text!("Verification has no answer: {why}", why = error).in_language(language);
                parts::notice_ui(ui, Tone::Bad, &reported, |_| ());
            }
            Some((solved, Some(Ok(verification)))) => {
                if !model.solve.fresh {
                    let reported = tr!(language, "Out of date: this is from earlier captures or settings");
                    parts::notice_ui(ui, Tone::Warning, reported, |_| ());
                }
                let corrected = solved.corrected.as_ref().and_then(|corrected| corrected.verification.as_ref());
                summary::summary_ui(ui, model, verification, corrected);
                captures::captures_ui(ui, model, &solved.verified_captures, (verification, corrected), outbox);
            }
        }
        picked::picked_ui(ui, model, outbox);
    });
}

/// Why a calibration has no verification.
fn without_verification(model: &Model) -> &'static str {
    let language = model.view.language;
    let is_kept = model.document().captures.iter().any(|it| it.role == Role::Verification && !it.excluded);
    if model.document().mode().is_none() {
        tr!(language, "A camera without a robot predicts no place of the board: there is nothing to verify.")
    } else if !is_kept {
        tr!(language, "No captures for verification yet. About ten are needed for a meaningful average.")
    } else if model.solve.fresh {
        tr!(language, "The board was not found in any capture for verification.")
    } else {
        tr!(language, "The captures for verification are being evaluated.")
    }
}

fn capture_ui(ui: &mut Ui, model: &Model, outbox: &mut Outbox) {
    let language = model.view.language;
    ui.horizontal(|ui| {
        let reason = if model.document().mode().is_none() {
            Some(tr!(language, "Needs robot poses"))
        } else if !model.camera.is_connected() || !model.control.is_connected() {
            Some(tr!(language, "Not connected: there is nothing to capture"))
        } else if model.resting_simulation().is_some() {
            Some(tr!(language, "Images are updated only while the simulation runs"))
        } else if model.capture.is_some() {
            Some(tr!(language, "A capture is under way"))
        } else if model.sequence_runs || model.planning {
            Some(tr!(language, "A sequence is under way"))
        } else {
            None
        };
        let button = Button::new(tr!(language, "Capture for verification"));
        if parts::gated_ui(ui, reason, button).clicked() {
            outbox.send(capture::Command::Take(CapturePurpose::Verify));
        }
        let is_ours = model.capture.as_ref().is_some_and(|capture| capture.purpose == CapturePurpose::Verify);
        if is_ours && ui.button(tr!(language, "Cancel capture")).clicked() {
            outbox.send(capture::Command::Cancel);
        }
    });
    if let Some(reason) = reason_not_connected(model) {
        parts::hint_ui(ui, reason);
    }
}

/// Shown in words and not only on the button, because it is not visible elsewhere in the pane.
fn reason_not_connected(model: &Model) -> Option<&'static str> {
    let is_connected = model.camera.is_connected() && model.control.is_connected();
    (!is_connected).then(|| tr!(model.view.language, "Not connected: there is nothing to capture"))
}

#[cfg(test)]
mod tests;
