//! Writes the calibration for other programs.

use egui::Ui;

use super::empty;
use crate::command::Outbox;
use crate::model::Model;
use crate::tr;

/// The pane.
pub fn export_ui(ui: &mut Ui, model: &Model, _outbox: &mut Outbox) {
    let language = model.view.language;
    let detail = tr!(language, "Solve first; then the files can be seen here before they are written.");
    empty::empty_ui(ui, tr!(language, "Nothing to export yet"), detail);
}
