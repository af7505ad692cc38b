//! Moves the arm by hand: along axes, joint by joint, or to numbers that are typed.

mod allowance;
mod blocked;
mod hold;
mod joints;
mod pad;
mod settings;
mod status;
mod typed;

use egui::{ScrollArea, Ui};

use crate::command::Outbox;
use crate::connect::drivers::typed_pose::typed_pose_ui;
use crate::gui::style::parts;
use crate::model::{Model, Moves};
use crate::tr;
use blocked::Blocked;
pub use blocked::unknown_arm;
use hold::Hold;

/// Room \[points\] for a notice of two lines.
const ROOM_TO_SAY: f32 = 54.0;
/// The same with the question whether a robot may be moved, and its button.
const ROOM_TO_ALLOW: f32 = 100.0;

/// The pane.
pub fn jog_ui(ui: &mut Ui, model: &Model, outbox: &mut Outbox) {
    if model.moves() == Moves::Never {
        return parts::body_ui(ui, "jog", |ui| read_only_ui(ui, model, outbox));
    }
    let blocked = Blocked::of(model);
    parts::body_ui(ui, "jog", |ui| {
        let mut hold = Hold::begin(ui);
        status::status_ui(ui, model, outbox);
        notices_ui(ui, model, &blocked, outbox);
        settings::settings_ui(ui, model, outbox);
        pad::pad_ui(ui, model, &blocked, &mut hold);
        joints::joints_ui(ui, model, &blocked, &mut hold, outbox);
        status::tip_ui(ui, model);
        typed::typed_ui(ui, model, &blocked, outbox);
        hold.finish(ui, outbox);
    });
}

/// What is in the way, was refused, or has to be allowed. It has its room also while there is nothing to say: what moves the
/// arm does not change its place under the pointer. Longer words are scrolled.
fn notices_ui(ui: &mut Ui, model: &Model, blocked: &Blocked, outbox: &mut Outbox) {
    let height = if matches!(model.moves(), Moves::OnceArmed { .. }) { ROOM_TO_ALLOW } else { ROOM_TO_SAY };
    let size = egui::vec2(ui.available_width(), height);
    ui.allocate_ui(size, |ui| {
        ui.set_min_size(size);
        ScrollArea::vertical().id_salt("notices").max_height(height).auto_shrink(false).show(ui, |ui| {
            status::refusal_ui(ui, model, outbox);
            blocked.arm_ui(ui, model, outbox);
            blocked.tip_ui(ui);
            allowance::allowance_ui(ui, model, outbox);
        });
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
