//! Everything that can be done from anywhere, in one table: the keyboard, the help about it, the command palette and the
//! menu read it.

use egui::{Key, KeyboardShortcut, Modifiers};

use crate::command::Command;
use crate::model::{CapturePurpose, CellSource, Dialog, Model, Pane, Step, ThemeChoice};
use crate::taught::pane::immovable;
use crate::text::Language;
use crate::tr;

use super::shell;

/// Headings of the help about the keyboard.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Group {
    /// The arm and captures.
    Work,
    /// The session.
    Session,
    /// The steps.
    Steps,
    /// The window.
    Window,
    /// The panes.
    Panes,
}

impl Group {
    /// For people.
    pub fn name(self, language: Language) -> &'static str {
        match self {
            Self::Work => tr!(language, "Robot and captures"),
            Self::Session => tr!(language, "Session"),
            Self::Steps => tr!(language, "Steps"),
            Self::Window => tr!(language, "Window"),
            Self::Panes => tr!(language, "Panes"),
        }
    }
}

/// Something that can be done.
#[derive(Debug, Clone)]
pub struct Action {
    /// For people.
    pub name: &'static str,
    /// Where the help lists it.
    pub group: Group,
    /// The keys that do it; the first one is shown.
    pub keys: &'static [KeyboardShortcut],
    /// What it does; `None` while it cannot be done.
    pub command: Option<Command>,
}

const fn plain(key: Key) -> KeyboardShortcut {
    KeyboardShortcut::new(Modifiers::NONE, key)
}

const fn ctrl(key: Key) -> KeyboardShortcut {
    KeyboardShortcut::new(Modifiers::COMMAND, key)
}

const CTRL_SHIFT: Modifiers = Modifiers { shift: true, ..Modifiers::COMMAND };

/// Stops the arm from anywhere, also while text is typed and while a dialog is open.
pub const STOP_KEY: Key = Key::Escape;

const STOP: &[KeyboardShortcut] = &[plain(STOP_KEY)];
const CAPTURE: &[KeyboardShortcut] = &[plain(Key::Space)];
const DELETE: &[KeyboardShortcut] = &[plain(Key::Delete)];
const REDO: &[KeyboardShortcut] = &[KeyboardShortcut::new(CTRL_SHIFT, Key::Z), ctrl(Key::Y)];
const UNDO: &[KeyboardShortcut] = &[ctrl(Key::Z)];
const NEW: &[KeyboardShortcut] = &[ctrl(Key::N)];
const OPEN: &[KeyboardShortcut] = &[ctrl(Key::O)];
const SAVE: &[KeyboardShortcut] = &[ctrl(Key::S)];
const PALETTE: &[KeyboardShortcut] = &[ctrl(Key::K), ctrl(Key::P)];
const KEYS: &[KeyboardShortcut] = &[plain(Key::F1), plain(Key::Questionmark)];
const STEPS: [&[KeyboardShortcut]; 7] = [
    &[plain(Key::Num1)],
    &[plain(Key::Num2)],
    &[plain(Key::Num3)],
    &[plain(Key::Num4)],
    &[plain(Key::Num5)],
    &[plain(Key::Num6)],
    &[plain(Key::Num7)],
];

