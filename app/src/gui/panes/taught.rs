//! The taught poses.

use egui::Ui;

use super::empty;
use crate::command::Outbox;
use crate::model::Model;
use crate::tr;

/// The pane.
pub fn taught_ui(ui: &mut Ui, model: &Model, _outbox: &mut Outbox) {
    let language = model.view.language;
    let detail = tr!(language, "Move the arm, then remember its pose here.");
    empty::empty_ui(ui, tr!(language, "No taught poses yet"), detail);
}
