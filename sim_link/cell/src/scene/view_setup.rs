//! What the planner of views needs to know about a simulated cell.

use handeye_arm::ArmKind;
use handeye_plan::{Arm, ArmBody, Carried, Obstacle, Surroundings, ViewSetup};
use nalgebra::Translation3;

use super::ResolvedScene;

impl From<&ResolvedScene> for ViewSetup {
    /// A simulated cell as it truly is.
    fn from(scene: &ResolvedScene) -> Self {
        let middle = scene.world_from_plane * Translation3::new(0.0, 0.0, -0.001);
        let sheet = Obstacle::new("board", middle, [scene.paper_m[0], scene.paper_m[1], 0.002]);
        let solids = scene.solids.iter().map(|s| Obstacle::new(s.name.clone(), s.world_from_solid, s.size_m));
        Self {
            base_from_target: scene.base_from_target,
            target: scene.target,
            intrinsics: scene.intrinsics,
            tip_from_camera: scene.tip_from_camera,
            arm: Arm {
                chain: scene.arm.clone(),
                body: match scene.arm_model.kind() {
                    Some(ArmKind::Ur5Coppeliasim) => ArmBody::Ur5,
                    _ => ArmBody::of(&scene.arm),
                },
                world_from_arm: scene.world_from_arm,
                connection_from_tip: scene.connection_from_tip,
                carried: vec![Carried::camera(scene.tip_from_camera.isometry())],
            },
            start_joints: scene.start_joints,
            around: Surroundings::of(std::iter::once(sheet).chain(solids).collect()),
        }
    }
}

#[cfg(test)]
#[expect(clippy::unwrap_used, reason = "a test fails by panicking")]
#[path = "view_setup_tests.rs"]
mod tests;
