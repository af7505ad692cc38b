//! Sessions that were open before, and the entries of a folder.

use std::path::Path;

use egui::{Align, Layout, RichText, ScrollArea, Ui, WidgetInfo, WidgetType};

use super::purpose::Purpose;
use super::{State, act, activate, current, go, purpose};
use crate::style::parts;
use crate::style::theme::Palette;
use handeye_wording::text;
use handeye_workbench::command::Outbox;
use handeye_workbench::model::{Dialog, FolderEntry, FolderKind, Model};
use handeye_workbench::text::Language;
use handeye_workbench::tr;

/// Height of the list before it scrolls.
const HEIGHT: f32 = 220.0;
/// Number of earlier sessions that are shown.
const MOST_RECENT: usize = 4;

/// Sessions that were open before.
pub fn recent_ui(ui: &mut Ui, model: &Model, state: &mut State, outbox: &mut Outbox) {
    let language = model.view.language;
    if model.recent.is_empty() {
        return;
    }
    parts::caption_ui(ui, tr!(language, "Open before"));
    for recent in model.recent.iter().take(MOST_RECENT) {
        let name = recent.folder.file_name().unwrap_or(recent.folder.as_os_str()).to_string_lossy();
        let path = recent.folder.display().to_string();
        ui.horizontal(|ui| {
            let response = ui.selectable_label(state.typed == path, name.as_ref()).on_hover_text(&path);
            let captures = text!("{count} {count|capture|captures}", count = recent.captures).in_language(language);
            parts::caption_ui(ui, &captures);
            if response.clicked() {
                (state.selected, state.is_chosen) = (None, true);
                state.typed.clone_from(&path);
            }
            if response.double_clicked() {
                act(model, &Purpose::of(Dialog::Open, language), state, outbox);
            }
        });
    }
}

/// Entries that matter to a dialog.
pub fn shown<'a>(model: &'a Model, purpose: &Purpose) -> Vec<&'a FolderEntry> {
    let Some(Ok(entries)) = model.folder.as_ref().map(|listing| &listing.entries) else { return Vec::new() };
    entries.iter().filter(|entry| purpose.shows_files() || entry.kind != FolderKind::File).collect()
}

/// The listing.
pub fn entries_ui(ui: &mut Ui, model: &Model, purpose: &Purpose, state: &mut State, outbox: &mut Outbox) {
    let language = model.view.language;
    let palette = Palette::of(ui);
    let folder = current(model);
    parts::caption_ui(ui, &folder.display().to_string());
    let frame = egui::Frame::new().fill(palette.well).corner_radius(6).inner_margin(6);
    frame.show(ui, |ui| {
        ScrollArea::vertical().id_salt("entries").max_height(HEIGHT).auto_shrink([false, false]).show(ui, |ui| {
            ui.spacing_mut().item_spacing.y = 1.0;
            let entries = shown(model, purpose);
            if model.folder.is_none() {
                parts::hint_ui(ui, tr!(language, "The folder is being read…"));
            } else if entries.is_empty() {
                parts::hint_ui(ui, tr!(language, "There is nothing here to choose."));
            }
            for (at, entry) in entries.into_iter().enumerate() {
                entry_ui(ui, model, purpose, state, at, entry, &folder, outbox);
            }
        });
    });
}

#[expect(clippy::too_many_arguments, reason = "an entry is shown by what it is and what the dialog is")]
fn entry_ui(
    ui: &mut Ui,
    model: &Model,
    purpose: &Purpose,
    state: &mut State,
    at: usize,
    entry: &FolderEntry,
    folder: &Path,
    outbox: &mut Outbox,
) {
    let language = model.view.language;
    let is_selected = state.selected == Some(at);
    ui.horizontal(|ui| {
        let mark = mark(entry.kind, language);
        let response = ui.selectable_label(is_selected, &entry.name);
        let reported = if mark.is_empty() { entry.name.clone() } else { format!("{}, {mark}", entry.name) };
        response.widget_info(|| WidgetInfo::selected(WidgetType::Button, true, is_selected, &reported));
        if response.clicked() {
            if purpose.is_named() && entry.kind != FolderKind::File {
                go(purpose, state, folder.join(&entry.name), outbox);
            } else {
                (state.selected, state.is_chosen) = (Some(at), false);
                state.typed = purpose::joined(folder, &entry.name);
            }
        }
        if response.double_clicked() && !purpose.is_named() {
            activate(model, purpose, state, entry, outbox);
        }
        if is_selected {
            response.scroll_to_me(None);
        }
        ui.with_layout(Layout::right_to_left(Align::Center), |ui| {
            let colour = if entry.kind == FolderKind::Plain { Palette::of(ui).weak } else { Palette::of(ui).accent };
            ui.label(RichText::new(mark).small().color(colour));
        });
    });
}

fn mark(kind: FolderKind, language: Language) -> &'static str {
    match kind {
        FolderKind::Session => tr!(language, "session"),
        FolderKind::Dataset => tr!(language, "data set"),
        FolderKind::Images => tr!(language, "images"),
        FolderKind::File => tr!(language, "poses"),
        FolderKind::Plain => "",
    }
}
