//! Which poses `handeye auto` visits, and how fast.

use std::path::Path;

use handeye_core::project::taught_poses::{Goal, MotionLimits, TaughtPoses};
use handeye_sim_link::cell::planning::{ViewOptions, ViewSetup, poses_looking_at};
use handeye_sim_link::cell::scene::Scene;

use super::super::Failure;
use crate::limits;
use crate::session::start::REFERENCE_POSES;

/// How many views `--poses auto` plans.
const PLANNED_VIEWS: usize = 20;

/// A sequence of poses.
pub struct Plan {
    /// Where the arm begins.
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
            "seed10" => {
                let poses = TaughtPoses::parse(Path::new("seed10"), REFERENCE_POSES).map_err(Failure::failed)?;
                Ok(Self::taught(&poses))
            }
            "auto" => Self::planned(scene, seed),
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
        let views = poses_looking_at(&ViewSetup::of(&resolved), &options).map_err(Failure::failed)?;
        Ok(Self {
            start_joints: Some(resolved.start_joints.to_vec()),
            goals: views
                .iter()
                .enumerate()
                .map(|(i, view)| (format!("planned {}", i + 1), Goal::Joints(view.joints.to_vec())))
                .collect(),
            limits: limits::SEQUENCE,
        })
    }
}
