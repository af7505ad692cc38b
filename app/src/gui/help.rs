//! Dialogs that explain: the keys, and what this program is. They lie over the window and block nothing: STOP can be
//! pressed beside them.

use egui::{
    Align, Align2, Area, Context, CornerRadius, Frame, Grid, Id, Label, Layout, Margin, Order, Rect, RichText,
    ScrollArea, Stroke, Ui,
};

use super::actions::{self, Action, Group};
use super::theme::{self, Palette, TITLE};
use crate::command::{Command, Outbox};
use crate::model::{Dialog, Model};
use crate::tr;

/// Width of a dialog.
const WIDTH: f32 = 680.0;

/// The dialog that is open, unless another part of the window draws it.
pub fn dialog_ui(ctx: &Context, dialog: Dialog, model: &Model, outbox: &mut Outbox) {
    let language = model.view.language;
    let content_ui = |ui: &mut Ui| match dialog {
        Dialog::Palette | Dialog::ImportPoses | Dialog::ExportPoses | Dialog::ExportFolder => {}
        Dialog::Help => keys_ui(ui, model),
        Dialog::About => about_ui(ui, model),
        Dialog::New | Dialog::Open | Dialog::SaveAs => sessions_ui(ui, model),
    };
    let width = WIDTH.min(ctx.content_rect().width() - 80.0);
    let area = Area::new(Id::new("dialog")).order(Order::Foreground).anchor(Align2::CENTER_CENTER, [0.0, -20.0]);
    let shown = area.show(ctx, |ui| {
        Frame::popup(ui.style())
            .inner_margin(Margin::same(22))
            .show(ui, |ui| {
                ui.set_width(width);
                content_ui(ui);
                ui.add_space(14.0);
                let row = egui::vec2(width, ui.spacing().interact_size.y);
                ui.allocate_ui_with_layout(row, Layout::right_to_left(Align::Center), |ui| {
                    ui.button(tr!(language, "Close")).clicked()
                })
                .inner
            })
            .inner
    });
    if shown.inner || pressed_outside(ctx, shown.response.rect) {
        outbox.send(Command::SetDialog(None));
    }
}

/// Whether the pointer was pressed outside of what is over the window. What is there does what it does: STOP stops.
pub fn pressed_outside(ctx: &Context, rect: Rect) -> bool {
    ctx.input(|input| {
        input.pointer.any_pressed() && input.pointer.interact_pos().is_some_and(|position| !rect.contains(position))
    })
}

fn keys_ui(ui: &mut Ui, model: &Model) {
    let language = model.view.language;
    let palette = Palette::of(ui);
    ui.label(theme::title(tr!(language, "Keyboard"), TITLE));
    let note = tr!(
        language,
        "Esc stops the arm at any time, also while you type or a dialog is open. All other keys rest while you type."
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

/// Keys as they look.
pub fn key_ui(ui: &mut Ui, keys: &str) {
    let palette = Palette::of(ui);
    Frame::new()
        .fill(palette.raised())
        .stroke(Stroke::new(1.0, palette.edge))
        .corner_radius(CornerRadius::same(4))
        .inner_margin(Margin::symmetric(6, 1))
        .show(ui, |ui| ui.label(RichText::new(keys).small().color(palette.text)));
}

fn about_ui(ui: &mut Ui, model: &Model) {
    let language = model.view.language;
    let palette = Palette::of(ui);
    ui.label(theme::title("Handeye Workbench", TITLE));
    ui.label(RichText::new(concat!("handeye ", env!("CARGO_PKG_VERSION"))).color(palette.weak));
    ui.add_space(10.0);
    for paragraph in [
        tr!(
            language,
            "Calibrates where a camera sits on a robot, or beside it, and says how good the answer is in millimetres."
        ),
        tr!(
            language,
            "Fonts: Inter and Noto Sans SC, under the SIL Open Font License 1.1. The program is under MIT or Apache 2.0."
        ),
        tr!(language, "STOP is no substitute for the emergency stop of the robot."),
    ] {
        ui.add(Label::new(paragraph).wrap());
        ui.add_space(4.0);
    }
}

fn sessions_ui(ui: &mut Ui, model: &Model) {
    let language = model.view.language;
    ui.label(theme::title(tr!(language, "Session"), TITLE));
    ui.label(tr!(
        language,
        "Sessions cannot be opened from the window yet. Use the command line: handeye calibrate FOLDER"
    ));
}
