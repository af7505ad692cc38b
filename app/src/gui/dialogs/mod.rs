//! Dialogs over the window: folders and files, and what this program is.

mod about;
mod folders;

use egui::{Context, Frame, Id, Margin, Modal, Ui};

use crate::command::{Command, Outbox};
use crate::model::{Dialog, Model};

/// Width of a dialog.
const WIDTH: f32 = 520.0;

/// The dialog that is open, if it is one of these; help and palette are the frame's own.
pub fn dialogs_ui(ctx: &Context, model: &Model, outbox: &mut Outbox) {
    match &model.dialog {
        Some(Dialog::About) => modal_ui(ctx, outbox, |ui, outbox| about::about_ui(ui, model, outbox)),
        Some(Dialog::Help | Dialog::Palette) | None => folders::forget(ctx),
        Some(dialog) => modal_ui(ctx, outbox, |ui, outbox| folders::folders_ui(ui, model, dialog, outbox)),
    }
}

/// Over everything else; Esc and a click beside it close it.
fn modal_ui(ctx: &Context, outbox: &mut Outbox, content_ui: impl FnOnce(&mut Ui, &mut Outbox)) {
    let response = Modal::new(Id::new("dialog")).show(ctx, |ui| {
        Frame::new().inner_margin(Margin::same(12)).show(ui, |ui| {
            ui.set_width(WIDTH.min(ctx.content_rect().width() - 60.0));
            ui.spacing_mut().item_spacing.y = 8.0;
            content_ui(ui, outbox);
        });
    });
    if response.should_close() {
        outbox.send(Command::SetDialog(None));
    }
}

#[cfg(test)]
mod tests;
