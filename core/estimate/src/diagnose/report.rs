//! The diagnosis as a page of text for a person.

use std::fmt::Write as _;

use super::diagnosis::{Diagnosis, Hypothesis};
use super::findings::finding::{Finding, FindingCode, Severity};
use handeye_wording::English;

/// Writing into a `String` cannot fail.
macro_rules! line {
    ($out:expr, $($arg:tt)*) => {{
        let _infallible = writeln!($out, $($arg)*);
    }};
}

/// How much of a diagnosis a page shows.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Detail {
    /// What was found, and in a line what was checked and found fine.
    Found,
    /// Also every hypothesis with what it explains.
    All,
}

pub fn text(diagnosis: &Diagnosis, detail: Detail) -> String {
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
    let reported = |code: FindingCode| diagnosis.findings.iter().any(|finding| finding.code == code);
    let (minor, fine): (Vec<&Hypothesis>, Vec<&Hypothesis>) =
        diagnosis.hypotheses.iter().filter(|h| !h.accepted && !reported(h.code)).partition(|h| h.significant);
    for (what, hypotheses) in
        [("seen, but too small to matter or explained by what was found", minor), ("checked and found fine", fine)]
    {
        let mut names: Vec<&str> = hypotheses.iter().map(|h| checked(h.code)).collect();
        names.dedup();
        if !names.is_empty() {
            line!(out, "{what}: {}", names.join(", "));
        }
    }
    if detail == Detail::All && !diagnosis.hypotheses.is_empty() {
        line!(out, "hypotheses");
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
    let verdict = match (h.accepted, h.significant, h.applied) {
        (true, _, true) => "accepted, and in the answer",
        (true, _, false) => "accepted, and not in the answer",
        (false, true, true) => "too small to be reported, and in the answer",
        (false, true, false) => "significant, but too small or explained by another",
        (false, false, _) => "not supported",
    };
    line!(out, "  {number}. [{}] {verdict}: {}", code(h.code), h.text.in_language(English));
}

/// What a hypothesis is about, for a list of what was checked.
fn checked(code: FindingCode) -> &'static str {
    use FindingCode as C;
    match code {
        C::InvertedPoses => "direction of the robot poses",
        C::InvertedTargetPoses => "direction of the target poses",
        C::WrongMode => "mode",
        C::WrongQuaternionOrder => "order of quaternions",
        C::WrongLengthUnit => "unit of lengths",
        C::ShiftedPoses => "pairing of images and poses",
        C::WrongScale => "size of the target",
        C::BoardBent => "shape of the target",
        C::WrongIntrinsics => "intrinsics",
        C::BoardMoved => "place of the target",
        C::CameraMoved => "place of the camera",
        C::JointOffset => "zeros of the joints",
        C::OutlierView => "single views",
        _ => "other causes",
    }
}

/// The code as written in JSON.
fn code(code: FindingCode) -> String {
    // A unit variant is always a string.
    serde_json::to_value(code).ok().and_then(|v| v.as_str().map(str::to_owned)).unwrap_or_default()
}
