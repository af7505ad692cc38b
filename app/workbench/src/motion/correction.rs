//! Moves that allow for the errors of the arm.

use std::sync::Arc;

use handeye_estimate::corrected_arm::CorrectedArm;
use handeye_geometry::frames::{Base, Pose, Tip};

use crate::model::{Model, MotionGoal, Solved};
use crate::text::Text;

/// How far the chain of the answer may be from where the robot reports its tip, metres and radians: farther off it is another arm, or
/// another tool.
const FITS: (f64, f64) = (1e-3, 2e-3);

/// The arm of the answer with its errors, where it is the one that stands here and its errors may be counted on.
pub fn corrected_arm(model: &Model) -> Option<(&Solved, &Arc<CorrectedArm>)> {
    let solved = model.solve.current()?;
    let arm = solved.corrected_arm.as_ref()?;
    let robot = model.robot.as_ref()?;
    let (off_m, off_rad) = arm.arm.forward(&robot.joints_rad).ok()?.distance_to(&robot.base_from_tip);
    (off_m <= FITS.0 && off_rad <= FITS.1).then_some((solved, arm))
}

/// Where the tip really is.
pub fn real_tip(model: &Model) -> Option<Pose<Base, Tip>> {
    let (_, arm) = corrected_arm(model)?;
    arm.actual(&model.robot.as_ref()?.joints_rad).ok()
}

/// The distance from [`real_tip`] that the tip is within with a probability of 95 %, metres.
pub fn real_tip_error_95_m(model: &Model) -> Option<f64> {
    let (_, arm) = corrected_arm(model)?;
    arm.error_95_m(&model.robot.as_ref()?.joints_rad).ok()
}

/// By which arm a move is corrected, and where it begins.
#[derive(Debug, Clone, PartialEq)]
pub struct Correction {
    /// The arm with its errors.
    pub arm: Arc<CorrectedArm>,
    /// Joint values near which the arm is to stay, radians.
    pub near_rad: Vec<f64>,
}

impl Correction {
    /// What to command so that the tip really gets where `goal` has it; a goal in joint values is what it is.
    ///
    /// # Errors
    /// Why there is no such command.
    pub fn command(&self, goal: &MotionGoal) -> Result<MotionGoal, Text> {
        match goal {
            MotionGoal::Tip(wanted) => match self.arm.command(wanted, &self.near_rad) {
                Ok(command) => Ok(MotionGoal::Tip(command.base_from_tip)),
                Err(why) => Err(Text::from(why)),
            },
            MotionGoal::Joints(_) => Ok(*goal),
        }
    }
}
