//! The arm: where it is, and how its joints move its links.

use std::sync::LazyLock;

use handeye_arm::ArmKind;
use handeye_cell::props;
use handeye_cell::render::Solid;
use handeye_cell::scene::Scene;
use handeye_coppeliasim::cell::ArmKinematics;
use handeye_geometry::frames::{Base, Pose, Tip};
use nalgebra::Isometry3;

use handeye_link::CellFacts;

/// The arm of the built-in scene.
static BUILT_IN: LazyLock<Option<ArmKinematics>> = LazyLock::new(|| {
    let scene = Scene::reference().and_then(|scene| scene.resolve(0)).ok()?;
    let ranges = ArmKind::Ur5Coppeliasim.ranges();
    ArmKinematics::ur5(scene.world_from_arm, scene.connection_from_tip, &ranges).ok()
});

/// An arm with its joints at some positions.
#[derive(Debug, Clone)]
pub struct PosedArm {
    /// Where its base is.
    pub base_from_arm: Isometry3<f64>,
    /// What each link, counted from the foot, has moved since all joints were zero.
    pub links: Vec<Isometry3<f64>>,
    /// Its bodies in the arm frame with all joints at zero, each with the number of its link: those of the UR5, and tubes
    /// between its joints for any other arm.
    pub bodies: Vec<(usize, Solid)>,
}

/// The arm with these joints; `None` for one whose kinematics is not known, and for joints of another arm.
///
/// Its place is as measured in the cell. Without a cell it is the arm of the built-in scene, if its tip is where the
/// robot reported it: an arm that does not end at its tip would be wrong.
pub fn posed_arm(cell: Option<&CellFacts>, base_from_tip: &Pose<Base, Tip>, joints: &[f64]) -> Option<PosedArm> {
    let kinematics = match cell {
        Some(facts) => facts.arm.as_ref(),
        None => BUILT_IN.as_ref().filter(|arm| arm.fits(joints, base_from_tip)),
    }?;
    let arm = kinematics.arm();
    let (now, at_zero) = (arm.frames(joints).ok()?, arm.frames(&vec![0.0; joints.len()]).ok()?);
    let moved = now.base_from_link.iter().zip(&at_zero.base_from_link).map(|(now, zero)| now * zero.inverse());
    Some(PosedArm {
        base_from_arm: *kinematics.base_from_arm(),
        links: std::iter::once(Isometry3::identity()).chain(moved).collect(),
        bodies: if kinematics.is_ur5() { props::ur5_parts().collect() } else { props::link_parts(arm) },
    })
}

#[cfg(test)]
mod tests {
    use handeye_arm::JointValues;
    use handeye_cell::render::Shape;
    use nalgebra::{Point3, Translation3};

    use super::*;
    use crate::testing::sample;

    const JOINTS_RAD: [[f64; 6]; 3] = [[0.0; 6], [0.3, 0.8, -1.0, 0.2, 1.5, 2.0], [-2.0, 0.5, -1.5, 0.4, -1.2, 0.1]];

    fn built_in() -> ArmKinematics {
        BUILT_IN.clone().expect("the built-in scene")
    }

    /// The ends of the axes of all bodies of the arm in the base, foot first.
    fn axes(arm: &PosedArm) -> Vec<[Point3<f64>; 2]> {
        let ends = |(link, solid): &(usize, Solid)| {
            let ends = match solid.shape {
                Shape::Capsule { a, b, .. } => [a, b],
                Shape::Cylinder { half_height, .. } => [-half_height, half_height].map(|z| Point3::new(0.0, 0.0, z)),
                other => panic!("the arm has no {other:?}"),
            };
            ends.map(|end| arm.base_from_arm * arm.links[*link] * solid.world_from_shape * end)
        };
        arm.bodies.iter().map(ends).collect()
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
        let elsewhere = Isometry3::translation(1.0, 0.0, 0.0) * built_in().base_from_arm();
        let longer = built_in().connection_from_tip() * Translation3::new(0.0, 0.0, 0.1);
        let chain = ArmKinematics::ur5(elsewhere, longer, &built_in().arm().ranges()).expect("ranges with room");
        let base_from_tip = chain.tip(&joints_rad);
        let measured = CellFacts { arm: Some(chain), ..sample::connected().cell.expect("connected") };
        let arm = posed_arm(Some(&measured), &base_from_tip, &joints_rad).expect("it was measured");
        assert_eq!(arm.base_from_arm, elsewhere);
        let other = CellFacts { arm: None, ..measured };
        assert!(posed_arm(Some(&other), &built_in().tip(&joints_rad), &joints_rad).is_none());
        assert!(posed_arm(None, &base_from_tip, &joints_rad).is_none());
        assert!(posed_arm(None, &built_in().tip(&joints_rad), &[f64::NAN; 6]).is_none());
        assert!(posed_arm(None, &built_in().tip(&joints_rad), &joints_rad[..5]).is_none());
    }

    /// The Panda has seven joints; its hand hangs on the last one.
    #[test]
    fn any_other_arm_is_drawn_as_tubes_that_hang_together_from_its_foot_to_its_tip() {
        let scene = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../assets/scenes/panda.toml");
        let scene = Scene::load(&scene).and_then(|scene| scene.resolve(0)).expect("it is shipped");
        let kinematics = ArmKinematics::new(scene.arm.clone(), scene.world_from_arm);
        let facts = CellFacts { arm: Some(kinematics.clone()), ..sample::connected().cell.expect("connected") };
        for joints in [scene.start_joints, JointValues::from([0.5, -0.3, 0.8, -1.5, 0.2, 1.9, -1.0])] {
            let base_from_tip = kinematics.tip(&joints);
            let arm = posed_arm(Some(&facts), &base_from_tip, &joints).expect("it is known");
            assert_eq!(arm.links.len(), 8);
            let axes = axes(&arm);
            assert!((axes[0][0].coords - scene.world_from_arm.translation.vector).norm() < 1e-9, "{:?}", axes[0]);
            for pair in axes.windows(2) {
                assert!((pair[0][1] - pair[1][0]).norm() < 1e-9, "a gap: {pair:?}");
            }
            let end = axes.last().expect("tubes")[1].coords;
            assert!((end - base_from_tip.translation()).norm() < 1e-9, "{end}");
        }
    }
}
