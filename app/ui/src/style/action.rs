//! The buttons for what a status asks the user to do.

use egui::Ui;

use crate::status::Action;
use handeye_workbench::command::Outbox;
use handeye_workbench::connect;
use handeye_workbench::text::Language;
use handeye_workbench::tr;

/// The buttons for an action.
pub(crate) fn action_ui(ui: &mut Ui, action: Option<Action>, language: Language, outbox: &mut Outbox) {
    let reconnect = (tr!(language, "Try again now"), connect::Command::Reconnect);
    let stop = (tr!(language, "Stop trying"), connect::Command::StopTrying);
    let buttons = match action {
        None => return,
        Some(Action::Reconnect) => vec![reconnect],
        Some(Action::ReconnectOrStop) => vec![reconnect, stop],
        Some(Action::StopTrying) => vec![stop],
        Some(Action::StartSimulation) => vec![(tr!(language, "Start simulation"), connect::Command::StartSimulation)],
        Some(Action::ContinueSimulation) => {
            vec![(tr!(language, "Continue simulation"), connect::Command::StartSimulation)]
        }
    };
    for (text, command) in buttons {
        if ui.button(text).clicked() {
            outbox.send(command);
        }
    }
}
