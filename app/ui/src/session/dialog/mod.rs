//! Choosing a folder or a file. What is in a folder is read on another thread and shown when it is available.

mod list;
mod purpose;

use std::path::{Path, PathBuf};

use egui::text::{CCursor, CCursorRange};
use egui::{Align, Button, Context, Id, Key, Layout, Modifiers, RichText, TextEdit, Ui, WidgetInfo, WidgetType};

use crate::style::parts;
use crate::style::theme::{Palette, Tone};
use crate::typed::MOST_TYPED;
use handeye_workbench::command::Outbox;
use handeye_workbench::model::{Dialog, FolderEntry, FolderKind, Model, Severity};
use handeye_workbench::tr;
use handeye_workbench::{session, shell};
use purpose::Purpose;

/// What the dialog remembers while it is open.
#[derive(Debug, Clone, Default)]
struct State {
    dialog: Option<Dialog>,
    /// The path to act on.
    typed: String,
    /// The entry that the arrow keys have reached.
    selected: Option<usize>,
    /// The path is that of an earlier session, which was clicked.
    is_chosen: bool,
    asked: Option<Asked>,
}

/// A session was requested; the dialog stays until it is open.
#[derive(Debug, Clone, Copy)]
struct Asked {
    /// The newest message before.
    before: Option<u64>,
    /// Frames since.
    frames: u32,
}

fn id() -> Id {
    Id::new("dialog of folders")
}

/// Clears the state of the dialogs.
pub fn forget(ctx: &Context) {
    ctx.data_mut(|data| data.remove::<State>(id()));
}

/// The dialog.
pub fn folders_ui(ui: &mut Ui, model: &Model, dialog: Dialog, outbox: &mut Outbox) {
    let language = model.view.language;
    let purpose = Purpose::of(dialog, language);
    let mut state: State = parts::remembered(ui, id());
    let is_new = state.dialog != Some(dialog);
    if is_new {
        state = State { dialog: Some(dialog), typed: purpose.first_path(model), ..State::default() };
        outbox.send(session::Command::ListFolder(purpose::first_folder(model)));
    }
    keys(ui, model, &purpose, &mut state, outbox);
    ui.label(RichText::new(purpose.title).size(16.0).color(Palette::of(ui).text));
    parts::hint_ui(ui, purpose.hint);
    path_ui(ui, model, &purpose, &mut state, is_new, outbox);
    if dialog == Dialog::Open {
        list::recent_ui(ui, model, &mut state, outbox);
    }
    list::entries_ui(ui, model, &purpose, &mut state, outbox);
    trouble_ui(ui, model, &state);
    buttons_ui(ui, model, &purpose, &mut state, outbox);
    follow(model, &mut state, outbox);
    parts::remember(ui, id(), state);
}

/// Arrows choose an entry, Enter acts. Handled before the field for the path, which would consume them.
fn keys(ui: &mut Ui, model: &Model, purpose: &Purpose, state: &mut State, outbox: &mut Outbox) {
    let shown = list::shown(model, purpose);
    let pressed = |ui: &mut Ui, key| ui.input_mut(|input| input.consume_key(Modifiers::NONE, key));
    let last = shown.len().checked_sub(1);
    let to = if pressed(ui, Key::ArrowDown) {
        last.map(|last| state.selected.map_or(0, |at| (at + 1).min(last)))
    } else if pressed(ui, Key::ArrowUp) {
        last.map(|last| state.selected.map_or(last, |at| at.saturating_sub(1)))
    } else {
        None
    };
    if let Some(entry) = to.and_then(|to| shown.get(to)) {
        state.selected = to;
        if !purpose.is_named() {
            state.typed = purpose::joined(&current(model), &entry.name);
        }
    }
    if pressed(ui, Key::Enter) {
        match state.selected.and_then(|at| shown.get(at)) {
            Some(entry) => activate(model, purpose, state, entry, outbox),
            None if purpose.enters_typed() && !state.is_chosen && Path::new(state.typed.trim()) != current(model) => {
                go(purpose, state, PathBuf::from(state.typed.trim()), outbox);
            }
            None => act(model, purpose, state, outbox),
        }
    }
}

/// The folder that is listed.
fn current(model: &Model) -> PathBuf {
    model.folder.as_ref().map_or_else(|| purpose::first_folder(model), |listing| listing.folder.clone())
}

