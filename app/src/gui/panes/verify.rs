//! How good the calibration is on captures that took no part in it.

use egui::Ui;

use super::empty;
use crate::command::Outbox;
use crate::model::Model;
use crate::tr;

/// The pane.
pub fn verify_ui(ui: &mut Ui, model: &Model, _outbox: &mut Outbox) {
    let language = model.view.language;
    let detail = tr!(language, "Solve first, then capture check poses, which never enter the fit.");
    empty::empty_ui(ui, tr!(language, "Nothing to verify yet"), detail);
}
