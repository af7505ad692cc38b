//! A finding as written in a document.

use serde::{Deserialize, Serialize};

/// What was found, by which evidence, and what to do.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct FindingRecord {
    /// Machine-readable, `snake_case`.
    pub code: String,
    /// `info`, `advice`, `warning` or `problem`.
    pub severity: String,
    /// The finding in words.
    pub text: String,
    /// The views concerned; empty when it concerns all.
    pub views: Vec<String>,
    /// The numbers behind it.
    pub evidence: Vec<EvidenceRecord>,
}

/// One number with its unit.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct EvidenceRecord {
    /// Name of the number.
    pub name: String,
    /// Its value; `None` when it is not finite.
    pub value: Option<f64>,
    /// Its unit; empty for a count or a ratio.
    pub unit: String,
}
