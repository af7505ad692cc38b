//! Writing the files, and the outcome.

use std::path::Path;

use egui::{Button, Label, RichText, Spinner, Ui};

use super::{blocked, formats};
use crate::style::parts;
use crate::style::theme::{Palette, Tone};
use handeye_wording::text;
use handeye_workbench::command::Outbox;
use handeye_workbench::model::{Dialog, Model, exports_of};
use handeye_workbench::tr;
use handeye_workbench::{export, session, shell};

/// Where to, and the button.
pub fn write_ui(ui: &mut Ui, model: &Model, outbox: &mut Outbox) {
    let language = model.view.language;
    let palette = Palette::of(ui);
    parts::section_ui(ui, tr!(language, "Folder"));
    let folder = match (&model.export.folder, &model.session.folder) {
        (Some(folder), _) => folder.display().to_string(),
        (None, Some(session)) => exports_of(session).display().to_string(),
        (None, None) => tr!(language, "exports, in the session").to_owned(),
    };
    ui.add(Label::new(RichText::new(&folder).monospace().size(12.0).color(palette.text)).wrap());
    ui.horizontal_wrapped(|ui| {
        let chosen = formats::chosen(model).len();
        let reason = why_not(model);
        let name = text!("Export {count} {count|format|formats}", count = chosen).in_language(language);
        if parts::gated_ui(ui, reason, Button::new(RichText::new(name).strong())).clicked() {
            outbox.send(export::Command::Export);
        }
        if ui.button(tr!(language, "Choose folder…")).clicked() {
            outbox.send(shell::Command::SetDialog(Some(Dialog::ExportFolder)));
        }
        if model.export.folder.is_some() && ui.button(tr!(language, "In the session")).clicked() {
            outbox.send(export::Command::SetFolder(None));
        }
        if model.in_browser
            && model.export.is_present
            && let Some(folder) =
                model.export.folder.clone().or_else(|| Some(exports_of(model.session.folder.as_ref()?)))
            && ui.button(tr!(language, "Download as one archive")).clicked()
        {
            outbox.send(session::Command::OpenFolder(folder));
        }
        if model.export.writing {
            ui.add(Spinner::new().size(16.0));
        }
    });
}

/// Why nothing is written when the button is pressed.
pub fn why_not(model: &Model) -> Option<&'static str> {
    let language = model.view.language;
    blocked(model).or_else(|| {
        if model.export.writing {
            Some(tr!(language, "Files are being written"))
        } else if formats::chosen(model).is_empty() {
            Some(tr!(language, "Choose a format first"))
        } else {
            None
        }
    })
}

/// The files that were written, or why there are none.
pub fn written_ui(ui: &mut Ui, model: &Model) {
    let language = model.view.language;
    let Some(written) = model.export.written.as_ref().filter(|_| !model.export.writing) else { return };
    let files = match &written.files {
        Err(why) => {
            parts::notice_ui(
                ui,
                Tone::Bad,
                &text!("Nothing was exported: {why}", why = why).in_language(language),
                |_| (),
            );
            return;
        }
        Ok(files) => files,
    };
    let palette = Palette::of(ui);
    for file in files {
        let path = written.folder.join(file);
        let name = name_of(file);
        ui.horizontal(|ui| {
            parts::dot_ui(ui, palette.good);
            ui.label(RichText::new(&name).color(palette.text)).on_hover_text(path.display().to_string());
            ui.label(RichText::new(tr!(language, "read back and compared")).small().color(palette.good));
            let what = text!("path of {file}", file = &name).in_language(language);
            parts::copy_ui(ui, language, &what, || path.display().to_string());
        });
    }
}

fn name_of(file: &Path) -> String {
    file.file_name().unwrap_or(file.as_os_str()).to_string_lossy().into_owned()
}
