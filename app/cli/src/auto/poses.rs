//! Which poses `handeye auto` visits, and how fast.

use std::path::Path;

use handeye_arm::JointValues;
use handeye_cell::scene::{ResolvedScene, Scene};
use handeye_dataset::taught_poses::{Goal, MotionLimits, TaughtPoses};
use handeye_plan::{ViewOptions, ViewSetup, poses_looking_at};

use super::super::open_cell::OpenCell;
use super::super::{Failure, towards_board};
use handeye_link::limits;
use handeye_workbench::session::start::REFERENCE_POSES;

/// Largest tilt of the board at the start of guided capture.
const FIRST_TILT_RAD: f64 = 20.0 * std::f64::consts::PI / 180.0;
/// How many views `--poses auto` plans.
const PLANNED_VIEWS: usize = 20;

/// The ten reference poses.
pub const REFERENCE: &str = "seed10";
/// Poses that are chosen along the way.
pub const GUIDED: &str = "guided";
/// Views of the board that are planned beforehand.
pub const PLANNED: &str = "auto";

/// A sequence of poses.
pub struct Plan {
    /// Where the arm starts.
    pub start_joints: Option<Vec<f64>>,
    /// Names and goals in order.
    pub goals: Vec<(String, Goal)>,
    /// How fast it moves between them.
    pub limits: MotionLimits,
}

impl Plan {
    /// The poses of that name or file; `auto` plans views of the scene's board.
    pub fn find(what: &str, scene: &Scene, seed: Option<u64>) -> Result<Self, Failure> {
        match what {
            REFERENCE => {
                let poses = TaughtPoses::parse(Path::new(REFERENCE), REFERENCE_POSES).map_err(Failure::failed)?;
                Ok(Self::taught(&poses))
            }
            PLANNED => Self::planned(scene, seed),
            GUIDED => Self::begun(scene, seed),
            file => Ok(Self::taught(&TaughtPoses::read(Path::new(file)).map_err(Failure::unusable)?)),
        }
    }

    /// Whether the arm has as many joints as the poses have values.
    pub fn check_joints(&self, need: usize) -> Result<(), Failure> {
        let goals = self.goals.iter().filter_map(|(_, goal)| match goal {
            Goal::Joints(joints) => Some(joints.len()),
            Goal::Tip(_) => None,
        });
        match self.start_joints.iter().map(Vec::len).chain(goals).find(|got| *got != need) {
            None => Ok(()),
            Some(got) => Err(Failure::unusable(anyhow::anyhow!(
                "the poses are for an arm of {got} joints and this one has {need}: give a pose file of this arm, or `--poses \
                 auto` with its scene"
            ))),
        }
    }

    fn taught(taught: &TaughtPoses) -> Self {
        Self {
            start_joints: taught.start_joints_rad.clone(),
            goals: taught.poses.iter().map(|p| (p.name.clone(), p.goal.clone())).collect(),
            limits: taught.limits.unwrap_or(limits::SEQUENCE),
        }
    }

    /// No pose except the start: with the board in view, where a user would jog the arm first.
    fn begun(scene: &Scene, seed: Option<u64>) -> Result<Self, Failure> {
        let resolved = meant(scene, seed)?;
        let options = ViewOptions { count: 1, cone_rad: FIRST_TILT_RAD, seed: resolved.seed, ..ViewOptions::default() };
        let views = poses_looking_at(&ViewSetup::from(&resolved), &options).map_err(Failure::failed)?;
        let start_joints = views.first().map(|view| view.joints.to_vec());
        Ok(Self { start_joints, goals: Vec::new(), limits: limits::SEQUENCE })
    }

    /// Views of the board of a cell that is running, from where its arm is: from its ground truth if it publishes that, and else
    /// from where its scene has board and camera.
    pub fn planned_here(cell: &mut OpenCell, seed: u64) -> Result<Self, Failure> {
        let board = towards_board::board_in_view(cell)?.ok_or_else(|| {
            Failure::failed(anyhow::anyhow!(
                "the position of the board is not known here, so that no views of it can be planned: in a simulation name it by \
                 --object board=PATH, or bring it into the image and use --poses guided"
            ))
        })?;
        let views = cell.views(&board, PLANNED_VIEWS, seed)?;
        let views = views.map_err(|why| {
            Failure::failed(anyhow::anyhow!(
                "no views of the board are planned: {why}; --poses FILE takes them from a file"
            ))
        })?;
        Ok(Self { start_joints: None, goals: named(views.iter()), limits: limits::SEQUENCE })
    }

    /// No poses: the arm starts where it is.
    pub fn from_here() -> Self {
        Self { start_joints: None, goals: Vec::new(), limits: limits::SEQUENCE }
    }

    /// Views from where the scene says that board and camera are *meant* to be: what a user planning a sequence knows.
    fn planned(scene: &Scene, seed: Option<u64>) -> Result<Self, Failure> {
        let resolved = meant(scene, seed)?;
        let seed = resolved.seed;
        let options = ViewOptions { count: PLANNED_VIEWS, seed, ..ViewOptions::default() };
        let views = poses_looking_at(&ViewSetup::from(&resolved), &options).map_err(Failure::failed)?;
        Ok(Self {
            start_joints: Some(resolved.start_joints.to_vec()),
            goals: named(views.iter().map(|view| &view.joints)),
            limits: limits::SEQUENCE,
        })
    }
}

fn named<'a>(views: impl Iterator<Item = &'a JointValues>) -> Vec<(String, Goal)> {
    views.enumerate().map(|(i, joints)| (format!("planned {}", i + 1), Goal::Joints(joints.to_vec()))).collect()
}

/// The scene with board and camera where they are meant to be.
fn meant(scene: &Scene, seed: Option<u64>) -> Result<ResolvedScene, Failure> {
    let mut meant = scene.clone();
    meant.camera.random_offset_mm = 0.0;
    meant.camera.random_offset_deg = 0.0;
    meant.board.random_offset_mm = 0.0;
    meant.board.random_offset_deg = 0.0;
    meant.resolve(seed.unwrap_or(scene.seed)).map_err(Failure::unusable)
}
