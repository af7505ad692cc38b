//! Parts of panes in which something is entered.

use egui::{Align, CornerRadius, Frame, Label, Layout, Margin, RichText, ScrollArea, Ui};

use super::parts;
use crate::style::theme::{self, Palette, Tone};

/// Width of the captions.
const CAPTIONS: f32 = 120.0;

/// The body of a pane: scrolls when it has to, with room at the edges.
pub fn body_ui(ui: &mut Ui, content_ui: impl FnOnce(&mut Ui)) {
    ScrollArea::vertical().auto_shrink(false).show(ui, |ui| {
        Frame::new().inner_margin(Margin::symmetric(14, 12)).show(ui, |ui| {
            ui.set_min_width(ui.available_width());
            ui.spacing_mut().item_spacing.y = 8.0;
            content_ui(ui);
        });
    });
}

/// A heading within a pane.
pub fn heading_ui(ui: &mut Ui, text: &str) {
    ui.add_space(4.0);
    ui.label(theme::title(text, 13.5).color(Palette::of(ui).text));
}

/// A caption at the left and what belongs to it at the right.
pub fn row_ui<R>(ui: &mut Ui, caption: &str, content_ui: impl FnOnce(&mut Ui) -> R) -> R {
    ui.horizontal(|ui| {
        let weak = Palette::of(ui).weak;
        let height = ui.spacing().interact_size.y;
        ui.allocate_ui_with_layout(egui::vec2(CAPTIONS, height), Layout::left_to_right(Align::Center), |ui| {
            ui.set_min_width(CAPTIONS);
            ui.add(Label::new(RichText::new(caption).color(weak)).truncate());
        });
        content_ui(ui)
    })
    .inner
}

/// A sentence with a tone, on a tinted strip.
pub fn note_ui(ui: &mut Ui, tone: Tone, title: &str, detail: &str) {
    ui.scope(|ui| {
        ui.spacing_mut().item_spacing.y = 2.0;
        parts::notice_ui(ui, tone, title, |ui| {
            if !detail.is_empty() {
                parts::hint_ui(ui, detail);
            }
        });
    });
}

/// Buttons side by side, one of which is on; returns the one that was clicked.
pub fn choice_ui<T: Copy + PartialEq>(ui: &mut Ui, current: T, choices: &[(T, &str, &str)]) -> Option<T> {
    let palette = Palette::of(ui);
    let mut clicked = None;
    Frame::new().fill(palette.well).corner_radius(CornerRadius::same(7)).inner_margin(Margin::same(2)).show(ui, |ui| {
        ui.spacing_mut().item_spacing.x = 2.0;
        ui.horizontal(|ui| {
            for &(choice, name, what) in choices {
                let mut response = ui.selectable_label(choice == current, name);
                if !what.is_empty() {
                    response = response.on_hover_text(what);
                }
                if response.clicked() && choice != current {
                    clicked = Some(choice);
                }
            }
        });
    });
    clicked
}
