//! What the user is told.

use super::App;
use crate::model::Severity;
use crate::text::Text;

impl App {
    /// Shows a message and keeps it.
    pub(super) fn say(&mut self, severity: Severity, text: Text) {
        self.model.messages.say(severity, text, self.model.now_s);
    }
}
