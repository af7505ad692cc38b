//! What the arm does and is asked to do.

use std::sync::Arc;

use handeye_driver::RestWatch;
use handeye_estimate::corrected_arm::CorrectedArm;
use handeye_link::{Jog, JogFrame, MotionGoal};
use serde::{Deserialize, Serialize};

use crate::text::Text;

/// Counts motions, to distinguish reports from those of earlier motions.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub struct MotionId(pub u64);

/// A requested motion.
#[derive(Debug, Clone, PartialEq)]
pub struct MotionRequest {
    /// Its number.
    pub id: MotionId,
    /// Where to.
    pub goal: MotionGoal,
    /// Share of the fastest speed, over 0 and up to 1.
    pub speed: f64,
    /// The errors of the arm that the move allows for.
    pub correction: Option<Correction>,
}

impl MotionRequest {
    /// Where the arm is sent.
    ///
    /// # Errors
    /// Why no command gets the tip there.
    pub(crate) fn goal(&self) -> Result<MotionGoal, Text> {
        self.correction.as_ref().map_or_else(|| Ok(self.goal), |correction| correction.command(&self.goal))
    }
}

/// A move that waits until the user allows it.
#[derive(Debug, Clone, PartialEq)]
pub struct PendingMove {
    /// Where to.
    pub goal: MotionGoal,
    /// In words.
    pub what: Text,
}

/// What the arm does now, as far as this program moves it.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub enum Motion {
    /// Nothing.
    #[default]
    Idle,
    /// It is moving.
    Moving {
        id: MotionId,
        /// Where to, in words.
        what: Text,
        /// Since when.
        since_s: f64,
    },
    /// A jog button is held.
    Jogging(Jog),
}

/// How far one press of a jog button moves.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub enum JogStep {
    /// As long as it is held.
    #[default]
    Hold,
    /// This far: metres for translations and prismatic joints, radians for rotations and revolute joints.
    Step {
        /// Translations and prismatic joints.
        metres: f64,
        /// Rotations and revolute joints.
        radians: f64,
    },
}

/// How the tip is jogged.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct JogSettings {
    /// The axes' frame.
    pub frame: JogFrame,
    /// How far.
    pub step: JogStep,
    /// Share of the fastest speed, over 0 and up to 1; `None`: as given by
    /// [`Model::speed`](crate::model::Model::speed).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub speed: Option<f64>,
}

impl Default for JogSettings {
    fn default() -> Self {
        Self { frame: JogFrame::Base, step: JogStep::Hold, speed: None }
    }
}

/// An arm that was commanded to stop, until its states show that it is at rest.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Stopping {
    pub(super) since_s: f64,
    pub(super) watch: RestWatch,
}

/// The arm by which a move is corrected, and where it begins.
#[derive(Debug, Clone, PartialEq)]
pub struct Correction {
    /// The arm with its errors.
    pub arm: Arc<CorrectedArm>,
    /// Joint values near which the arm should stay, radians.
    pub near_rad: Vec<f64>,
}

impl Correction {
    /// What to command so that the tip really gets to `goal`; a goal in joint values is left as it is.
    ///
    /// # Errors
    /// Why there is no such command.
    pub(crate) fn command(&self, goal: &MotionGoal) -> Result<MotionGoal, Text> {
        match goal {
            MotionGoal::Tip(wanted) => match self.arm.command(wanted, &self.near_rad) {
                Ok(command) => Ok(MotionGoal::Tip(command.base_from_tip)),
                Err(why) => Err(Text::from(why)),
            },
            MotionGoal::Joints(_) => Ok(*goal),
        }
    }
}
