//! Reasons of a guided session in words.

use super::{Ending, Why};
use handeye_wording::{Text, text};

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
