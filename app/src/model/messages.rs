//! What was said to the user, newest last.

use std::collections::VecDeque;

use serde::{Deserialize, Serialize};

use super::Severity;
use crate::text::Text;

/// Messages that are kept: a long day of work, and not a leak.
const KEPT: usize = 2000;

/// Something that happened, in words.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Message {
    /// Counts the messages since the start of the program.
    pub number: u64,
    /// How much it matters.
    pub severity: Severity,
    /// The words.
    pub text: Text,
    /// When it happened, for the last time.
    pub at_s: f64,
    /// How often it was said in a row.
    pub times: u32,
    /// Whether the user has put it aside.
    pub dismissed: bool,
}

/// All messages.
#[derive(Debug, Clone, Default)]
pub struct Messages {
    kept: VecDeque<Message>,
    next: u64,
}

impl Messages {
    /// Says something. The same words twice in a row are one message that was said twice.
    pub fn say(&mut self, severity: Severity, text: Text, at_s: f64) {
        if let Some(last) = self.kept.back_mut().filter(|last| last.severity == severity && last.text == text) {
            last.times += 1;
            last.at_s = at_s;
            last.dismissed = false;
            return;
        }
        if self.kept.len() == KEPT {
            self.kept.pop_front();
        }
        self.kept.push_back(Message { number: self.next, severity, text, at_s, times: 1, dismissed: false });
        self.next += 1;
    }

    /// The last thing that happened.
    pub fn newest(&self) -> Option<&Message> {
        self.kept.back()
    }

    /// Oldest first.
    pub fn iter(&self) -> impl DoubleEndedIterator<Item = &Message> + ExactSizeIterator {
        self.kept.iter()
    }

    /// Puts one aside; it stays in the log.
    pub fn dismiss(&mut self, number: u64) {
        if let Some(message) = self.kept.iter_mut().find(|message| message.number == number) {
            message.dismissed = true;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_same_words_in_a_row_are_one_message_and_come_back_when_said_again() {
        let mut messages = Messages::default();
        messages.say(Severity::Error, Text::verbatim("no"), 1.0);
        messages.dismiss(0);
        messages.say(Severity::Error, Text::verbatim("no"), 2.0);
        let newest = messages.newest().expect("one");
        assert_eq!((newest.times, newest.at_s, newest.dismissed), (2, 2.0, false));
        messages.say(Severity::Warning, Text::verbatim("no"), 3.0);
        assert_eq!(messages.iter().len(), 2);
    }

    #[test]
    fn old_messages_make_room() {
        let mut messages = Messages::default();
        for count in 0..KEPT + 5 {
            messages.say(Severity::Info, Text::verbatim(format!("message {count}")), 0.0);
        }
        assert_eq!(messages.iter().len(), KEPT);
        assert_eq!(messages.iter().next().map(|message| message.number), Some(5));
    }
}
