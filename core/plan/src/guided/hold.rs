//! Why a guided session goes on although its error is below the goal.

use super::{Guide, IN_A_ROW, Known, LEAST_VIEWS};
use handeye_wording::Text;
use handeye_wording::text;

/// What is missing although the error is below the goal.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Hold {
    /// Fewer than [`LEAST_VIEWS`] views.
    FewViews,
    /// The findings contradict the answer.
    Doubted,
    /// The upper 80 % limit of the noise levels gives an error above the goal, metres.
    NoiseLevels {
        /// The error at that limit.
        error_m: f64,
    },
    /// It was below the goal once, and has to be twice in a row.
    Confirmation,
}

impl Hold {
    /// The reason in words.
    pub fn text(&self) -> Text {
        match self {
            Self::FewViews => text!(
                "Below the goal, and goes on to {views} poses: errors of the robot that depend on the pose cannot be seen in fewer",
                views = LEAST_VIEWS
            ),
            Self::Doubted => {
                text!("Below the goal, and goes on: what was found speaks against the answer, see the findings")
            }
            Self::NoiseLevels { error_m } => text!(
                "Below the goal, and goes on: the noise is known from few poses only and may be larger; then the error would be \
                 {error} mm",
                error = format!("{:.3}", error_m * 1e3)
            ),
            Self::Confirmation => {
                text!("Below the goal, and goes on: {times} answers in a row have to be below it", times = IN_A_ROW)
            }
        }
    }
}

impl Guide {
    /// Why it goes on below the goal, at the last [`Guide::next`]; `None` where the expected error is not below it.
    pub fn hold(&self) -> Option<Hold> {
        self.hold
    }

    /// The same for an answer with this many views.
    pub(super) fn hold_of(&self, known: &Known<'_>, views: usize) -> Option<Hold> {
        let (error, goal_m) = (self.judged?, self.options.goal_m);
        if error.promised.error_m > goal_m {
            return None;
        }
        if views < LEAST_VIEWS {
            return Some(Hold::FewViews);
        }
        if !self.is_sound(known.calibration) {
            return Some(Hold::Doubted);
        }
        let error_m = error.at_upper_levels_m;
        Some(if error_m > goal_m { Hold::NoiseLevels { error_m } } else { Hold::Confirmation })
    }
}
