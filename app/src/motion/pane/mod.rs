//! Moves the arm by hand: along axes, joint by joint, or to numbers that are typed.

mod allowance;
mod asked;
mod blocked;
mod hold;
mod joints;
mod pad;
mod settings;
mod status;
mod typed;

use egui::Ui;

use crate::command::Outbox;
use crate::connect::drivers::typed_pose::typed_pose_ui;
use crate::gui::style::parts;
use crate::model::{Model, Moves};
use crate::tr;
pub use asked::asked_ui;
use blocked::Blocked;
pub use blocked::unknown_arm;
use hold::Hold;

/// The pane.
pub fn jog_ui(ui: &mut Ui, model: &Model, outbox: &mut Outbox) {
    if model.moves() == Moves::Never {
        return parts::body_ui(ui, "jog", |ui| read_only_ui(ui, model, outbox));
    }
    let blocked = Blocked::of(model);
    parts::body_ui(ui, "jog", |ui| {
        let mut hold = Hold::begin(ui);
        blocked.arm_ui(ui, model, outbox);
        allowance::allowance_ui(ui, model, outbox);
        status::status_ui(ui, model, outbox);
        settings::settings_ui(ui, model, outbox);
        pad::pad_ui(ui, model, &blocked, &mut hold);
        joints::joints_ui(ui, model, &blocked, &mut hold, outbox);
        status::tip_ui(ui, model);
        typed::typed_ui(ui, model, &blocked, outbox);
        hold.finish(ui, outbox);
    });
}

/// A robot that is only read.
fn read_only_ui(ui: &mut Ui, model: &Model, outbox: &mut Outbox) {
    if model.cell.as_ref().is_some_and(|cell| cell.poses_are_typed) {
        typed_pose_ui(ui, model, outbox);
    } else {
        parts::hint_ui(ui, tr!(model.view.language, "This robot is only read: move it by hand or by its pendant"));
    }
    status::tip_ui(ui, model);
}

#[cfg(test)]
mod tests;
