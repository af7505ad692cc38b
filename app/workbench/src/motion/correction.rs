//! Moves that allow for the errors of the arm.

use handeye_estimate::corrected_arm::CorrectedArm;
use handeye_geometry::frames::{Base, Pose, Tip};

use crate::model::Model;
use crate::solve::state::{Corrected, Solved};
use handeye_link::RobotState;

/// How far the chain of the answer may be from where the robot reports its tip, metres and radians: farther off it is another arm, or
/// another tool.
const FITS: (f64, f64) = (1e-3, 2e-3);

/// What is needed for commands that are corrected for the errors of the arm, if it is the connected arm and its errors are
/// reliable.
pub fn corrected(model: &Model) -> Option<(&Solved, &Corrected)> {
    let solved = model.solve.current()?;
    let corrected = solved.corrected.as_ref()?;
    is_connected_arm(&corrected.arm, model.robot.as_ref()?).then_some((solved, corrected))
}

/// Whether this is the arm that reports this state.
pub fn is_connected_arm(arm: &CorrectedArm, robot: &RobotState) -> bool {
    let place = arm.arm.forward(&robot.joints_rad).map(|tip| tip.distance_to(&robot.base_from_tip));
    place.is_ok_and(|(off_m, off_rad)| off_m <= FITS.0 && off_rad <= FITS.1)
}

/// The error of a tool's position with the controller as it is and with corrected commands, millimetres, 95 %; `None` where the
/// errors of this arm are not known.
pub fn expected_mm(model: &Model) -> Option<(f64, f64)> {
    let quality = &corrected(model)?.0.result.quality;
    quality.reach_error_95_mm.zip(quality.reach_error_corrected_95_mm)
}

/// What is needed for corrected commands, if these are expected to bring the tip nearer.
pub(crate) fn helpful(model: &Model) -> Option<&Corrected> {
    let (solved, corrected) = corrected(model)?;
    solved.result.quality.correcting_helps().then_some(corrected)
}

/// Where the tip really is.
pub fn real_tip(model: &Model) -> Option<Pose<Base, Tip>> {
    let (_, corrected) = corrected(model)?;
    corrected.arm.actual(&model.robot.as_ref()?.joints_rad).ok()
}

/// The distance from [`real_tip`] that the tip is within with a probability of 95 %, metres.
pub fn real_tip_error_95_m(model: &Model) -> Option<f64> {
    let (_, corrected) = corrected(model)?;
    corrected.arm.error_95_m(&model.robot.as_ref()?.joints_rad).ok()
}
