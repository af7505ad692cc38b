//! Moves the arm by hand: along axes, joint by joint, or to typed numbers.

mod allowance;
mod blocked;
mod hold;
mod joints;
mod pad;
mod settings;
mod status;
mod typed;

use egui::{Rect, ScrollArea, Sense, Ui, UiBuilder, Vec2};

use crate::connect::drivers::typed_pose::typed_pose_ui;
use crate::style::parts;
use crate::style::theme::Palette;
use blocked::Blocked;
use handeye_workbench::command::Outbox;
use handeye_workbench::model::{Model, Moves};
use handeye_workbench::tr;
use hold::Hold;

/// Room \[points\] below everything, so that no notice covers what is scrolled to the end.
const ROOM: f32 = 100.0;
/// Around the notices \[points\].
const MARGIN: Vec2 = Vec2::new(12.0, 6.0);

/// The pane.
pub fn jog_ui(ui: &mut Ui, model: &Model, outbox: &mut Outbox) {
    if model.moves() == Moves::Never {
        return parts::body_ui(ui, "jog", |ui| read_only_ui(ui, model, outbox));
    }
    let blocked = Blocked::of(model);
    let pane = ui.max_rect();
    parts::body_ui(ui, "jog", |ui| {
        let mut hold = Hold::begin(ui);
        status::status_ui(ui, model, outbox);
        settings::settings_ui(ui, model, outbox);
        pad::pad_ui(ui, model, &blocked, &mut hold);
        joints::joints_ui(ui, model, &blocked, &mut hold, outbox);
        status::tip_ui(ui, model);
        typed::typed_ui(ui, model, &blocked, outbox);
        hold.finish(ui, outbox);
        ui.add_space(ROOM);
    });
    notices_ui(ui, pane, |ui| {
        status::refusal_ui(ui, model, outbox);
        blocked.arm_ui(ui, model, outbox);
        blocked.tip_ui(ui);
        allowance::allowance_ui(ui, model, outbox);
    });
}

/// What blocks a motion, was refused, or has to be allowed: over the lower end of the pane, so that no control of the arm
/// moves under the pointer. Longer texts scroll.
fn notices_ui(ui: &mut Ui, pane: Rect, content_ui: impl FnOnce(&mut Ui)) {
    let id = ui.id().with("notices");
    let height: f32 = ui.data(|data| data.get_temp(id)).unwrap_or_default();
    let place = pane.with_min_y(pane.bottom() - height.min(0.5 * pane.height()));
    if height > 0.0 {
        ui.painter().rect_filled(place, 0.0, Palette::of(ui).card);
        // What is covered cannot be pressed.
        ui.interact(place, id.with("cover"), Sense::click_and_drag());
    }
    let inside = place.shrink2(MARGIN);
    let mut ui = ui.new_child(UiBuilder::new().max_rect(inside));
    let notices = ScrollArea::vertical()
        .id_salt("notices")
        .max_height(inside.height().max(0.0))
        .min_scrolled_height(0.0)
        .auto_shrink(false)
        .show(&mut ui, content_ui);
    let content = notices.content_size.y;
    let wanted = if content > 0.0 { content + 2.0 * MARGIN.y } else { 0.0 };
    if (wanted - height).abs() > 0.5 {
        ui.data_mut(|data| data.insert_temp(id, wanted));
        ui.ctx().request_discard("a notice of another height");
    }
}

/// A robot that is read-only.
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
