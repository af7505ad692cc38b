//! Why the arm cannot be sent to a pose.

use handeye_workbench::model::Model;
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
