//! Where a simulated arm goes that does not see the board from where it stands.

use std::path::Path;

use handeye_arm::JointValues;
use handeye_coppeliasim::cell::{Arm, ArmKinematics, BoardInView, GroundTruth};
use handeye_dataset::taught_poses::TaughtPoses;
use handeye_geometry::frames::{Base, Pose, Target};
use handeye_plan::Surroundings;

use super::Failure;
use handeye_workbench::session::start::{BOARD, REFERENCE_POSES};

/// How many views are tried.
const VIEWS: usize = 3;
/// Chooses them; any does.
const SEED: u64 = 1;

/// Where a cell has its board: by its truth where it publishes that, and else by its scene; `None` where neither knows.
pub fn base_from_target(arm: &mut Arm, truth: &GroundTruth) -> Result<Option<Pose<Base, Target>>, Failure> {
    match truth.base_from_target {
        Some(published) => Ok(Some(published)),
        None => arm.base_from_board(&BOARD).map_err(Failure::failed),
    }
}

/// A place from which the board should be in view.
pub struct TowardsBoard {
    /// What is said of it.
    pub name: &'static str,
    pub joints: JointValues,
}

impl TowardsBoard {
    /// Views of the board where its scene says where it is, on free ways from here, and where the UR5 of the reference scene
    /// begins. The ways have to be checked when the arm goes there.
    pub fn all(
        arm: &mut Arm,
        kinematics: &ArmKinematics,
        truth: &GroundTruth,
        around: &Surroundings,
    ) -> Result<Vec<Self>, Failure> {
        let base_from_target = base_from_target(arm, truth)?;
        let GroundTruth { tip_from_camera, intrinsics, .. } = *truth;
        let here = arm.joint_values().map_err(Failure::failed)?;
        let views = base_from_target.and_then(|base_from_target| {
            let board = BoardInView { base_from_target, target: BOARD, intrinsics, tip_from_camera };
            // A board out of reach has no views.
            kinematics.views_unlike(&board, &[], &here, around, VIEWS, SEED).ok()
        });
        let views = views.unwrap_or_default().into_iter().map(|joints| Self { name: "a view of the board", joints });
        let reference = TaughtPoses::parse(Path::new("seed10"), REFERENCE_POSES).map_err(Failure::failed)?;
        let start = reference.start_joints_rad.filter(|_| kinematics.is_ur5());
        let start = start.and_then(|joints| JointValues::try_from(&joints[..]).ok());
        let start = start.map(|joints| Self { name: "the start of the reference poses", joints });
        Ok(views.chain(start).collect())
    }
}
