//! A strip over the images that says why they are not live.

use egui::{Align, CornerRadius, Frame, Label, Layout, Margin, Rect, RichText, Stroke, Ui, UiBuilder};

use crate::command::Outbox;
use crate::gui::status::Status;
use crate::gui::style::action::action_ui;
use crate::gui::style::theme::{CARD_RADIUS, Palette};
use crate::text::Language;

/// Kept free for the button.
const BUTTON_WIDTH: f32 = 160.0;

/// The strip, as wide as there is room.
pub fn banner_ui(ui: &mut Ui, status: &Status, language: Language, outbox: &mut Outbox) {
    let palette = Palette::of(ui);
    Frame::new()
        .fill(palette.tinted(status.tone))
        .stroke(Stroke::new(1.0, palette.tone(status.tone).gamma_multiply(0.6)))
        .corner_radius(CornerRadius::same(CARD_RADIUS))
        .inner_margin(Margin::symmetric(14, 8))
        .show(ui, |ui| {
            ui.set_min_width(ui.available_width());
            let row = ui.available_rect_before_wrap();
            let text = ui.scope(|ui| {
                ui.set_max_width((row.width() - BUTTON_WIDTH).max(0.0));
                ui.label(RichText::new(status.title.say(language)).strong());
                ui.add(Label::new(RichText::new(status.detail.say(language)).color(palette.weak)).wrap());
            });
            let beside = Rect::from_x_y_ranges(row.x_range(), text.response.rect.y_range());
            let layout = Layout::right_to_left(Align::Center);
            ui.scope_builder(UiBuilder::new().max_rect(beside).layout(layout), |ui| {
                action_ui(ui, status.action, language, outbox);
            });
        });
}