/// What a double click does: enters a folder, or takes the selected entry.
fn activate(model: &Model, purpose: &Purpose, state: &mut State, entry: &FolderEntry, outbox: &mut Outbox) {
    let path = current(model).join(&entry.name);
    let is_goal = match entry.kind {
        FolderKind::Session | FolderKind::Dataset | FolderKind::Images => purpose.dialog == Dialog::Open,
        FolderKind::File => true,
        FolderKind::Plain => false,
    };
    if is_goal {
        state.typed = path.display().to_string();
        act(model, purpose, state, outbox);
    } else {
        go(purpose, state, path, outbox);
    }
}

/// Lists another folder.
fn go(purpose: &Purpose, state: &mut State, folder: PathBuf, outbox: &mut Outbox) {
    (state.selected, state.is_chosen) = (None, false);
    state.typed = purpose.path_in(&folder, &state.typed);
    outbox.send(session::Command::ListFolder(folder));
}

/// Performs the dialog's action.
fn act(model: &Model, purpose: &Purpose, state: &mut State, outbox: &mut Outbox) {
    let Some(command) = purpose.command(state.typed.trim()) else { return };
    outbox.send(command);
    if purpose.is_awaited() {
        state.asked = Some(Asked { before: model.messages.newest().map(|message| message.number), frames: 0 });
    } else {
        outbox.send(shell::Command::SetDialog(None));
    }
}

/// Closes the dialog when the session is open, and keeps it when it is not.
fn follow(model: &Model, state: &mut State, outbox: &mut Outbox) {
    let Some(asked) = &mut state.asked else { return };
    asked.frames += 1;
    // The command is applied after the frame in which it is requested.
    if asked.frames < 3 || model.opening {
        return;
    }
    if trouble(model, state).is_none() {
        outbox.send(shell::Command::SetDialog(None));
        state.asked = None;
    }
}

/// Why the requested session is not open.
fn trouble(model: &Model, state: &State) -> Option<String> {
    let asked = state.asked.as_ref()?;
    let message = model.messages.iter().rev().find(|message| message.severity == Severity::Error)?;
    let is_later = asked.before.is_none_or(|before| message.number > before);
    is_later.then(|| message.text.in_language(model.view.language))
}

fn path_ui(ui: &mut Ui, model: &Model, purpose: &Purpose, state: &mut State, is_new: bool, outbox: &mut Outbox) {
    let language = model.view.language;
    ui.horizontal(|ui| {
        let field = TextEdit::singleline(&mut state.typed)
            .desired_width(ui.available_width() - 120.0)
            .char_limit(MOST_TYPED)
            .hint_text(purpose.empty_hint);
        let mut shown = field.show(ui);
        let response = &shown.response.response;
        response.widget_info(|| WidgetInfo::labeled(WidgetType::TextEdit, true, tr!(language, "Path")));
        if is_new {
            response.request_focus();
            // After the last letter: a path is usually continued, or its last part replaced.
            let end = CCursorRange::one(CCursor::new(state.typed.chars().count()));
            shown.state.cursor.set_char_range(Some(end));
            shown.state.store(ui.ctx(), response.id);
        }
        if response.changed() {
            (state.selected, state.is_chosen) = (None, false);
            state.asked = None;
        }
        if ui.button(tr!(language, "Folder above")).clicked() {
            go(purpose, state, purpose::above(&current(model)), outbox);
        }
    });
}

fn trouble_ui(ui: &mut Ui, model: &Model, state: &State) {
    if let Some(Err(why)) = model.folder.as_ref().map(|listing| &listing.entries) {
        let reported =
            handeye_wording::text!("The folder cannot be read: {why}", why = why).in_language(model.view.language);
        parts::notice_ui(ui, Tone::Warning, &reported, |_| ());
    }
    if model.opening {
        parts::hint_ui(ui, tr!(model.view.language, "Just a moment…"));
    } else if let Some(why) = trouble(model, state) {
        parts::notice_ui(ui, Tone::Bad, &why, |_| ());
    }
}

fn buttons_ui(ui: &mut Ui, model: &Model, purpose: &Purpose, state: &mut State, outbox: &mut Outbox) {
    let language = model.view.language;
    ui.with_layout(Layout::right_to_left(Align::Center), |ui| {
        let can = purpose.command(state.typed.trim()).is_some() && !model.opening;
        if ui.add_enabled(can, Button::new(RichText::new(purpose.action).strong())).clicked() {
            act(model, purpose, state, outbox);
        }
        if ui.button(tr!(language, "Cancel")).clicked() {
            outbox.send(shell::Command::SetDialog(None));
        }
    });
}
