//! What a new session starts with.

use std::collections::BTreeMap;

use handeye_arm::{ArmKind, ArmModel, JointKind};
use handeye_coppeliasim::cell::ArmKinematics;
use handeye_estimate::handeye::{HandEye, Mode};
use handeye_geometry::targets::{Grid, TargetSpec};
use handeye_session::{GroundTruth, SessionMeta};
use nalgebra::Isometry3;

use handeye_link::Truth;

/// The board of the reference scene.
pub const BOARD: TargetSpec = TargetSpec::Chessboard(Grid { columns: 10, rows: 7, square_m: 0.015 });

/// The ten reference poses, embedded in the binary so that they are always available.
pub const REFERENCE_POSES: &str = include_str!("../../../../assets/poses/seed10.toml");

/// The arm of a cell, from its own kinematics. The model of an arm with prismatic joints is of no use to an estimate of its errors.
pub fn arm(kinematics: Option<&ArmKinematics>) -> Option<ArmModel> {
    let of = |it: &ArmKinematics| {
        // Its base and its tool follow from the captures.
        let arm = || it.arm().clone().mounted(Isometry3::identity(), Isometry3::identity());
        if it.is_ur5() { ArmModel::Kind(ArmKind::Ur5Coppeliasim) } else { ArmModel::Chain(Box::new(arm())) }
    };
    kinematics.filter(|it| it.kinds().all(|kind| kind == JointKind::Revolute)).map(of)
}

/// How the joints of an arm move, if a session has to record it: if they are not six revolute ones.
pub fn joint_kinds(kinds: impl Iterator<Item = JointKind>) -> Option<Vec<JointKind>> {
    let kinds: Vec<JointKind> = kinds.collect();
    (kinds != [JointKind::Revolute; 6] && !kinds.is_empty()).then_some(kinds)
}

/// A camera on the tip and the board of the reference scene, with the truth of a cell that publishes it.
pub fn meta(truth: Option<&Truth>, created: String) -> SessionMeta {
    let ground_truth = truth.and_then(|truth| {
        let links =
            HandEye::EyeInHand { tip_from_camera: truth.tip_from_camera, base_from_target: truth.base_from_target? };
        Some(GroundTruth::new(&links, Some(truth.intrinsics)))
    });
    SessionMeta {
        created,
        tool_version: env!("CARGO_PKG_VERSION").to_owned(),
        mode: Mode::EyeInHand,
        target: BOARD,
        camera: None,
        seeds: BTreeMap::new(),
        ground_truth,
        arm: None,
        joint_kinds: None,
        tool_m: None,
        robot_accuracy_mm: None,
    }
}
