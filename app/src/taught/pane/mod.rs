//! Taught poses: the places that a sequence visits, in their order.

mod row;
pub mod sequence;
mod teach;

use egui::Ui;

use crate::command::Outbox;
use crate::gui::style::parts;
use crate::model::Model;
use crate::tr;

/// The pane.
pub fn taught_ui(ui: &mut Ui, model: &Model, outbox: &mut Outbox) {
    let language = model.view.language;
    let poses = &model.document().taught;
    parts::body_ui(ui, "taught poses", |ui| {
        teach::teach_ui(ui, model, outbox);
        crate::taught::pane::sequence::sequence_ui(ui, model, outbox);
        if poses.is_empty() {
            let detail = tr!(
                language,
                "Jog the arm to where the camera sees the board and teach that place, or begin with the ten reference \
                 poses."
            );
            parts::empty_ui(ui, tr!(language, "No taught poses yet"), detail);
        }
        for (index, pose) in poses.iter().enumerate() {
            row::row_ui(ui, model, index, pose, outbox);
        }
    });
}

/// Why the arm cannot be sent anywhere now.
pub fn immovable(model: &Model) -> Option<&'static str> {
    let language = model.view.language;
    if !model.control.is_connected() || !model.mover.is_connected() {
        Some(tr!(language, "Not connected: the arm cannot be moved until the connection is there"))
    } else if model.resting_simulation().is_some() {
        Some(tr!(language, "The arm moves only while the simulation runs"))
    } else if model.sequence_runs || model.planning {
        Some(tr!(language, "A sequence is under way"))
    } else {
        None
    }
}

#[cfg(test)]
mod tests;
