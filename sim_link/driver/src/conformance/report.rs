//! What a conformance run found.

use serde::Serialize;

use super::super::error::{DriverError, Ending};

/// How a check ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Outcome {
    /// As the protocol requires.
    Passed,
    /// Works, and could be better.
    Warning,
    /// Not as the protocol requires.
    Failed,
    /// Not tried, because the driver does not report the ability, because it was not allowed, or after an earlier
    /// failure.
    Skipped,
}

/// Findings of a check that did not fail.
#[derive(Debug)]
pub(super) enum Found {
    Passed(String),
    Warning(String),
    Skipped(&'static str),
}

/// What is wrong, and the number and the beginning of the line that it is about.
#[derive(Debug)]
pub(super) struct Wrong {
    text: String,
    line: Option<(u64, String)>,
}

/// How a check ends.
pub(super) type Checked = Result<Found, Wrong>;

/// A failure.
pub(super) fn wrong<T>(text: impl Into<String>) -> Result<T, Wrong> {
    Err(Wrong { text: text.into(), line: None })
}

impl Wrong {
    /// With when it happened.
    pub fn after(self, when: &str) -> Self {
        Self { text: format!("{when}, {}", self.text), ..self }
    }
}

impl From<DriverError> for Wrong {
    fn from(error: DriverError) -> Self {
        let mut line = None;
        let text = match error {
            DriverError::Gone { why: Ending::Broken(broken), .. } => {
                line = Some((broken.number, broken.excerpt.to_string()));
                broken.problem.to_string()
            }
            DriverError::Gone { why, .. } => format!("it {why}"),
            DriverError::Refused { what, why, .. } => format!("it refuses {what}: {why}"),
            DriverError::NoAnswer { what, after, .. } => {
                format!("it has not answered {what} within {} s", after.as_secs_f64())
            }
            other => other.to_string(),
        };
        Self { text, line }
    }
}

/// One check.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Check {
    /// What was checked.
    pub name: &'static str,
    /// How it ended.
    pub outcome: Outcome,
    /// What was found, and what to do.
    pub text: String,
    /// Which line of the driver's output it is about, counted from 1.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub message: Option<u64>,
    /// The beginning of that line.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub line: Option<String>,
}

/// All checks of a driver.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Report {
    /// Its command or address.
    pub driver: String,
    /// Version of the protocol.
    pub protocol: u32,
    /// Whether nothing failed.
    pub passed: bool,
    /// The checks in the order in which they were made.
    pub checks: Vec<Check>,
    /// The last lines of the driver's log.
    pub log: Vec<String>,
}

impl Report {
    pub(super) fn new(driver: String) -> Self {
        Self { driver, protocol: crate::message::PROTOCOL, passed: true, checks: Vec::new(), log: Vec::new() }
    }

    /// Adds a check. Whether it has not failed.
    pub(super) fn add(&mut self, name: &'static str, checked: Checked) -> bool {
        let (outcome, text, line) = match checked {
            Ok(Found::Passed(text)) => (Outcome::Passed, text, None),
            Ok(Found::Warning(text)) => (Outcome::Warning, text, None),
            Ok(Found::Skipped(text)) => (Outcome::Skipped, text.to_owned(), None),
            Err(Wrong { text, line }) => (Outcome::Failed, text, line),
        };
        let (message, line) = line.unzip();
        self.passed &= outcome != Outcome::Failed;
        self.checks.push(Check { name, outcome, text, message, line });
        outcome != Outcome::Failed
    }

    /// For people: a line for each check, and what failed with the line of the driver.
    pub fn text(&self) -> String {
        let mut lines = Vec::new();
        for Check { name, outcome, text: found, message, line } in &self.checks {
            let mark = match outcome {
                Outcome::Passed => "ok     ",
                Outcome::Warning => "warning",
                Outcome::Failed => "FAILED ",
                Outcome::Skipped => "skipped",
            };
            lines.push(format!("{mark}  {name}: {found}"));
            if let (Some(message), Some(line)) = (message, line) {
                lines.push(format!("         message {message}: {line}"));
            }
        }
        lines.extend(self.log.iter().map(|line| format!("log      {line}")));
        let failed = self.checks.iter().filter(|check| check.outcome == Outcome::Failed).count();
        lines.push(match failed {
            0 => format!("{} passes", self.driver),
            1 => format!("{} does not pass: 1 check failed", self.driver),
            _ => format!("{} does not pass: {failed} checks failed", self.driver),
        });
        lines.join("\n") + "\n"
    }
}
