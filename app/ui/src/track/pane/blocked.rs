//! Why the board cannot be tracked or followed now.

use handeye_estimate::handeye::Mode;
use handeye_track::State;

use handeye_workbench::model::{FollowStatus, Model, Motion, Simulation};
use handeye_workbench::tr;

/// Reasons in the language of the window.
pub struct Blocked {
    pub tracking: Option<&'static str>,
    /// For beginning to follow.
    pub follow: Option<&'static str>,
    /// For what only a connected cell can do.
    pub cell: Option<&'static str>,
}

impl Blocked {
    /// What prevents it now.
    pub fn of(model: &Model) -> Self {
        let language = model.view.language;
        let is_connected = model.camera.is_connected() && model.control.is_connected();
        let cell = (!is_connected).then(|| tr!(language, "Not connected: connect to the cell first"));
        let tracking = if model.calibrated().is_none() {
            Some(tr!(language, "There is no hand-eye calibration yet: take captures and solve first"))
        } else {
            cell
        };
        Self { tracking, follow: tracking.or_else(|| follow(model)), cell }
    }
}

/// Why the arm cannot begin to follow a board that could be tracked.
fn follow(model: &Model) -> Option<&'static str> {
    let language = model.view.language;
    let is_hand = model.calibrated().is_some_and(|calibrated| calibrated.hand_eye.mode() == Mode::EyeToHand);
    let is_seen = model.track.newest.as_ref().is_some_and(|it| matches!(it.update.state, State::Tracking { .. }));
    if is_hand {
        Some(tr!(language, "The board is on the arm, so there is nothing that the arm could follow"))
    } else if !model.mover.is_connected() {
        Some(tr!(language, "Not connected: the arm cannot be moved until the connection is there"))
    } else if let Some(simulation) = model.resting_simulation() {
        Some(match simulation {
            Simulation::Paused => tr!(language, "The simulation is paused: the arm moves only while it runs"),
            _ => tr!(language, "The simulation is stopped: the arm moves only while it runs"),
        })
    } else if model.cell.as_ref().is_none_or(|cell| cell.arm.is_none()) {
        Some(tr!(language, "This arm's kinematics is not known, so it cannot follow"))
    } else if model.sequence_runs {
        Some(tr!(language, "A sequence is under way: stop it to move the arm yourself"))
    } else if model.motion != Motion::Idle {
        Some(tr!(language, "The arm is moving: wait until it stands, or stop it"))
    } else if !model.track.on {
        Some(tr!(language, "Start tracking first"))
    } else if !is_seen {
        Some(tr!(language, "The board is not seen now: bring it into view first"))
    } else {
        None
    }
}

/// Whether the arm was requested to follow and has not ended.
pub fn is_following(model: &Model) -> bool {
    let track = &model.track;
    match track.follow {
        FollowStatus::Following { .. } | FollowStatus::MakingRoom | FollowStatus::Waiting => true,
        FollowStatus::Off => track.request.is_some(),
        FollowStatus::Ended(_) => false,
    }
}
