//! A guided session as it is kept, so that it can be studied afterwards.

use serde::{Deserialize, Serialize};

/// Name of the record in a session.
pub const GUIDED_RECORD: &str = "guided.json";

/// A guided session.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct GuidedRecord {
    /// The requested 95 % error, millimetres.
    pub goal_mm: f64,
    /// The box in camera coordinates that the goal holds for, millimetres: smallest and largest coordinates. `None` for where the
    /// camera saw the board.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub box_mm: Option<[[f64; 3]; 2]>,
    /// Seed of the candidates.
    pub seed: u64,
    /// Every pose that was proposed, in order.
    pub steps: Vec<StepRecord>,
    /// Why it ended; `None` while it goes on, and where it was stopped.
    pub ending: Option<EndingRecord>,
}

/// A pose that was proposed, and what came of it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct StepRecord {
    /// Tip in the base, metres.
    pub translation_m: [f64; 3],
    /// Unit quaternion x, y, z, w.
    pub rotation_xyzw: [f64; 4],
    /// Joint values, radians; of a prismatic joint metres. `None` for an arm whose chain is not known.
    pub joints: Option<Vec<f64>>,
    /// Why this pose.
    pub why: String,
    /// The error before it, 95 %, millimetres: of a measured point by the noise alone, or of a tool by corrected commands; `None`
    /// for the first turns.
    pub before_mm: Option<f64>,
    /// The error that it was to lead to.
    pub promised_mm: Option<f64>,
    /// The error that it led to; `None` where there was no answer yet, and where it was not captured.
    pub achieved_mm: Option<f64>,
    /// Planned travel time of the arm, seconds.
    pub travel_s: f64,
    /// Views that were compared.
    pub candidates: usize,
    /// `captured`, `failed`, `skipped` by a person, or `pending` where it was stopped on the way.
    pub outcome: String,
}

/// Why it ended.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct EndingRecord {
    /// A code that stays the same.
    pub code: String,
    /// In words.
    pub text: String,
}

#[cfg(feature = "writing")]
impl GuidedRecord {
    /// Writes it as JSON, as a whole or not at all.
    ///
    /// # Errors
    /// The error of writing the file.
    pub fn write(&self, path: &std::path::Path) -> std::io::Result<()> {
        handeye_files::atomic_file::write(path, handeye_files::json_text::pretty(self)?.as_bytes())
    }
}
