//! What the centre shows before the first picture: what is going on, and what to do.

use egui::{Align, CornerRadius, Frame, Label, Layout, RichText, Spinner, Stroke, Ui, Vec2};

use super::action_ui;
use crate::command::Outbox;
use crate::gui::status::Status;
use crate::gui::theme::{CARD_RADIUS, Palette, TITLE, Tone};

/// Lines longer than this are hard to read.
const TEXT_WIDTH: f32 = 520.0;

/// Roughly the height of the text, to put it a little above the middle.
const TEXT_HEIGHT: f32 = 190.0;

/// The card.
pub fn empty_ui(ui: &mut Ui, status: &Status, outbox: &mut Outbox) {
    let palette = Palette::of(ui);
    let card = Frame::new()
        .fill(palette.card)
        .stroke(Stroke::new(1.0, palette.edge))
        .corner_radius(CornerRadius::same(CARD_RADIUS));
    card.show(ui, |ui| {
        let size = ui.available_size();
        ui.allocate_ui_with_layout(size, Layout::top_down(Align::Center), |ui| {
            ui.set_min_size(size);
            ui.add_space(((size.y - TEXT_HEIGHT) * 0.42).max(0.0));
            sign_ui(ui, status.tone);
            ui.add_space(18.0);
            ui.label(RichText::new(&status.title).size(TITLE).color(palette.text));
            ui.add_space(6.0);
            let width = TEXT_WIDTH.min(ui.available_width());
            ui.scope(|ui| {
                ui.set_max_width(width);
                ui.add(Label::new(RichText::new(&status.detail).color(palette.weak)).wrap().halign(Align::Center));
            });
            ui.add_space(16.0);
            action_ui(ui, status.action, outbox);
        });
    });
}

/// Something that moves while there is reason to wait, and a still mark otherwise.
fn sign_ui(ui: &mut Ui, tone: Tone) {
    const SIZE: f32 = 34.0;
    let colour = Palette::of(ui).tone(tone);
    if tone == Tone::Busy {
        ui.add(Spinner::new().size(SIZE).color(colour));
        return;
    }
    let (rect, _) = ui.allocate_exact_size(Vec2::splat(SIZE), egui::Sense::hover());
    let painter = ui.painter();
    painter.circle_filled(rect.center(), SIZE / 2.0, colour.gamma_multiply(0.22));
    let stroke = Stroke::new(3.0, colour);
    let top = rect.center() - Vec2::new(0.0, 8.0);
    painter.line_segment([top, top + Vec2::new(0.0, 9.0)], stroke);
    painter.circle_filled(rect.center() + Vec2::new(0.0, 8.0), 2.0, colour);
}
