//! A guided session as it is kept, so that it can be studied afterwards, and its reasons in words.

use std::io;
use std::path::Path;

use serde::{Deserialize, Serialize};

use super::{Ending, Guide, Outcome, Why};
use crate::project::files::{atomic_file, json_text};
use crate::text;
use crate::wording::{English, Text};

/// Name of the record in a session.
pub const GUIDED_RECORD: &str = "guided.json";

/// A guided session.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct GuidedRecord {
    /// The 95 % error that was asked for, millimetres.
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
    /// The error before it by the noise alone, 95 %, millimetres; `None` for the first turns.
    pub before_mm: Option<f64>,
    /// The error that it was to lead to.
    pub promised_mm: Option<f64>,
    /// The error that it led to; `None` where there was no answer yet, and where it was not captured.
    pub achieved_mm: Option<f64>,
    /// How long the arm was to be on its way, seconds.
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

impl GuidedRecord {
    /// Writes it as JSON, as a whole or not at all.
    ///
    /// # Errors
    /// That of the file.
    pub fn write(&self, path: &Path) -> io::Result<()> {
        atomic_file::write(path, json_text::pretty(self)?.as_bytes())
    }
}

impl Guide {
    /// The session so far.
    pub fn record(&self) -> GuidedRecord {
        let mm = |metres: f64| metres * 1e3;
        let steps = self.steps.iter().map(|step| StepRecord {
            translation_m: step.base_from_tip.translation().into(),
            rotation_xyzw: step.base_from_tip.xyzw(),
            joints: step.joints.map(|joints| joints.to_vec()),
            why: step.why.text().say(English),
            before_mm: step.why.errors_m().map(|(from_m, _)| mm(from_m)),
            promised_mm: step.why.errors_m().map(|(_, to_m)| mm(to_m)),
            achieved_mm: step.achieved_m.map(mm),
            travel_s: step.travel_s,
            candidates: step.candidates,
            outcome: match step.outcome {
                Outcome::Pending => "pending",
                Outcome::Captured => "captured",
                Outcome::Failed => "failed",
                Outcome::Skipped => "skipped",
            }
            .to_owned(),
        });
        let ending = self
            .ended
            .as_ref()
            .map(|ending| EndingRecord { code: ending.code().to_owned(), text: ending.text().say(English) });
        let box_mm = self.options.tool_box.map(|tool_box| tool_box.bounds().map(|corner| (corner * 1e3).into()));
        GuidedRecord {
            goal_mm: mm(self.options.goal_m),
            box_mm,
            seed: self.options.seed,
            steps: steps.collect(),
            ending,
        }
    }
}

impl Why {
    /// The 95 % error that is stated now and the one that is promised, metres.
    pub fn errors_m(&self) -> Option<(f64, f64)> {
        match *self {
            Self::FirstTurns { .. } | Self::FirstTilts { .. } => None,
            Self::Gain { from_m, to_m, .. } => Some((from_m, to_m)),
        }
    }

    /// In one sentence.
    pub fn text(&self) -> Text {
        match *self {
            Self::FirstTurns { turn_rad } => text!(
                "A turn of {turn}° about the TCP: where the camera sits is not known yet, so the first moves are small",
                turn = format!("{:.1}", turn_rad.to_degrees())
            ),
            Self::FirstTilts { turn_rad } => text!(
                "Tilted by {turn}° from the first view: small turns do not determine an answer yet",
                turn = format!("{:.0}", turn_rad.to_degrees())
            ),
            Self::Gain { from_m, to_m, rotation_part } => {
                let (from, to) = (format!("{:.3}", from_m * 1e3), format!("{:.3}", to_m * 1e3));
                if rotation_part > 0.5 {
                    text!(
                        "Lowers the expected error from {from} to {to} mm, mostly in the rotation of the camera",
                        from = from,
                        to = to
                    )
                } else {
                    text!(
                        "Lowers the expected error from {from} to {to} mm, mostly in the position of the camera",
                        from = from,
                        to = to
                    )
                }
            }
        }
    }
}

impl Ending {
    /// A code that stays the same.
    pub fn code(&self) -> &'static str {
        match self {
            Self::GoalReached { .. } => "goal_reached",
            Self::LittleToGain { .. } => "little_to_gain",
            Self::MostViews => "most_views",
            Self::MostTime => "most_time",
            Self::StartBlocked { .. } => "start_blocked",
            Self::NoStart => "no_start",
            Self::BoardLost { .. } => "board_lost",
            Self::AnswerLost => "answer_lost",
            Self::Doubted => "doubted",
            Self::NothingInReach { .. } => "nothing_in_reach",
        }
    }

    /// What it means and, where it is no success, what to do.
    pub fn text(&self) -> Text {
        match self {
            Self::GoalReached { error_m } => {
                text!("The goal is reached: the expected error is {error} mm", error = format!("{:.3}", error_m * 1e3))
            }
            Self::LittleToGain { gain } => text!(
                "The best further pose would lower the expected error by {percent} % only: for a smaller error take a larger \
                 board, a camera of higher resolution or a more accurate robot",
                percent = format!("{:.1}", gain * 100.0)
            ),
            Self::MostViews => text!("As many poses as allowed are taken: allow more of them for a smaller error"),
            Self::MostTime => text!("The time that was allowed is over: allow more of it for a smaller error"),
            Self::StartBlocked { by } => text!(
                "Where it stands the arm is {there}: move it into free space, or correct the boxes, and begin again",
                there = by.here()
            ),
            Self::NoStart => text!(
                "No pose near the first one gave a view of the whole board that determines an answer: bring the board to the \
                 middle of the image, with the arm free to turn, and begin again"
            ),
            Self::BoardLost { poses } => text!(
                "{poses} poses in a row gave no view of the whole board: see that it stands where it stood, that light and lens \
                 are as they were, and begin again",
                poses = poses
            ),
            Self::AnswerLost => text!(
                "There was an answer, and the captures that are in the fit now give none: solve again, or see what was found"
            ),
            Self::Doubted => text!(
                "More poses would gain little, and what was found speaks against the answer: see the findings, do what they \
                 say, and begin again"
            ),
            Self::NothingInReach { candidates } => text!(
                "Of {candidates} views of the board none can be reached on a free path: move the board towards the middle of \
                 the workspace and begin again",
                candidates = candidates
            ),
        }
    }

    /// Whether the answer is as good as was asked for.
    pub fn is_success(&self) -> bool {
        matches!(self, Self::GoalReached { .. })
    }
}
