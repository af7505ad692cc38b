//! Both pictures side by side.

use egui::{Rect, Ui, UiBuilder, Vec2};

use super::live;
use crate::command::{Command, Outbox};
use crate::gui::textures::LiveTextures;
use crate::gui::theme::GAP;
use crate::model::Model;

/// Both pictures, as large as there is room.
pub fn pictures_ui(ui: &mut Ui, model: &Model, textures: &LiveTextures, outbox: &mut Outbox) {
    let area = ui.available_rect_before_wrap();
    let width = ((area.width() - GAP) / 2.0).max(1.0);
    let left = Rect::from_min_size(area.min, Vec2::new(width, area.height()));
    let right = left.translate(Vec2::new(width + GAP, 0.0));
    ui.advance_cursor_after_rect(area);
    let place = |rect, name: &str| UiBuilder::new().max_rect(rect).id_salt(name);
    let colour = ui.scope_builder(place(left, "colour"), |ui| live::colour_ui(ui, model, textures, outbox)).inner;
    let depth = ui.scope_builder(place(right, "depth"), |ui| live::depth_ui(ui, model, textures, outbox)).inner;
    let pointed = colour.or(depth);
    if pointed != model.cursor {
        outbox.send(Command::PointAt(pointed));
    }
}
