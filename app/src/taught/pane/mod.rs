//! Taught poses: the places that a sequence visits, in their order.

mod immovable;
mod row;
pub mod sequence;
mod teach;

use egui::Ui;
pub use immovable::{immovable, unmovable};

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

#[cfg(test)]
mod tests;
