//! The diagnosis as a page of text for a person.

use std::fmt::Write as _;

use super::{Diagnosis, Hypothesis};
use crate::diagnose::findings::{Finding, Severity};
use crate::wording::English;

/// Writing into a `String` cannot fail.
macro_rules! line {
    ($out:expr, $($arg:tt)*) => {{
        let _infallible = writeln!($out, $($arg)*);
    }};
}

pub fn text(diagnosis: &Diagnosis) -> String {
    let mut out = String::new();
    let grave = diagnosis.findings.iter().filter(|f| f.severity >= Severity::Warning).count();
    match (grave, &diagnosis.untested) {
        (0, None) => line!(out, "Nothing was found that may spoil the answer."),
        (0, Some(_)) => line!(out, "Nothing was found, but the data could not be tested."),
        (1, _) => line!(out, "One thing was found that may spoil the answer."),
        (n, _) => line!(out, "{n} things were found that may spoil the answer."),
    }
    for finding in &diagnosis.findings {
        self::finding(&mut out, finding);
    }
    if let Some(why) = &diagnosis.untested {
        line!(out, "hypotheses were not tested: {why}");
    }
    if !diagnosis.hypotheses.is_empty() {
        line!(out, "hypotheses, none of them applied");
        for (number, h) in diagnosis.hypotheses.iter().enumerate() {
            hypothesis(&mut out, number + 1, h);
        }
    }
    out
}

fn finding(out: &mut String, finding: &Finding) {
    let severity = match finding.severity {
        Severity::Problem => "problem",
        Severity::Warning => "warning",
        Severity::Advice => "advice",
        Severity::Info => "note",
    };
    line!(out, "{severity} [{}] {}", code(finding.code), finding);
}

fn hypothesis(out: &mut String, number: usize, h: &Hypothesis) {
    let verdict = match (h.accepted, h.significant) {
        (true, _) => "accepted",
        (false, true) => "significant, but too small or explained by another",
        (false, false) => "not supported",
    };
    line!(out, "  {number}. [{}] {verdict}: {}", code(h.code), h.text.say(English));
}

/// The code as it stands in JSON.
fn code(code: crate::diagnose::findings::FindingCode) -> String {
    // A unit variant is always a string.
    serde_json::to_value(code).ok().and_then(|v| v.as_str().map(str::to_owned)).unwrap_or_default()
}