/// All of it, in the order of the help.
pub fn all(model: &Model, language: Language) -> Vec<Action> {
    let action = |name, group, keys, command| Action { name, group, keys, command: Some(command) };
    let dialog = |name, keys, dialog| action(name, Group::Session, keys, Command::SetDialog(Some(dialog)));
    let session = crate::session::facts::of(model);
    let connected = model.control.is_connected() && model.camera.is_connected();
    let mut all = vec![
        action(tr!(language, "Stop the arm"), Group::Work, STOP, Command::Stop),
        Action {
            name: tr!(language, "Capture"),
            group: Group::Work,
            keys: CAPTURE,
            command: connected.then_some(Command::Capture(CapturePurpose::Calibrate)),
        },
        Action {
            name: tr!(language, "Capture for verification"),
            group: Group::Work,
            keys: &[],
            command: connected.then_some(Command::Capture(CapturePurpose::Verify)),
        },
        Action {
            name: tr!(language, "Delete the selected captures"),
            group: Group::Work,
            keys: DELETE,
            command: (!model.selection.is_empty()).then(|| Command::Delete(model.selection.clone())),
        },
        Action {
            name: tr!(language, "Verify at planned poses"),
            group: Group::Work,
            keys: &[],
            command: (connected && model.calibrated().is_some()).then_some(Command::VerifyAtPlanned),
        },
        Action {
            name: tr!(language, "Home: where the arm stood when the cell was connected"),
            group: Group::Work,
            keys: &[],
            command: (connected && model.home.is_some() && immovable(model).is_none()).then_some(Command::GoHome),
        },
        Action {
            name: tr!(language, "Reset the cell"),
            group: Group::Work,
            keys: &[],
            command: (model.source.is_built_in() && !model.sequence_runs).then_some(Command::ResetCell),
        },
        action(tr!(language, "Solve"), Group::Work, &[], Command::Solve),
        action(tr!(language, "Start simulation"), Group::Work, &[], Command::StartSimulation),
        action(tr!(language, "Try to connect now"), Group::Work, &[], Command::Reconnect),
        Action {
            name: tr!(language, "Stop trying"),
            group: Group::Work,
            keys: &[],
            command: (matches!(model.source, CellSource::Drivers(_)) && !model.control.is_connected())
                .then_some(Command::StopTrying),
        },
        Action {
            name: tr!(language, "Undo"),
            group: Group::Session,
            keys: UNDO,
            command: session.undo.map(|_| Command::Undo),
        },
        Action {
            name: tr!(language, "Redo"),
            group: Group::Session,
            keys: REDO,
            command: session.redo.map(|_| Command::Redo),
        },
        dialog(tr!(language, "New session…"), NEW, Dialog::New),
        dialog(tr!(language, "Open session…"), OPEN, Dialog::Open),
        dialog(tr!(language, "Save session…"), SAVE, Dialog::SaveAs),
    ];
    for (step, keys) in Step::ALL.into_iter().zip(STEPS) {
        all.push(action(shell::step_name(step, language), Group::Steps, keys, Command::GoToStep(step)));
    }
    let open = |dialog| Command::SetDialog(Some(dialog));
    all.extend([
        action(tr!(language, "All commands"), Group::Window, PALETTE, open(Dialog::Palette)),
        action(tr!(language, "Keyboard"), Group::Window, KEYS, open(Dialog::Help)),
        action(tr!(language, "Light theme"), Group::Window, &[], Command::SetTheme(ThemeChoice::Light)),
        action(tr!(language, "Dark theme"), Group::Window, &[], Command::SetTheme(ThemeChoice::Dark)),
        action(tr!(language, "Reset layout"), Group::Window, &[], Command::ResetLayout),
        Action {
            name: tr!(language, "Open the recording in Rerun"),
            group: Group::Window,
            keys: &[],
            command: model.rerun.on.then_some(Command::OpenRerun),
        },
        action(tr!(language, "About"), Group::Window, &[], open(Dialog::About)),
    ]);
    for other in Language::ALL {
        all.push(action(other.own_name(), Group::Window, &[], Command::SetLanguage(other)));
    }
    for pane in Pane::ALL {
        all.push(action(shell::title(pane, language), Group::Panes, &[], Command::ShowPane(pane)));
    }
    all
}

/// The keys of an action as people write them.
pub fn keys_text(ctx: &egui::Context, action: &Action) -> Vec<String> {
    let names = egui::ModifierNames::NAMES;
    let is_mac = ctx.os().is_mac();
    action
        .keys
        .iter()
        .map(|keys| {
            let key = match keys.logical_key {
                Key::Questionmark => "?",
                Key::Escape => "Esc",
                key => key.name(),
            };
            match names.format(&keys.modifiers, is_mac) {
                modifiers if modifiers.is_empty() => key.to_owned(),
                modifiers => format!("{modifiers}+{key}"),
            }
        })
        .collect()
}

/// What the keys that were pressed in this frame ask for, but for the stop. Nothing while text is typed; a key without
/// Ctrl belongs to the widget that has the focus.
pub fn pressed(ctx: &egui::Context, model: &Model) -> Vec<Command> {
    let any =
        ctx.input(|input| input.events.iter().any(|event| matches!(event, egui::Event::Key { pressed: true, .. })));
    if !any || ctx.text_edit_focused() {
        return Vec::new();
    }
    let focused = ctx.memory(|memory| memory.focused().is_some());
    let mut commands = Vec::new();
    let mut actions = all(model, Language::English);
    // Ctrl+Shift+Z is also Ctrl+Z with one key more: the longer one goes first.
    actions.sort_by_key(|action| !action.keys.iter().any(|keys| keys.modifiers.shift));
    for action in actions {
        let keys = action.keys.iter().filter(|keys| keys.logical_key != STOP_KEY);
        let mut keys = keys.filter(|keys| !(focused && keys.modifiers.is_none() && keys.logical_key == Key::Space));
        if keys.any(|keys| ctx.input_mut(|input| input.consume_shortcut(keys)))
            && let Some(command) = action.command
        {
            commands.push(command);
        }
    }
    commands
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::{CellSource, ViewSettings};

    #[test]
    fn no_two_actions_have_the_same_keys_or_the_same_name_in_a_group() {
        let model = Model::new(CellSource::default(), ViewSettings::default());
        for language in Language::ALL {
            let all = all(&model, language);
            for (index, one) in all.iter().enumerate() {
                for other in &all[index + 1..] {
                    assert!(one.keys.iter().all(|keys| !other.keys.contains(keys)), "{} {}", one.name, other.name);
                    assert!(one.group != other.group || one.name != other.name, "{}", one.name);
                }
            }
        }
    }
}
