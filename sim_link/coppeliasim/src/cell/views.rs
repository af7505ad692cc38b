//! Views of a board for the arm of a scene: what the planner of views has to know, from what a client knows.

use handeye_arm::JointValues;
use handeye_geometry::camera::Intrinsics;
use handeye_geometry::frames::{Base, Camera, Pose, Target, Tip};
use handeye_geometry::targets::TargetSpec;
use nalgebra::Isometry3;

use super::reach::ArmKinematics;
use handeye_plan::guided::choose::Robot;
use handeye_plan::{self as planning, Obstacle, Pace, PlanError, Surroundings, ViewOptions, ViewSetup};

/// How far below its frame the arm is mounted \[m\]. Its mounting surface is assumed to be a table.
const TABLE_BELOW_ARM_M: f64 = 0.0147;
/// Edges of that table [m]: more than the arm reaches.
const TABLE_M: [f64; 3] = [4.0, 4.0, 0.1];
/// Views are planned at these multiples of the existing distances, too.
const OTHER_DISTANCES: [f64; 2] = [0.9, 1.1];
/// With fewer views nothing can be reported about their scatter.
const LEAST_VIEWS: usize = 2;

/// A board in the view of a camera on the tip, as far as it is known.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BoardInView {
    /// Where it is.
    pub base_from_target: Pose<Base, Target>,
    /// The target that is to be seen.
    pub target: TargetSpec,
    /// The lens.
    pub intrinsics: Intrinsics,
    /// Where the camera is.
    pub tip_from_camera: Pose<Tip, Camera>,
}

impl BoardInView {
    /// From the camera to the middle of the board when the tip is there \[m\].
    pub(crate) fn distance_m(&self, base_from_tip: &Pose<Base, Tip>) -> f64 {
        let camera_from_target = (*base_from_tip * self.tip_from_camera).inverse() * self.base_from_target;
        (camera_from_target.isometry() * self.target.centre()).coords.norm()
    }
}

impl ArmKinematics {
    /// Joints from which the whole board is seen, as different as possible from the views at `taken` and from each
    /// other: up to `count` of them, at least two, in an order with short ways. Nothing that is known is touched on the
    /// way from `start` to the first and from each to the next.
    ///
    /// The arm itself, the board and the obstacles are known. `seed` is that of the candidate views.
    ///
    /// # Errors
    /// [`PlanError`] with the obstacle.
    pub fn views_unlike(
        &self,
        board: &BoardInView,
        taken: &[Pose<Base, Tip>],
        start: &JointValues,
        around: &Surroundings,
        count: usize,
        seed: u64,
    ) -> Result<Vec<JointValues>, PlanError> {
        let setup = self.view_setup(board, start, around);
        let mut options = ViewOptions { count, seed, ..ViewOptions::default() };
        let distances = taken.iter().map(|pose| board.distance_m(pose));
        if let Some([nearest, farthest]) = distances.fold(None, |range: Option<[f64; 2]>, distance_m| {
            let [nearest, farthest] = range.unwrap_or([distance_m; 2]);
            Some([nearest.min(distance_m), farthest.max(distance_m)])
        }) {
            options.distance_m = [nearest * OTHER_DISTANCES[0], farthest * OTHER_DISTANCES[1]];
        }
        let mut views = match planning::poses_unlike(&setup, &options, taken) {
            Err(PlanError::TooFewViews { found, .. }) if found >= LEAST_VIEWS => {
                planning::poses_unlike(&setup, &ViewOptions { count: found, ..options }, taken)?
            }
            planned => planned?,
        };
        planning::order_by_travel(start, &mut views);
        Ok(views.iter().map(|view| view.joints).collect())
    }

    /// What the planner knows about this arm.
    pub(super) fn view_setup(&self, board: &BoardInView, start: &JointValues, around: &Surroundings) -> ViewSetup {
        let sheet = planning::sheet(&board.target, &board.base_from_target, 0.0);
        ViewSetup {
            base_from_target: board.base_from_target,
            target: board.target,
            intrinsics: board.intrinsics,
            tip_from_camera: board.tip_from_camera,
            arm: self.as_planned(*board.tip_from_camera.isometry()),
            start_joints: *start,
            around: Surroundings::of(vec![sheet]).and(around.clone()),
        }
    }

    /// The arm as guided capture drives it from `joints`, at this pace, among the obstacles. The pose of the camera is not
    /// known before there is an estimate.
    pub fn guided_robot(&self, joints: &JointValues, pace: Pace, around: &Surroundings) -> Robot {
        Robot {
            arm: self.as_planned(Isometry3::identity()),
            around: around.clone(),
            clearance_m: ViewOptions::default().clearance_m,
            joints: *joints,
            pace,
            sight: None,
        }
    }

    pub(super) fn as_planned(&self, tip_from_camera: Isometry3<f64>) -> planning::Arm {
        planning::Arm {
            chain: self.arm().clone(),
            body: if self.is_ur5() { planning::ArmBody::Ur5 } else { planning::ArmBody::of(self.arm()) },
            world_from_arm: *self.base_from_arm(),
            connection_from_tip: *self.connection_from_tip(),
            carried: vec![planning::Carried::camera(&tip_from_camera)],
        }
    }

    /// The plane that the arm is mounted on, where no other obstacles are known.
    pub fn plane(&self) -> Surroundings {
        let below = Isometry3::translation(0.0, 0.0, -TABLE_BELOW_ARM_M - TABLE_M[2] / 2.0);
        Surroundings::of(vec![Obstacle::new("plane under the arm", self.base_from_arm() * below, TABLE_M)])
    }
}

#[cfg(test)]
#[path = "views_tests.rs"]
mod tests;
