//! Where everything is in the recording. `docs/reference/rerun.md` lists the same.
//!
//! A transform on an entity is `parent_from_child` along the tree: `base/tip` holds `base_from_tip`. Everything with a
//! pose is below [`BASE`] or [`TRUTH`], both of which coincide with the root.

use handeye_estimate::handeye::Mode;
use handeye_session::CaptureId;

/// Number of the newest capture: how many were taken up to then. What happens between two captures has no time here.
pub const CAPTURE_TIMELINE: &str = "capture";
/// Simulated time, a duration.
pub const SIM_TIMELINE: &str = "sim_time";

/// The robot's base: the world.
pub const BASE: &str = "base";
/// Where the arm's foot is, `base_from_arm`; its links are below, see [`link`].
pub const ARM: &str = "base/arm";
/// The tip as the controller reports it, `base_from_tip`.
pub const TIP: &str = "base/tip";
/// The trail of the tip since the recording began, in blocks.
pub const TRAJECTORY_SESSION: &str = "base/trajectory/session";
/// The trail of the tip since the cell was connected, in blocks.
pub const TRAJECTORY_CONNECTION: &str = "base/trajectory/since_connect";
/// Points that the newest depth image sees, in the base.
pub const POINTS: &str = "base/points";
/// The captures, one entity each, see [`capture`].
pub const CAPTURES: &str = "base/captures";
/// Where guided capture moves next: the camera on the tip, or the board on it.
pub const PLANNED: &str = "base/planned";
/// Boxes around the obstacles that the cell reports.
pub const STANDING: &str = "base/around/scene";
/// Boxes that the user keeps the arm out of.
pub const KEEP_OUT: &str = "base/around/keep_out";
/// The board as it is tracked, `base_from_target`.
pub const TRACKED_BOARD: &str = "base/track/board";
/// The board from the newest image alone.
pub const TRACKED_BY_PNP: &str = "base/track/by_pnp";
/// The board from the newest depths alone.
pub const TRACKED_BY_DEPTH: &str = "base/track/by_depth";
/// The first corner from its own depth alone, a point in the base.
pub const TRACKED_FIRST_CORNER: &str = "base/track/first_corner_by_depth";

/// What a simulated cell publishes about itself.
pub const TRUTH: &str = "truth";
/// Where the camera really is, `base_from_camera`.
pub const TRUE_CAMERA: &str = "truth/camera";
/// Where the board really is, `base_from_target`.
pub const TRUE_BOARD: &str = "truth/board";

/// The capture that was selected last: its image, corners, predicted corners and residuals.
pub const SELECTED: &str = "selected";

/// Residual of the fit \[px\].
pub const PLOT_RMS: &str = "plots/residual/fit";
/// Residual of views held out of the fit \[px\].
pub const PLOT_HELDOUT: &str = "plots/residual/held_out";
/// Error of prediction on captures that verify \[px\].
pub const PLOT_VERIFIED: &str = "plots/residual/verification";
/// Expected error of a measured point, 95 % \[mm\].
pub const PLOT_EXPECTED: &str = "plots/expected_error";
/// The joints \[deg, or mm of a prismatic one\].
pub const PLOT_JOINTS: &str = "plots/joints";
/// From image to tracked pose \[ms\].
pub const PLOT_LATENCY: &str = "plots/track/latency";
/// Time that the search for the board took \[ms\].
pub const PLOT_SEARCH: &str = "plots/live/search";
/// Tracked board compared with its true position \[mm\].
pub const PLOT_TRACK_ERROR: &str = "plots/track/error";
/// Tracked board compared with its true orientation \[deg\].
pub const PLOT_TRACK_TURN: &str = "plots/track/turn_error";
/// The uncertainty that the tracker states for its position, 95 % \[mm\].
pub const PLOT_TRACK_SIGMA: &str = "plots/track/stated_95";
/// Tracked poses per second.
pub const PLOT_TRACK_RATE: &str = "plots/track/rate";
/// Speed of the tracked board [mm/s].
pub const PLOT_TRACK_SPEED: &str = "plots/track/speed";

/// What was reported, with its severity.
pub const LOG: &str = "log";
/// The result as a report, Markdown.
pub const REPORT: &str = "report";
/// The result with all digits: the text of `result.json`.
pub const RESULT: &str = "result";

/// Below a camera: its projection, with everything that is in pixels below it.
pub const LENS: &str = "lens";
/// Below a lens: the colour image.
pub const IMAGE: &str = "image";
/// Below a lens: depths.
pub const DEPTH: &str = "depth";
/// Below a lens: the corners that were found.
pub const CORNERS: &str = "corners";
/// Below a lens: where the calibration predicts the corners.
pub const PREDICTED: &str = "predicted";
/// Below a lens: from prediction to corner, made longer by [`super::style::RESIDUAL_FACTOR`].
pub const RESIDUALS: &str = "residuals_x50";
/// Below a camera: the board in its image alone, `camera_from_target` by PnP.
pub const SEEN_BOARD: &str = "seen_board";
/// Below a camera: where the calibration predicts the board, `camera_from_target`.
pub const PREDICTED_BOARD: &str = "predicted_board";
/// Below a camera or a board: its 95 % region, enlarged by [`super::style::UNCERTAINTY_FACTOR`].
pub const UNCERTAINTY: &str = "uncertainty_95_x100";
/// Below the tracked board: its 95 % region, enlarged by [`super::style::TRACK_UNCERTAINTY_FACTOR`].
pub const TRACK_UNCERTAINTY: &str = "uncertainty_95_x10";
/// Below a board: its outer edge.
pub const OUTLINE: &str = "outline";

/// The camera: on the tip (`tip_from_camera`) or next to the robot (eye to hand, `base_from_camera`).
pub fn camera(mode: Mode) -> &'static str {
    match mode {
        Mode::EyeInHand => "base/tip/camera",
        Mode::EyeToHand => "base/camera",
    }
}

/// The board as calibrated: in the base (`base_from_target`) or on the tip (`tip_from_target`).
pub fn board(mode: Mode) -> &'static str {
    match mode {
        Mode::EyeInHand => "base/board",
        Mode::EyeToHand => "base/tip/board",
    }
}

/// How link `index` of the arm has moved relative to all joints at zero; 0 is the foot.
pub fn link(index: usize) -> String {
    format!("{ARM}/link_{index}")
}

/// The camera at a capture, `base_from_camera`.
pub fn capture(id: CaptureId) -> String {
    format!("{CAPTURES}/{id}")
}

/// The pose that is visited as the `index`-th from now.
pub fn planned(index: usize) -> String {
    format!("{PLANNED}/{index}")
}

/// `child` below `parent`.
pub fn below(parent: &str, child: &str) -> String {
    format!("{parent}/{child}")
}
