//! Where the web viewer is, for a system that shows no browser by itself.

use egui::{Align, Label, Layout, RichText, Ui};

use crate::style::parts;
use crate::style::theme::{self, Palette};
use handeye_workbench::command::Outbox;
use handeye_workbench::model::{Model, ViewerState};
use handeye_workbench::shell;
use handeye_workbench::tr;

/// The dialog; it closes with the viewer.
pub fn address_ui(ui: &mut Ui, model: &Model, outbox: &mut Outbox) {
    let language = model.view.language;
    let ViewerState::Web { url } = &model.rerun.viewer else {
        outbox.send(shell::Command::SetDialog(None));
        return;
    };
    ui.label(theme::title(tr!(language, "No browser has opened"), 17.0).color(Palette::of(ui).text));
    parts::hint_ui(ui, tr!(language, "The recording is shown at this address, in a browser on this machine:"));
    ui.add(Label::new(RichText::new(url).monospace()).wrap().selectable(true));
    ui.with_layout(Layout::right_to_left(Align::Center), |ui| {
        if ui.button(tr!(language, "Close")).clicked() {
            outbox.send(shell::Command::SetDialog(None));
        }
        if ui.button(tr!(language, "Copy")).clicked() {
            ui.ctx().copy_text(url.clone());
        }
    });
}
