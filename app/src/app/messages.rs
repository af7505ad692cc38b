//! What the user is told.

use super::App;
use crate::model::{Message, Severity};
use crate::text::Text;

/// So many messages are kept for the log.
const KEPT: usize = 500;

impl App {
    /// Shows a message and keeps it.
    pub(super) fn say(&mut self, severity: Severity, text: Text) {
        self.numbers.message += 1;
        let id = self.numbers.message;
        if self.model.messages.len() == KEPT {
            self.model.messages.pop_front();
        }
        self.model.messages.push_back(Message { id, dismissed: false, severity, text, at_s: self.model.now_s });
    }

    pub(super) fn dismiss(&mut self, id: u64) {
        for message in self.model.messages.iter_mut().filter(|message| message.id == id) {
            message.dismissed = true;
        }
    }
}
