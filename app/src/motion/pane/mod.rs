//! Moves the arm by hand: along axes, joint by joint, or to numbers that are typed.

mod blocked;
mod hold;
mod joints;
mod pad;
mod settings;
mod status;
mod typed;

use egui::Ui;

use crate::command::Outbox;
use crate::gui::style::parts;
use crate::model::Model;
use blocked::Blocked;
use hold::Hold;

/// The pane.
pub fn jog_ui(ui: &mut Ui, model: &Model, outbox: &mut Outbox) {
    let blocked = Blocked::of(model);
    parts::body_ui(ui, "jog", |ui| {
        let mut hold = Hold::begin(ui);
        blocked.arm_ui(ui, model, outbox);
        status::status_ui(ui, model, outbox);
        settings::settings_ui(ui, model, outbox);
        pad::pad_ui(ui, model, &blocked, &mut hold);
        joints::joints_ui(ui, model, &blocked, &mut hold, outbox);
        status::tip_ui(ui, model);
        typed::typed_ui(ui, model, &blocked, outbox);
        hold.finish(ui, outbox);
    });
}

#[cfg(test)]
mod tests;
