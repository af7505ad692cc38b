//! What this program is, and the licences of it and its fonts.

use egui::{RichText, Ui};

use crate::style::parts;
use crate::style::theme::{Palette, TITLE};
use handeye_wording::text;
use handeye_workbench::command::Outbox;
use handeye_workbench::model::Model;
use handeye_workbench::shell;
use handeye_workbench::tr;

/// The dialog.
pub fn about_ui(ui: &mut Ui, model: &Model, outbox: &mut Outbox) {
    let language = model.view.language;
    let palette = Palette::of(ui);
    ui.label(RichText::new("Handeye Workbench").size(TITLE).color(palette.text));
    let version = text!("Version {version}", version = env!("CARGO_PKG_VERSION"));
    ui.label(RichText::new(version.in_language(language)).color(palette.weak));
    parts::hint_ui(
        ui,
        tr!(
            language,
            "Finds where a camera is on a robot or beside it, from images of a printed board, and says how far off the \
             answer may be."
        ),
    );
    parts::section_ui(ui, tr!(language, "Licences"));
    for (what, licence) in [
        (tr!(language, "This program"), "MIT OR Apache-2.0"),
        ("Inter", "SIL Open Font License 1.1"),
        ("Noto Sans SC", "SIL Open Font License 1.1"),
    ] {
        parts::stated_ui(ui, what, licence);
    }
    parts::hint_ui(ui, tr!(language, "It needs no network but the connection to the cell."));
    ui.vertical_centered(|ui| {
        if ui.button(tr!(language, "Close")).clicked() {
            outbox.send(shell::Command::SetDialog(None));
        }
    });
}
