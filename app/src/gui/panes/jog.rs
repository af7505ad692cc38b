//! Moves the arm by hand.

use egui::Ui;

use super::empty;
use crate::command::Outbox;
use crate::model::Model;
use crate::tr;

/// The pane.
pub fn jog_ui(ui: &mut Ui, model: &Model, _outbox: &mut Outbox) {
    let language = model.view.language;
    let detail = tr!(language, "Connect to a cell first.");
    empty::empty_ui(ui, tr!(language, "Jogging needs a connection"), detail);
}
