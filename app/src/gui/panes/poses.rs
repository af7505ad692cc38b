//! The captures of this session.

use egui::Ui;

use super::empty;
use crate::command::Outbox;
use crate::model::Model;
use crate::tr;

/// The pane.
pub fn poses_ui(ui: &mut Ui, model: &Model, _outbox: &mut Outbox) {
    let language = model.view.language;
    let detail = tr!(language, "Move the arm to a pose from which the camera sees the board, and press Space.");
    empty::empty_ui(ui, tr!(language, "No captures yet"), detail);
}
