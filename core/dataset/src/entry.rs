//! One view of a data set.

use std::path::PathBuf;

use nalgebra::Isometry3;

use handeye_geometry::frames::{Base, Camera, Pose, Target, Tip};
use handeye_geometry::targets::observation::Corner;

/// One view.
#[derive(Debug, Clone, PartialEq)]
pub struct Entry {
    /// The image as the pose table names it; without a table its path in the folder. No two entries have the same.
    pub name: String,
    /// The image file; `None` when only corners or target poses were kept.
    pub image_path: Option<PathBuf>,
    /// Tip pose as the controller reported it; `None` when there is no robot.
    pub base_from_tip: Option<Pose<Base, Tip>>,
    /// Joint angles as the controller reported them, radians; `None` when the pose table has none.
    pub joints_rad: Option<Vec<f64>>,
    /// Poses of the joints relative to the tip, see [`handeye_arm::Arm::tip_from_joints`]; empty without joint angles,
    /// without the arm, or where the two do not fit the poses, see [`Dataset::arm`](super::Dataset::arm).
    pub tip_from_joints: Vec<Isometry3<f64>>,
    /// Corners detected elsewhere, sorted by index, empty when the target was not found in this image; `None` when
    /// the data set has no corner table.
    pub corners: Option<Vec<Corner>>,
    /// Target pose measured elsewhere; `None` when the data set has no such table, or no row for this view.
    pub camera_from_target: Option<Pose<Camera, Target>>,
    /// Row in the pose table, as an editor counts it.
    pub row: Option<usize>,
}
