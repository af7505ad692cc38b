//! What the user is told.

use crate::app::App;
use crate::model::{Home, Pane, Severity};
use crate::text::Text;

impl App {
    /// Shows what a pane says for as long as it is so, and keeps it.
    pub(crate) fn say_in(&mut self, pane: Pane, severity: Severity, text: Text) {
        self.model.messages.say_at(Home::Pane(pane), severity, text, self.model.now_s);
    }

    /// Keeps what the card below the steps says of the connection.
    pub(crate) fn say_of_connection(&mut self, severity: Severity, text: Text) {
        self.model.messages.say_at(Home::Connection, severity, text, self.model.now_s);
    }

    /// Shows a message and keeps it.
    pub(crate) fn say(&mut self, severity: Severity, text: Text) {
        self.model.messages.say(severity, text, self.model.now_s);
    }
}
