//! Writes the calibration for other programs: which formats, under which names, where to.

mod formats;
mod names;
mod preview;
mod written;

pub use written::why_not;

use egui::Ui;

use crate::style::parts;
use crate::style::theme::Tone;
use handeye_workbench::command::Outbox;
use handeye_workbench::model::Model;
use handeye_workbench::tr;

/// The pane.
pub fn export_ui(ui: &mut Ui, model: &Model, outbox: &mut Outbox) {
    let language = model.view.language;
    parts::body_ui(ui, "export", |ui| {
        if model.solve.solved.is_none() {
            let detail = tr!(language, "Solve first: what is written can then be read here before it is written.");
            parts::empty_ui(ui, tr!(language, "Nothing to export yet"), detail);
            return;
        }
        if let Some(reason) = blocked(model) {
            parts::notice_ui(ui, Tone::Warning, reason, |_| ());
        }
        // First, so that the main button of the pane is never out of sight.
        written::write_ui(ui, model, outbox);
        written::written_ui(ui, model);
        formats::formats_ui(ui, model, outbox);
        names::names_ui(ui, model, outbox);
    });
}

/// Why nothing can be written now.
fn blocked(model: &Model) -> Option<&'static str> {
    let language = model.view.language;
    if model.solve.solved.is_none() {
        Some(tr!(language, "Solve first"))
    } else if model.solve.current().is_none() {
        Some(tr!(language, "The result is from earlier captures: wait for the solve, or solve again"))
    } else {
        None
    }
}

#[cfg(test)]
mod tests;
