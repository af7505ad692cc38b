//! Which taught poses belong to the cell that is connected.

use handeye_arm::JointValues;
use handeye_cell::scene::SceneChoice;
use handeye_coppeliasim::cell::{ArmKinematics, CellPart};
use handeye_dataset::taught_poses::{TaughtJoint, TaughtOn, TaughtPose};
use handeye_geometry::targets::TargetSpec;

use crate::model::Model;
use handeye_link::{CellSource, Moves};

impl Model {
    /// The cell that poses are taught on now, before this target; `None` before it is connected.
    pub fn taught_on(&self, target: TargetSpec) -> Option<TaughtOn> {
        let cell = self.cell.as_ref()?;
        let base = match &self.source {
            CellSource::BuiltIn(scene) => format!("built-in cell, scene {}", scene_name(scene)),
            CellSource::Address(address) => format!("{address}, {}", self.objects.get(CellPart::Tip)),
            CellSource::Drivers(drivers) => drivers.to_string(),
        };
        let joints = cell.joints.iter().map(|joint| TaughtJoint { kind: joint.kind, range: joint.range });
        // Behind a driver it is estimated while the arm moves, slightly differently each time.
        let arm = cell.arm.as_ref().filter(|_| cell.moves == Moves::Freely);
        let at_zero =
            |arm: &ArmKinematics| <[f64; 3]>::from(arm.tip(&JointValues::zeros(cell.joints.len())).translation());
        // Undefined if the number of joints differs from that of the chain.
        let tip_at_zero_m = arm.map(at_zero).filter(|tip| tip.iter().all(|value| value.is_finite()));
        Some(TaughtOn { base, joints: joints.collect(), tip_at_zero_m, target })
    }

    /// The taught poses of this cell; empty before it is connected.
    pub fn taught(&self) -> Vec<&TaughtPose> {
        let Some(cell) = self.taught_on(self.document().meta.target) else { return Vec::new() };
        self.document().taught.iter().filter(|pose| pose.is_of(Some(&cell))).collect()
    }

    /// Whether the reference poses are meant for this cell: for CoppeliaSim's UR5 in front of its board.
    pub fn has_reference_poses(&self) -> bool {
        let cell = self.cell.as_ref().filter(|cell| cell.moves == Moves::Freely);
        cell.and_then(|cell| cell.arm.as_ref()).is_some_and(ArmKinematics::is_ur5)
    }
}

/// A scene by its file name or its built-in name.
fn scene_name(scene: &SceneChoice) -> String {
    match scene {
        SceneChoice::Shipped(shipped) => shipped.name().to_owned(),
        SceneChoice::File(file) => file.display().to_string(),
    }
}
