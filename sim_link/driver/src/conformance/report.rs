//! What a conformance run found.

use serde::Serialize;

/// How a check ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Outcome {
    /// As the protocol asks for.
    Passed,
    /// Works, and could be better.
    Warning,
    /// Not as the protocol asks for.
    Failed,
    /// Not tried, because the driver does not say that it can, because it was not allowed, or after an earlier failure.
    Skipped,
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
    /// What the driver said for people, the last lines.
    pub log: Vec<String>,
}

impl Report {
    pub(super) fn new(driver: String) -> Self {
        Self { driver, protocol: crate::message::PROTOCOL, passed: true, checks: Vec::new(), log: Vec::new() }
    }

    pub(super) fn add(&mut self, check: Check) {
        self.passed &= check.outcome != Outcome::Failed;
        self.checks.push(check);
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
