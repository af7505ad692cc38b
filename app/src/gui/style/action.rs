//! The button for what a status asks a person to do.

use egui::Ui;

use crate::command::{Command, Outbox};
use crate::gui::status::Action;
use crate::text::Language;
use crate::tr;

/// The button for an action.
pub(crate) fn action_ui(ui: &mut Ui, action: Option<Action>, language: Language, outbox: &mut Outbox) {
    let (text, command) = match action {
        None => return,
        Some(Action::Reconnect) => (tr!(language, "Try again now"), Command::Reconnect),
        Some(Action::StartSimulation) => (tr!(language, "Start simulation"), Command::StartSimulation),
        Some(Action::ContinueSimulation) => (tr!(language, "Continue simulation"), Command::StartSimulation),
    };
    if ui.button(text).clicked() {
        outbox.send(command);
    }
}
