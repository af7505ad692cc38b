//! The keys and what they do.

use egui::{CornerRadius, Frame, Grid, Label, Margin, RichText, ScrollArea, Stroke, Ui};

use super::actions::{self, Action, Group};
use super::style::theme::{self, Palette, TITLE};
use handeye_workbench::model::Model;
use handeye_workbench::tr;

/// All keys.
pub fn keys_ui(ui: &mut Ui, model: &Model) {
    let language = model.view.language;
    let palette = Palette::of(ui);
    ui.label(theme::title(tr!(language, "Keyboard"), TITLE));
    let note = tr!(
        language,
        "Esc stops the arm at any time, also while you type or a dialog is open. Other keys do nothing while you type."
    );
    ui.add(Label::new(RichText::new(note).color(palette.weak)).wrap());
    ui.add_space(8.0);
    let all = actions::all(model, language);
    let height = (ui.ctx().content_rect().height() - 240.0).max(120.0);
    ScrollArea::vertical().max_height(height).auto_shrink([false, true]).show(ui, |ui| {
        ui.columns(2, |columns| {
            let [left, right] = columns else { return };
            for (ui, groups) in [(left, [Group::Work, Group::Session]), (right, [Group::Steps, Group::Window])] {
                for group in groups {
                    let rows = all.iter().filter(|action| action.group == group && !action.keys.is_empty());
                    group_ui(ui, group.name(language), rows);
                }
            }
        });
    });
}

/// The keys of one group.
fn group_ui<'a>(ui: &mut Ui, name: &str, actions: impl Iterator<Item = &'a Action>) {
    ui.add_space(6.0);
    ui.label(RichText::new(name).color(Palette::of(ui).weak).small());
    ui.spacing_mut().interact_size.y = 22.0;
    Grid::new(("keys", name)).num_columns(2).min_col_width(170.0).spacing([12.0, 4.0]).show(ui, |ui| {
        for action in actions {
            ui.label(action.name);
            ui.horizontal(|ui| {
                ui.spacing_mut().item_spacing.x = 4.0;
                for keys in actions::keys_text(ui.ctx(), action) {
                    key_ui(ui, &keys);
                }
            });
            ui.end_row();
        }
    });
}

/// Key caps.
pub fn key_ui(ui: &mut Ui, keys: &str) {
    let palette = Palette::of(ui);
    Frame::new()
        .fill(palette.raised())
        .stroke(Stroke::new(1.0, palette.edge))
        .corner_radius(CornerRadius::same(4))
        .inner_margin(Margin::symmetric(6, 1))
        .show(ui, |ui| ui.label(RichText::new(keys).small().color(palette.text)));
}
