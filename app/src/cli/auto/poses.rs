//! Which poses `handeye auto` visits, and how fast.

use std::path::Path;

use handeye_core::plan::{ViewOptions, ViewSetup, poses_looking_at};
use handeye_core::project::taught_poses::{Goal, TaughtPoses};
use handeye_sim_link::cell::scene::Scene;
use handeye_sim_link::client::MotionLimits;

use super::super::Failure;
use crate::limits;
use crate::session::start::REFERENCE_POSES;

/// How many views `--poses auto` plans.
const PLANNED_VIEWS: usize = 20;

/// As many joints as this program drives.
fn six(joints: &[f64]) -> Result<[f64; 6], Failure> {
    let count = joints.len();
    let wrong = |_| anyhow::anyhow!("the start has {count} joint values; `auto` drives arms of six joints so far");
    joints.try_into().map_err(wrong).map_err(Failure::unusable)
}

/// A sequence of poses.
pub struct Plan {
    /// Where the arm begins.
    pub start_joints: Option<[f64; 6]>,
    /// Names and goals in order.
    pub goals: Vec<(String, Goal)>,
    /// For motions of joints.
    pub joint_limits: MotionLimits,
    /// For motions of the tip: x, y, z, angle.
    pub tip_limits: MotionLimits,
}

impl Plan {
    /// The poses of that name or file; `auto` plans views of the scene's board.
    pub fn find(what: &str, scene: &Scene, seed: Option<u64>) -> Result<Self, Failure> {
        match what {
            "seed10" => {
                Self::taught(&TaughtPoses::parse(Path::new("seed10"), REFERENCE_POSES).map_err(Failure::failed)?)
            }
            "auto" => Self::planned(scene, seed),
            file => Self::taught(&TaughtPoses::read(Path::new(file)).map_err(Failure::unusable)?),
        }
    }

    fn taught(taught: &TaughtPoses) -> Result<Self, Failure> {
        let start_joints = taught.start_joints_rad.as_deref().map(six).transpose()?;
        let limits = taught.limits.unwrap_or(limits::SEQUENCE);
        Ok(Self {
            start_joints,
            goals: taught.poses.iter().map(|p| (p.name.clone(), p.goal.clone())).collect(),
            joint_limits: limits::of_joints(&limits, 1.0),
            tip_limits: limits::of_tip(&limits, 1.0),
        })
    }

    /// Views from where the scene says that board and camera are *meant* to be: what a person planning a sequence knows.
    fn planned(scene: &Scene, seed: Option<u64>) -> Result<Self, Failure> {
        let mut meant = scene.clone();
        meant.camera.random_offset_mm = 0.0;
        meant.camera.random_offset_deg = 0.0;
        meant.board.random_offset_mm = 0.0;
        meant.board.random_offset_deg = 0.0;
        let seed = seed.unwrap_or(scene.seed);
        let resolved = meant.resolve(seed).map_err(Failure::unusable)?;
        let options = ViewOptions { count: PLANNED_VIEWS, seed, ..ViewOptions::default() };
        let views = poses_looking_at(&ViewSetup::from(&resolved), &options).map_err(Failure::failed)?;
        Ok(Self {
            start_joints: Some(six(&resolved.start_joints)?),
            goals: views
                .iter()
                .enumerate()
                .map(|(i, view)| (format!("planned {}", i + 1), Goal::Joints(view.joints.to_vec())))
                .collect(),
            joint_limits: limits::of_joints(&limits::SEQUENCE, 1.0),
            tip_limits: limits::of_tip(&limits::SEQUENCE, 1.0),
        })
    }
}
