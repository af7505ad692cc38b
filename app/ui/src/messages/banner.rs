//! A card below the steps that shows why the images are not live. In this place it moves nothing: a strip over the panes
//! would shift the controls of the arm under the pointer.

use egui::{CornerRadius, Frame, Label, Margin, RichText, ScrollArea, Stroke, Ui};

use crate::status::Status;
use crate::style::action::action_ui;
use crate::style::theme::{CARD_RADIUS, Palette};
use handeye_workbench::command::Outbox;
use handeye_workbench::text::Language;

/// The card, as wide as there is room.
pub fn banner_ui(ui: &mut Ui, status: &Status, language: Language, outbox: &mut Outbox) {
    let palette = Palette::of(ui);
    ScrollArea::vertical().id_salt("banner").auto_shrink([false, true]).show(ui, |ui| {
        Frame::new()
            .fill(palette.tinted(status.tone))
            .stroke(Stroke::new(1.0, palette.tone(status.tone).gamma_multiply(0.6)))
            .corner_radius(CornerRadius::same(CARD_RADIUS))
            .inner_margin(Margin::symmetric(10, 8))
            .show(ui, |ui| {
                ui.set_min_width(ui.available_width());
                ui.spacing_mut().item_spacing.y = 4.0;
                ui.add(Label::new(RichText::new(status.title.in_language(language)).strong()).wrap());
                ui.add(Label::new(RichText::new(status.detail.in_language(language)).color(palette.weak)).wrap());
                action_ui(ui, status.action, language, outbox);
            });
    });
}
