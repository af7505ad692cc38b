//! Reasons of a guided session in words.

use super::design::Part;
use super::{Ending, Why};
use handeye_estimate::diagnose::Promise;
use handeye_wording::{Text, text};

impl Why {
    /// The 95 % error that is stated now and the one that is promised, metres.
    pub fn errors_m(&self) -> Option<(f64, f64)> {
        match *self {
            Self::FirstTurns { .. } | Self::FirstTilts { .. } => None,
            Self::Gain { from_m, to_m, .. } => Some((from_m, to_m)),
        }
    }

    /// The reason in one sentence.
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
            Self::Gain { from_m, to_m, part } => {
                let (from, to) = (format!("{:.3}", from_m * 1e3), format!("{:.3}", to_m * 1e3));
                match part {
                    Part::Rotation => text!(
                        "Lowers the expected error from {from} to {to} mm, mostly in the rotation of the camera",
                        from = from,
                        to = to
                    ),
                    Part::Position => text!(
                        "Lowers the expected error from {from} to {to} mm, mostly in the position of the camera",
                        from = from,
                        to = to
                    ),
                    Part::Arm => text!(
                        "Lowers the expected error from {from} to {to} mm, mostly in the errors of the arm",
                        from = from,
                        to = to
                    ),
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
            Self::Repeatability { .. } => "repeatability",
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

    /// What it means and, where it is not a success, what to do.
    pub fn text(&self) -> Text {
        match self {
            Self::GoalReached { promised } => {
                let error = format!("{:.3}", promised.error_m * 1e3);
                match promised.of {
                    Promise::Point => text!("The goal is reached: the expected error is {error} mm", error = error),
                    Promise::Reach | Promise::ReachByAccuracy => {
                        text!("The goal is reached: a tool arrives within {error} mm", error = error)
                    }
                    Promise::ReachCorrected => {
                        text!(
                            "The goal is reached with corrected commands: a tool arrives within {error} mm",
                            error = error
                        )
                    }
                }
            }
            Self::Repeatability { promised } if promised.of == Promise::Reach => text!(
                "A tool arrives within {least} mm by what the arm is off and does not repeat alone, and more poses do not lower that: have the \
                 arm calibrated, or ask for less",
                least = format!("{:.3}", promised.least_m * 1e3)
            ),
            Self::Repeatability { promised } if promised.of == Promise::ReachByAccuracy => text!(
                "A tool arrives within {least} mm by the stated accuracy of the robot alone, and more poses do not lower that: record the \
                 joint values and name the arm, or ask for less",
                least = format!("{:.3}", promised.least_m * 1e3)
            ),
            Self::Repeatability { promised } => text!(
                "A tool arrives within {repeatability} mm by what the arm does not repeat alone, and more poses do not lower that: let it \
                 settle longer before each image, or ask for less",
                repeatability = format!("{:.3}", promised.least_m * 1e3)
            ),
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

    /// Whether the answer is as good as requested.
    pub fn is_success(&self) -> bool {
        matches!(self, Self::GoalReached { .. })
    }
}
