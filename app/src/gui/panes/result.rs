//! The calibration.

use egui::Ui;

use super::empty;
use crate::command::Outbox;
use crate::model::Model;
use crate::tr;

/// The pane.
pub fn result_ui(ui: &mut Ui, model: &Model, _outbox: &mut Outbox) {
    let language = model.view.language;
    let detail =
        tr!(language, "Capture the board from at least 3 poses, with turns about different axes; 10 are a good start.");
    empty::empty_ui(ui, tr!(language, "No calibration yet"), detail);
}
