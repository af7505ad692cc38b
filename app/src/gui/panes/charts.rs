//! Residuals, coverage and expected accuracy.

use egui::Ui;

use super::empty;
use crate::command::Outbox;
use crate::model::Model;
use crate::tr;

/// The pane.
pub fn charts_ui(ui: &mut Ui, model: &Model, _outbox: &mut Outbox) {
    let language = model.view.language;
    let detail = tr!(language, "They are drawn from the captures and the calibration.");
    empty::empty_ui(ui, tr!(language, "No charts yet"), detail);
}
