//! Why something cannot be done now, as shown by several panes and the palette.

use handeye_workbench::model::{ArmDoubt, Model};
use handeye_workbench::tr;

/// Why the arm cannot be sent anywhere now.
pub fn immovable(model: &Model) -> Option<&'static str> {
    let is_busy = model.sequence_runs || model.planning;
    unmovable(model).or_else(|| is_busy.then(|| tr!(model.view.language, "A sequence is under way")))
}

/// Why the arm cannot be moved, not even by the sequence that is under way.
pub fn unmovable(model: &Model) -> Option<&'static str> {
    let language = model.view.language;
    if !model.control.is_connected() || !model.mover.is_connected() {
        Some(tr!(language, "Not connected: the arm cannot be moved until the connection is there"))
    } else if model.resting_simulation().is_some() {
        Some(tr!(language, "The arm moves only while the simulation runs"))
    } else if !model.is_armed() {
        Some(tr!(language, "The robot is only read until you let the workbench move it, in Jog"))
    } else {
        None
    }
}

/// Why the arm's chain of joints is not known, so that nothing can be planned with it; `None` if it is.
pub fn unknown_arm(model: &Model) -> Option<&'static str> {
    let (cell, language) = (model.cell.as_ref(), model.view.language);
    if cell.is_some_and(|cell| cell.arm.is_some()) {
        return None;
    }
    Some(match cell.and_then(|cell| cell.arm_doubt) {
        Some(ArmDoubt::Open) => tr!(
            language,
            "It is not known yet where the robot's joints begin and what tool it carries: let it stand at four places, each \
             turned by 15° or more, about two axes"
        ),
        Some(ArmDoubt::Foreign { .. }) => tr!(
            language,
            "The robot's joints and poses do not agree: the log says how far they are apart, and what to do"
        ),
        None => tr!(language, "This arm's kinematics is not known, so no poses can be chosen: move it yourself"),
    })
}

/// Why no capture can be taken now.
pub fn hindrance(model: &Model) -> Option<&'static str> {
    let language = model.view.language;
    if model.capture.is_some() {
        Some(tr!(language, "A capture is under way"))
    } else if model.sequence_runs {
        Some(tr!(language, "The sequence is taking the captures"))
    } else if let Some(why) = needs_robot(model) {
        Some(why)
    } else if !model.camera.is_connected() || model.frame.is_none() {
        Some(tr!(language, "There are no images: connect a cell first"))
    } else if !model.control.is_connected() {
        Some(tr!(language, "The robot is not connected"))
    } else {
        None
    }
}

/// Why no capture can be taken into this session at all.
pub fn needs_robot(model: &Model) -> Option<&'static str> {
    let why = || tr!(model.view.language, "This session has images without a robot: begin a new session for captures");
    model.document().mode().is_none().then(why)
}
