//! Dialogs over the window: folders and files, keys, and what this program is. They block nothing: STOP can be pressed
//! beside them.

mod about;
mod folders;

use egui::{Align, Align2, Area, Context, Frame, Id, Layout, Margin, Order, Rect, ScrollArea, Ui};

use super::help;
use crate::command::{Command, Outbox};
use crate::model::{Dialog, Model};
use crate::tr;

/// Width of dialogs with forms.
const NARROW: f32 = 520.0;
/// Width of lists.
const WIDE: f32 = 680.0;

/// The dialog that is open; the command palette is drawn elsewhere.
pub fn dialogs_ui(ctx: &Context, model: &Model, outbox: &mut Outbox) {
    match &model.dialog {
        None | Some(Dialog::Palette) => folders::forget(ctx),
        Some(Dialog::Help) => {
            over_ui(ctx, WIDE, model, outbox, |ui, _| help::keys_ui(ui, model));
        }
        Some(Dialog::About) => over_ui(ctx, NARROW, model, outbox, |ui, outbox| about::about_ui(ui, model, outbox)),
        Some(dialog) => {
            over_ui(ctx, NARROW, model, outbox, |ui, outbox| folders::folders_ui(ui, model, dialog, outbox));
        }
    }
}

/// Over the window, until it is closed or something else is pressed.
fn over_ui(
    ctx: &Context,
    width: f32,
    model: &Model,
    outbox: &mut Outbox,
    content_ui: impl FnOnce(&mut Ui, &mut Outbox),
) {
    let room = ctx.content_rect();
    let width = width.min(room.width() - 80.0);
    let area = Area::new(Id::new("dialog")).order(Order::Foreground).anchor(Align2::CENTER_CENTER, [0.0, -20.0]);
    let shown = area.show(ctx, |ui| {
        Frame::popup(ui.style()).inner_margin(Margin::same(22)).show(ui, |ui| {
            ui.set_width(width);
            ScrollArea::vertical().max_height((room.height() - 160.0).max(120.0)).show(ui, |ui| {
                ui.set_width(width);
                content_ui(ui, outbox);
            });
            ui.add_space(14.0);
            let row = egui::vec2(width, ui.spacing().interact_size.y);
            ui.allocate_ui_with_layout(row, Layout::right_to_left(Align::Center), |ui| {
                ui.button(tr!(model.view.language, "Close")).clicked()
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

#[cfg(test)]
mod tests;
