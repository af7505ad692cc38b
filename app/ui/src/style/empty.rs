//! What a pane shows while it has nothing: what is missing, and what to do.

use egui::{Align, Label, Layout, RichText, Spinner, Stroke, Ui, Vec2};

use crate::status::Status;
use crate::style::action::action_ui;
use crate::style::theme::{self, Palette, TITLE, Tone};
use handeye_workbench::command::Outbox;
use handeye_workbench::text::Language;

/// Lines longer than this are hard to read.
const TEXT_WIDTH: f32 = 460.0;

/// Roughly the height of the text, to put it a little above the middle.
const TEXT_HEIGHT: f32 = 170.0;

/// The state of the connection, in the middle of a pane.
pub fn status_ui(ui: &mut Ui, status: &Status, language: Language, outbox: &mut Outbox) {
    let palette = Palette::of(ui);
    centred_ui(ui, TEXT_HEIGHT, |ui| {
        sign_ui(ui, status.tone);
        ui.add_space(14.0);
        ui.add(Label::new(theme::title(status.title.in_language(language), TITLE).color(palette.text)).wrap());
        ui.add_space(6.0);
        ui.add(Label::new(RichText::new(status.detail.in_language(language)).color(palette.weak)).wrap());
        ui.add_space(14.0);
        action_ui(ui, status.action, language, outbox);
    });
}

/// A pane that has nothing to show yet: a title and what has to happen first.
pub fn empty_ui(ui: &mut Ui, title: &str, detail: &str) {
    let palette = Palette::of(ui);
    centred_ui(ui, 60.0, |ui| {
        ui.add(Label::new(theme::title(title, 15.0).color(palette.text)).wrap());
        ui.add_space(4.0);
        ui.add(Label::new(RichText::new(detail).color(palette.weak)).wrap());
    });
}

fn centred_ui(ui: &mut Ui, height: f32, content_ui: impl FnOnce(&mut Ui)) {
    let size = ui.available_size();
    ui.allocate_ui_with_layout(size, Layout::top_down(Align::Center), |ui| {
        ui.set_min_size(size);
        ui.add_space(((size.y - height) * 0.42).max(0.0));
        ui.scope(|ui| {
            ui.set_max_width(TEXT_WIDTH.min(size.x - 24.0).max(0.0));
            content_ui(ui);
        });
    });
}

/// Something that moves while there is reason to wait, and a still mark otherwise.
fn sign_ui(ui: &mut Ui, tone: Tone) {
    const SIZE: f32 = 30.0;
    let colour = Palette::of(ui).tone(tone);
    if tone == Tone::Busy {
        ui.add(Spinner::new().size(SIZE).color(colour));
        return;
    }
    let (rect, _) = ui.allocate_exact_size(Vec2::splat(SIZE), egui::Sense::hover());
    let painter = ui.painter();
    painter.circle_filled(rect.center(), SIZE / 2.0, colour.gamma_multiply(0.22));
    let stroke = Stroke::new(3.0, colour);
    let top = rect.center() - Vec2::new(0.0, 7.0);
    painter.line_segment([top, top + Vec2::new(0.0, 8.0)], stroke);
    painter.circle_filled(rect.center() + Vec2::new(0.0, 7.0), 2.0, colour);
}
