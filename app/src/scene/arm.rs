//! The arm: where it stands, and what its joints do to its links.

use std::sync::LazyLock;

use handeye_core::geometry::arm::ur5::forward;
use handeye_core::geometry::frames::{Base, Pose, Tip};
use handeye_sim_link::cell::scene::Scene;
use handeye_sim_link::client::cell::{ArmChain, JOINTS, JointAngles};
use nalgebra::Isometry3;

use crate::model::CellFacts;

/// The arm of the built-in scene.
static BUILT_IN: LazyLock<Option<ArmChain>> = LazyLock::new(|| {
    let scene = Scene::reference().and_then(|scene| scene.resolve(0)).ok()?;
    Some(ArmChain { base_from_arm: scene.world_from_arm, connection_from_tip: scene.connection_from_tip })
});

/// An arm with its joints at some positions.
#[derive(Debug, Clone)]
pub struct PosedArm {
    /// Where it stands.
    pub base_from_arm: Isometry3<f64>,
    /// What each link, counted from the foot, has moved since all joints were zero.
    pub links: [Isometry3<f64>; JOINTS + 1],
}

/// The arm with these joints; `None` for one whose kinematics is not built in.
///
/// It stands where it was measured in the cell. Without a cell it is that of the built-in scene, if its tip is where the
/// robot reported it: an arm that ends beside its tip would be a lie.
pub fn posed_arm(
    cell: Option<&CellFacts>,
    base_from_tip: &Pose<Base, Tip>,
    joints_rad: &JointAngles,
) -> Option<PosedArm> {
    let chain = match cell {
        Some(facts) => facts.arm,
        None => BUILT_IN.filter(|chain| chain.fits(joints_rad, base_from_tip)),
    }?;
    if !joints_rad.iter().all(|joint| joint.is_finite()) {
        return None;
    }
    let (now, at_zero) = (forward(joints_rad), forward(&[0.0; JOINTS]));
    let links = std::array::from_fn(|link| match link.checked_sub(1) {
        None => Isometry3::identity(),
        Some(joint) => now.arm_from_link[joint] * at_zero.arm_from_link[joint].inverse(),
    });
    Some(PosedArm { base_from_arm: chain.base_from_arm, links })
}

#[cfg(test)]
mod tests {
    use handeye_sim_link::cell::render::{Shape, props};
    use nalgebra::{Point3, Translation3};

    use super::*;
    use crate::gui::testing::sample;

    const JOINTS_RAD: [JointAngles; 3] =
        [[0.0; JOINTS], [0.3, 0.8, -1.0, 0.2, 1.5, 2.0], [-2.0, 0.5, -1.5, 0.4, -1.2, 0.1]];

    fn built_in() -> ArmChain {
        BUILT_IN.expect("the built-in scene")
    }

    /// The ends of the axes of all bodies of the arm in the base, foot first.
    fn axes(arm: &PosedArm) -> Vec<[Point3<f64>; 2]> {
        let ends = |(link, solid): (usize, handeye_sim_link::cell::render::Solid)| {
            let ends = match solid.shape {
                Shape::Capsule { a, b, .. } => [a, b],
                Shape::Cylinder { half_height, .. } => [-half_height, half_height].map(|z| Point3::new(0.0, 0.0, z)),
                other => panic!("the arm has no {other:?}"),
            };
            ends.map(|end| arm.base_from_arm * arm.links[link] * solid.world_from_shape * end)
        };
        props::ur5_parts().map(ends).collect()
    }

    #[test]
    fn the_arm_of_the_reference_scene_stands_on_its_plate_and_hangs_together_up_to_its_tip_with_any_joints() {
        for joints_rad in JOINTS_RAD {
            let base_from_tip = built_in().tip(&joints_rad);
            let axes = axes(&posed_arm(None, &base_from_tip, &joints_rad).expect("the built-in arm"));
            assert_eq!(axes.len(), 19);
            assert!((axes[0][0] - Point3::new(0.0, 0.0, 0.025 - 0.014_65)).norm() < 1e-9, "{:?}", axes[0]);
            // The forearm ends at the wrist, as it does in the scene that the camera sees.
            let (tube, wrist) = (axes[11], axes[12]);
            let axis = (wrist[1] - wrist[0]).normalize();
            let from_wrist = tube[1] - wrist[0];
            assert!((from_wrist - axis * from_wrist.dot(&axis)).norm() < 1e-9, "{from_wrist}");
            let to_tip = axes[18].map(|end| (end.coords - base_from_tip.translation()).norm());
            assert!((to_tip[0].min(to_tip[1]) - 0.017).abs() < 1e-9, "{to_tip:?}");
        }
    }

    #[test]
    fn the_arm_is_where_it_was_measured_with_whatever_tool_and_without_a_cell_only_if_it_ends_at_its_tip() {
        let [_, joints_rad, _] = JOINTS_RAD;
        let elsewhere = Isometry3::translation(1.0, 0.0, 0.0) * built_in().base_from_arm;
        let longer = built_in().connection_from_tip * Translation3::new(0.0, 0.0, 0.1);
        let chain = ArmChain { base_from_arm: elsewhere, connection_from_tip: longer };
        let base_from_tip = chain.tip(&joints_rad);
        let measured = CellFacts { arm: Some(chain), ..sample::connected().cell.expect("connected") };
        let arm = posed_arm(Some(&measured), &base_from_tip, &joints_rad).expect("it was measured");
        assert_eq!(arm.base_from_arm, elsewhere);
        let other = CellFacts { arm: None, ..measured };
        assert!(posed_arm(Some(&other), &built_in().tip(&joints_rad), &joints_rad).is_none());
        assert!(posed_arm(None, &base_from_tip, &joints_rad).is_none());
        assert!(posed_arm(None, &built_in().tip(&joints_rad), &[f64::NAN; JOINTS]).is_none());
    }
}
