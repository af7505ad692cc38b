//! Dialogs over the window: folders and files, keys, the address of a page, and what this program is. They block nothing: STOP can
//! still be pressed.

mod about;

use egui::{Align, Align2, Area, Context, Frame, Id, Key, Layout, Margin, Order, Rect, Ui};

use super::help;
use handeye_workbench::command::Outbox;
use handeye_workbench::model::{Dialog, Model};
use handeye_workbench::shell;
use handeye_workbench::tr;

/// Width of dialogs with forms.
const NARROW: f32 = 520.0;
/// Width of lists.
const WIDE: f32 = 680.0;

/// The dialog that is open; the command palette is drawn elsewhere.
pub fn dialogs_ui(ctx: &Context, model: &Model, outbox: &mut Outbox) {
    match model.dialog {
        None | Some(Dialog::Palette) => crate::session::dialog::forget(ctx),
        Some(Dialog::Help) => {
            over_ui(ctx, WIDE, outbox, |ui, outbox| {
                help::keys_ui(ui, model);
                ui.with_layout(Layout::right_to_left(Align::Center), |ui| {
                    if ui.button(tr!(model.view.language, "Close")).clicked() {
                        outbox.send(shell::Command::SetDialog(None));
                    }
                });
            });
        }
        Some(Dialog::About) => over_ui(ctx, NARROW, outbox, |ui, outbox| about::about_ui(ui, model, outbox)),
        Some(Dialog::RerunAddress) => {
            over_ui(ctx, NARROW, outbox, |ui, outbox| crate::connect::dialog::address_ui(ui, model, outbox));
        }
        Some(Dialog::Import) => {
            over_ui(ctx, WIDE, outbox, |ui, outbox| crate::import::dialog::import_ui(ui, model, outbox));
        }
        Some(dialog) => {
            over_ui(ctx, NARROW, outbox, |ui, outbox| crate::session::dialog::folders_ui(ui, model, dialog, outbox));
        }
    }
}

/// Over the window, until Esc or until something else is pressed.
fn over_ui(ctx: &Context, width: f32, outbox: &mut Outbox, content_ui: impl FnOnce(&mut Ui, &mut Outbox)) {
    let width = width.min(ctx.content_rect().width() - 80.0);
    let area = Area::new(Id::new("dialog")).order(Order::Foreground).anchor(Align2::CENTER_CENTER, [0.0, -20.0]);
    let shown = area.show(ctx, |ui| {
        Frame::popup(ui.style()).inner_margin(Margin::same(22)).show(ui, |ui| {
            ui.set_width(width);
            ui.spacing_mut().item_spacing.y = 8.0;
            content_ui(ui, outbox);
        });
    });
    let escaped = ctx.input(|input| input.key_pressed(Key::Escape));
    if escaped || pressed_outside(ctx, shown.response.rect) {
        outbox.send(shell::Command::SetDialog(None));
    }
}

/// Whether the pointer was pressed outside of what is over the window. The widget there still works: STOP stops.
pub fn pressed_outside(ctx: &Context, rect: Rect) -> bool {
    ctx.input(|input| {
        input.pointer.any_pressed() && input.pointer.interact_pos().is_some_and(|position| !rect.contains(position))
    })
}

#[cfg(test)]
mod tests;
