//! Notifications for the user.

use super::command::{Command, Event};
use crate::messages::state::{Home, Severity};
use crate::model::Model;
use crate::shell::state::Pane;
use crate::text::Text;
use handeye_wording::text;

/// Does what is wanted of messages.
pub(crate) fn apply(model: &mut Model, command: Command) {
    match command {
        Command::Dismiss(number) => model.messages.dismiss(number),
    }
}

/// Takes in a notification.
pub(crate) fn absorb(model: &mut Model, event: Event) {
    let Event::Notice { severity, text } = event;
    model.notify(severity, text);
}

impl Model {
    /// Shows a message in a pane for as long as it applies, and keeps it.
    pub(crate) fn notify_in(&mut self, pane: Pane, severity: Severity, text: Text) {
        self.messages.notify_at(Home::Pane(pane), severity, text, self.now_s);
    }

    /// Keeps what the card below the steps shows about the connection.
    pub(crate) fn notify_connection(&mut self, severity: Severity, text: Text) {
        self.messages.notify_at(Home::Connection, severity, text, self.now_s);
    }

    /// Shows a message and keeps it.
    pub(crate) fn notify(&mut self, severity: Severity, text: Text) {
        self.messages.notify(severity, text, self.now_s);
    }

    /// Notifies the user when a worker did not take a request.
    pub(crate) fn notify_if_refused<Refused>(&mut self, failure: Text, asked: Result<(), Refused>) {
        if let Err(_refused) = asked {
            let text = text!("{failure}: the connection does not answer; wait until it is back", failure = failure);
            self.notify(Severity::Warning, text);
        }
    }
}
