//! Where a simulated arm goes if it does not see the board from its position.

use std::path::Path;

use handeye_coppeliasim::cell::{ArmKinematics, BoardInView};
use handeye_dataset::taught_poses::{Goal, TaughtPoses};
use handeye_workbench::session::start::{BOARD, REFERENCE_POSES};

use super::Failure;
use crate::open_cell::OpenCell;

/// How many views are tried.
const VIEWS: usize = 3;
/// Seed for choosing them; any will do.
const SEED: u64 = 1;

/// A place from which the board should be in view.
pub struct TowardsBoard {
    /// Its name in messages.
    pub name: &'static str,
    pub goal: Goal,
}

/// The board and the camera according to a simulated cell; `None` if it does not report them.
pub fn board_in_view(cell: &mut OpenCell) -> Result<Option<BoardInView>, Failure> {
    let base_from_target = cell.base_from_target(&BOARD)?;
    let in_view = cell.facts.truth.as_ref().zip(base_from_target).map(|(truth, base_from_target)| BoardInView {
        base_from_target,
        target: BOARD,
        intrinsics: truth.intrinsics,
        tip_from_camera: truth.tip_from_camera,
    });
    Ok(in_view)
}

impl TowardsBoard {
    /// Views of the board if its scene states where it is, on free paths from here, and the start of the UR5 of the
    /// reference scene. Empty for a real cell. The paths are checked when the arm goes there.
    pub fn all(cell: &mut OpenCell) -> Result<Vec<Self>, Failure> {
        let views = match board_in_view(cell)? {
            // A board out of reach has no views.
            Some(board) => cell.views(&board, VIEWS, SEED)?.unwrap_or_default(),
            None => Vec::new(),
        };
        let named = |joints: &[f64], name| Self { name, goal: Goal::Joints(joints.to_vec()) };
        let views = views.iter().map(|joints| named(joints, "a view of the board"));
        let reference = TaughtPoses::parse(Path::new("seed10"), REFERENCE_POSES).map_err(Failure::failed)?;
        let is_ur5 = cell.is_simulated() && cell.kinematics().is_some_and(ArmKinematics::is_ur5);
        let start = reference.start_joints_rad.filter(|_| is_ur5);
        let start = start.map(|joints| named(&joints, "the start of the reference poses"));
        Ok(views.chain(start).collect())
    }
}
