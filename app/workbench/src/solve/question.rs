//! What a solve answers.

use handeye_session::{CaptureId, Role};

use crate::shell::view::Goal;

/// What a calibration depends on. When it changes, there is something to solve.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Question {
    pub meta:
        (handeye_estimate::handeye::Mode, handeye_geometry::targets::TargetSpec, Option<handeye_dataset::CameraInput>),
    pub robot_accuracy_mm: Option<f64>,
    pub captures: Vec<(CaptureId, Role, bool, bool)>,
    pub folder: Option<std::path::PathBuf>,
    pub method: String,
    pub keep_outliers: bool,
    pub goal: Goal,
}
