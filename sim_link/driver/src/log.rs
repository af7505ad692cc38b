//! The log of a driver: `log` messages and standard error, the newest lines.

use std::collections::VecDeque;

use super::message::LogLevel;

/// Most lines that are kept until they are taken.
const MOST: usize = 500;
/// Longest line in bytes.
pub const LONGEST: usize = 2048;

/// A line that a driver wrote for the log.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct LogLine {
    /// Severity; standard error counts as [`LogLevel::Info`].
    pub level: LogLevel,
    /// Whether it was printed to standard error, and not sent as a message.
    pub is_printed: bool,
    /// Text of the line.
    pub text: String,
}

/// The newest lines.
#[derive(Debug, Default)]
pub struct LogLines {
    lines: VecDeque<LogLine>,
    /// Lines that were dropped since the last were taken.
    dropped: u64,
    /// The last line of standard error, for when the driver ends.
    last_printed: Option<String>,
}

impl LogLines {
    /// Adds a line; the oldest makes room for it.
    pub fn add(&mut self, level: LogLevel, is_printed: bool, text: &str) {
        let text = shortened(text.trim_end());
        if is_printed && !text.is_empty() {
            self.last_printed = Some(text.clone());
        }
        if self.lines.len() >= MOST {
            self.lines.pop_front();
            self.dropped += 1;
        }
        self.lines.push_back(LogLine { level, is_printed, text });
    }

    /// All lines since the last call.
    pub fn take(&mut self) -> Vec<LogLine> {
        let mut taken = Vec::with_capacity(self.lines.len() + 1);
        if self.dropped > 0 {
            let text = format!("{} earlier lines are left out", std::mem::take(&mut self.dropped));
            taken.push(LogLine { level: LogLevel::Warn, is_printed: false, text });
        }
        taken.extend(self.lines.drain(..));
        taken
    }

    /// The last line of standard error.
    pub fn last_printed(&self) -> Option<String> {
        self.last_printed.clone()
    }
}

fn shortened(text: &str) -> String {
    if text.len() <= LONGEST {
        return text.to_owned();
    }
    let end = text.floor_char_boundary(LONGEST);
    format!("{}…", &text[..end])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_driver_that_talks_without_end_is_heard_last_and_in_short() {
        let mut log = LogLines::default();
        for i in 0..10_000 {
            log.add(LogLevel::Info, true, &format!("{i} {}", "é".repeat(5000)));
        }
        let taken = log.take();
        assert_eq!(taken.len(), MOST + 1);
        assert!(taken[0].text.starts_with("9500 earlier"), "{}", taken[0].text);
        assert!(taken.iter().all(|line| line.text.len() <= LONGEST + '…'.len_utf8()));
        assert!(log.take().is_empty());
        assert!(log.last_printed().is_some_and(|line| line.starts_with("9999 ")));
    }
}
