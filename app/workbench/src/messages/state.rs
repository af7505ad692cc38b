//! What was reported to the user, newest last.

use std::collections::VecDeque;

use serde::{Deserialize, Serialize};

use crate::shell::state::Pane;
use crate::text::{Language, Text};

/// Messages that are kept: enough for a long day of work, but bounded.
const KEPT: usize = 2000;

/// Longest message \[bytes\]: nobody reads more, and text layout takes time.
const LONGEST: usize = 4000;

/// How much a message matters, least first.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub enum Severity {
    /// Success, as requested.
    Info,
    /// Not as requested, or soon not.
    Warning,
    /// It failed.
    Error,
}

/// Where a message is shown. The log has all of them; apart from that each is shown in one place, so that nothing is reported
/// twice.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum Home {
    /// The log alone: it is reported for those who look for it.
    Log,
    /// The line at the bottom: for success, as requested.
    StatusLine,
    /// Below the steps, for a while or until it is closed.
    Toast,
    /// A pane, which shows it for as long as it applies. Below the steps only while that pane is not in front.
    Pane(Pane),
    /// The card below the steps, or the place of the image, until the connection is there.
    Connection,
}

impl Home {
    /// For what has no other place.
    pub(crate) fn of(severity: Severity) -> Self {
        match severity {
            Severity::Info => Self::StatusLine,
            Severity::Warning | Severity::Error => Self::Toast,
        }
    }
}

/// Something that happened, in words.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Message {
    /// Counts the messages since the start of the program.
    pub number: u64,
    /// How much it matters.
    pub severity: Severity,
    /// The words.
    pub text: Text,
    /// Where it is shown apart from the log.
    pub home: Home,
    /// When it happened, for the last time.
    pub at_s: f64,
    /// How often it was reported in a row.
    pub times: u32,
    /// Whether the user has closed it.
    pub dismissed: bool,
}

/// All messages.
#[derive(Debug, Clone, Default)]
pub struct Messages {
    kept: VecDeque<Message>,
    next: u64,
}

impl Messages {
    /// Reports something where messages of its kind are shown. The same words twice in a row are one message that was
    /// reported twice.
    pub fn notify(&mut self, severity: Severity, text: Text, at_s: f64) {
        self.notify_at(Home::of(severity), severity, text, at_s);
    }

    /// The same in a place of its own.
    pub fn notify_at(&mut self, home: Home, severity: Severity, text: Text, at_s: f64) {
        let text = shortened(text);
        if let Some(last) = self.kept.back_mut().filter(|last| last.severity == severity && last.text == text) {
            last.times += 1;
            last.at_s = at_s;
            (last.home, last.dismissed) = (home, false);
            return;
        }
        if self.kept.len() == KEPT {
            self.kept.pop_front();
        }
        self.kept.push_back(Message { number: self.next, severity, text, home, at_s, times: 1, dismissed: false });
        self.next += 1;
    }

    /// The newest message.
    pub fn newest(&self) -> Option<&Message> {
        self.kept.back()
    }

    /// What the status line shows: the last success, until something else happens.
    pub fn status_line(&self) -> Option<&Message> {
        self.kept.iter().next_back().filter(|message| message.home == Home::StatusLine)
    }

    /// What a pane has to show that still applies: the last warning or error that has its place there.
    pub fn shown_in(&self, pane: Pane) -> Option<&Message> {
        let last = self.kept.iter().rev().find(|message| message.home == Home::Pane(pane))?;
        (last.severity != Severity::Info && !last.dismissed).then_some(last)
    }

    /// What is shown in a pane no longer applies.
    pub(crate) fn is_over_in(&mut self, pane: Pane) {
        for message in self.kept.iter_mut().filter(|message| message.home == Home::Pane(pane)) {
            message.dismissed = true;
        }
    }

    /// Oldest first.
    pub fn iter(&self) -> impl DoubleEndedIterator<Item = &Message> + ExactSizeIterator {
        self.kept.iter()
    }

    /// Closes one; it stays in the log.
    pub fn dismiss(&mut self, number: u64) {
        if let Some(message) = self.kept.iter_mut().find(|message| message.number == number) {
            message.dismissed = true;
        }
    }
}

/// As it is, or the first part of it in English.
fn shortened(text: Text) -> Text {
    let reported = text.in_language(Language::English);
    if reported.len() <= LONGEST {
        return text;
    }
    Text::verbatim(format!("{}…", &reported[..reported.floor_char_boundary(LONGEST)]))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_same_words_in_a_row_are_one_message_and_come_back_when_said_again() {
        let mut messages = Messages::default();
        messages.notify(Severity::Error, Text::verbatim("no"), 1.0);
        messages.dismiss(0);
        messages.notify(Severity::Error, Text::verbatim("no"), 2.0);
        let newest = messages.newest().expect("one");
        assert_eq!((newest.times, newest.at_s, newest.dismissed), (2, 2.0, false));
        messages.notify(Severity::Warning, Text::verbatim("no"), 3.0);
        assert_eq!(messages.iter().len(), 2);
    }

    #[test]
    fn a_pane_says_its_last_warning_until_it_is_over() {
        let mut messages = Messages::default();
        messages.notify_at(Home::Pane(Pane::Jog), Severity::Warning, Text::verbatim("no way"), 1.0);
        messages.notify(Severity::Error, Text::verbatim("elsewhere"), 2.0);
        messages.notify(Severity::Info, Text::verbatim("done"), 3.0);
        let reported = |message: Option<&Message>| message.map(|message| message.number);
        assert_eq!(reported(messages.shown_in(Pane::Jog)), Some(0));
        assert_eq!(reported(messages.shown_in(Pane::Track)), None);
        assert_eq!(reported(messages.status_line()), Some(2));
        messages.is_over_in(Pane::Jog);
        assert_eq!(reported(messages.shown_in(Pane::Jog)), None);
    }

    #[test]
    fn old_messages_make_room() {
        let mut messages = Messages::default();
        for count in 0..KEPT + 5 {
            messages.notify(Severity::Info, Text::verbatim(format!("message {count}")), 0.0);
        }
        assert_eq!(messages.iter().len(), KEPT);
        assert_eq!(messages.iter().next().map(|message| message.number), Some(5));
    }
}
