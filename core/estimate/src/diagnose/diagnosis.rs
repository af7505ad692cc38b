//! What the doctor says of a session.

use serde::Serialize;

use super::findings::finding::{Evidence, Finding, FindingCode, Severity};
use super::report::{self, Detail};
use handeye_wording::Text;

/// A hypothesis about the data.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Hypothesis {
    /// What it states.
    pub code: FindingCode,
    /// What it states in addition, when several things have to be changed together, or what explains the data just as
    /// well (inverted poses and the other mode are the same equations).
    pub with: Vec<FindingCode>,
    /// The hypothesis in words, with what it explains.
    #[serde(serialize_with = "Text::serialize_english")]
    pub text: Text,
    /// What to do if it is true.
    #[serde(serialize_with = "Text::serialize_english")]
    pub advice: Text,
    /// Natural logarithm of how many times better it explains the data than they are explained without it; negative when
    /// it explains them worse.
    pub gain: f64,
    /// What it estimates, and one standard deviation.
    pub estimate: Option<Estimate>,
    /// The numbers behind it.
    pub evidence: Vec<Evidence>,
    /// The views concerned, by name; for a move the first view after it.
    pub views: Vec<String>,
    /// Whether chance is ruled out.
    pub significant: bool,
    /// Whether it is also large enough to matter, better on views held out, and not explained by one that explains more.
    /// It is then among the findings.
    pub accepted: bool,
    /// Whether the calibration already accounts for it: a bend or a size that was estimated, views that are left out.
    pub applied: bool,
}

impl Hypothesis {
    /// The hypothesis in words, with what to do.
    pub(super) fn text_with_advice(&self) -> Text {
        Text::sentences([self.text.clone(), self.advice.clone()])
    }
}

/// A number that a hypothesis estimates.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Estimate {
    /// Name of the quantity, as in the JSON.
    pub name: &'static str,
    /// The estimate, in `unit`.
    pub value: f64,
    /// One standard deviation; `None` where none is known.
    pub sigma: Option<f64>,
    /// Its unit; empty for a ratio.
    pub unit: &'static str,
}

/// The diagnosis of a session.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct Diagnosis {
    /// Everything found, the most severe first; accepted hypotheses are among them.
    pub findings: Vec<Finding>,
    /// What was tested: accepted hypotheses in the order of their weight, then the best of every other kind.
    pub hypotheses: Vec<Hypothesis>,
    /// Why hypotheses could not be tested; `None` when they were.
    pub untested: Option<String>,
}

impl Diagnosis {
    /// Whether nothing was found that may spoil the answer.
    pub fn is_healthy(&self) -> bool {
        self.untested.is_none() && self.findings.iter().all(|f| f.severity < Severity::Warning)
    }

    /// The diagnosis as a page of text. It ends with a newline.
    pub fn report(&self, detail: Detail) -> String {
        report::text(self, detail)
    }
}
