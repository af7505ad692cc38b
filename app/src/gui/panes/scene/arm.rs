//! The arm as its joints have it.

use egui::Color32;
use handeye_core::frames::{Base, Pose, Tip};
use handeye_sim_link::cell::kinematics::{JOINTS, JointAngles, forward};
use handeye_sim_link::cell::render::{Shape, props};
use nalgebra::{Isometry3, Point3, Translation3};

use super::canvas::{Canvas, Cylinder};
use crate::gui::theme::Palette;
use crate::model::Model;

/// Length of the tool between the end of the arm and the tip, as the reference scene has it \[m\]. The tip is always where
/// the controller reports it; with a tool of another length the arm is drawn beside its place by the difference.
const TOOL_M: f64 = 0.017;

/// Where the arm stands, from where its tip is reported with these joints.
fn base_from_arm(base_from_tip: &Pose<Base, Tip>, joints_rad: &JointAngles) -> Isometry3<f64> {
    let connection_from_tip = Translation3::new(0.0, 0.0, TOOL_M);
    base_from_tip.isometry() * (forward(joints_rad).arm_from_connection * connection_from_tip).inverse()
}

/// What the joints do to the links, counted from 0 at the base, of an arm whose parts are given at all joints zero.
fn motions(joints_rad: &JointAngles) -> [Isometry3<f64>; JOINTS + 1] {
    let (now, at_zero) = (forward(joints_rad), forward(&[0.0; JOINTS]));
    std::array::from_fn(|link| match link.checked_sub(1) {
        None => Isometry3::identity(),
        Some(joint) => now.arm_from_link[joint] * at_zero.arm_from_link[joint].inverse(),
    })
}

/// The bodies of the arm in the base, and which of the three tones each has.
fn bodies(base_from_tip: &Pose<Base, Tip>, joints_rad: &JointAngles) -> Vec<(Cylinder, Tone)> {
    let motions = motions(joints_rad);
    let solids = props::ur5(&base_from_arm(base_from_tip, joints_rad), |link| motions[link.min(JOINTS)]);
    let body = |solid: handeye_sim_link::cell::render::Solid| {
        let at = |point: Point3<f64>| solid.world_from_shape * point;
        let cylinder = match solid.shape {
            Shape::Capsule { a, b, radius } => Cylinder { ends: [at(a), at(b)], radius_m: radius, closed: false },
            Shape::Cylinder { radius, half_height } => {
                let ends = [-half_height, half_height].map(|z| at(Point3::new(0.0, 0.0, z)));
                Cylinder { ends, radius_m: radius, closed: true }
            }
            // The arm has no others.
            Shape::Sphere { .. } | Shape::Box { .. } | Shape::Plane => return None,
        };
        Some((cylinder, Tone::of(solid.colour)))
    };
    solids.into_iter().filter_map(body).collect()
}

/// What a part of the arm is made of.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Tone {
    Bright,
    Dark,
    Cover,
}

impl Tone {
    fn of(colour: [f32; 3]) -> Self {
        match colour {
            props::COVER_BLUE => Self::Cover,
            props::GRAPHITE => Self::Dark,
            _ => Self::Bright,
        }
    }

    fn colour(self, palette: &Palette) -> Color32 {
        match self {
            Self::Bright => palette.paper,
            Self::Dark => palette.paper.lerp_to_gamma(palette.ink, 0.55),
            Self::Cover => palette.accent,
        }
    }
}

/// The arm, where its kinematics is known and its tip was read; tells whether it was drawn.
pub fn arm(canvas: &mut Canvas, model: &Model, palette: &Palette) -> bool {
    let is_known = model.cell.as_ref().is_some_and(|cell| cell.kinematics_known);
    let Some(robot) = model.robot.as_ref().filter(|robot| is_known && robot.base_from_tip.is_finite()) else {
        return false;
    };
    for (body, tone) in bodies(&robot.base_from_tip, &robot.joints_rad) {
        canvas.cylinder(&body, tone.colour(palette));
    }
    true
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The pose of the tip that the reference scene has with these joints.
    fn reference_tip(joints_rad: &JointAngles) -> Pose<Base, Tip> {
        let tip = Translation3::new(0.0, 0.0, 0.025) * forward(joints_rad).arm_from_connection;
        Pose::from_isometry(tip * Translation3::new(0.0, 0.0, TOOL_M))
    }

    #[test]
    fn the_arm_of_the_reference_scene_stands_on_its_plate_and_reaches_its_tip_with_any_joints() {
        for joints_rad in [[0.0; JOINTS], [0.3, 0.8, -1.0, 0.2, 1.5, 2.0], [-2.0, 0.5, -1.5, 0.4, -1.2, 0.1]] {
            let tip = reference_tip(&joints_rad);
            let bodies = bodies(&tip, &joints_rad);
            assert_eq!(bodies.len(), 19);
            let (foot, last) = (&bodies[0].0, &bodies[18].0);
            let stands_at = Point3::new(0.0, 0.0, 0.025 - 0.014_65);
            assert!((foot.ends[0] - stands_at).norm() < 1e-9, "{:?}", foot.ends);
            let end = last.ends.iter().map(|end| (end.coords - tip.translation()).norm()).fold(f64::INFINITY, f64::min);
            assert!((end - TOOL_M).abs() < 1e-9, "{end}");
        }
    }

    #[test]
    fn the_parts_of_the_arm_hang_together_with_any_joints() {
        let joints_rad = [0.7, -0.6, 1.1, -0.9, 1.3, -2.2];
        let bodies = bodies(&reference_tip(&joints_rad), &joints_rad);
        // The forearm ends at the wrist, as it does in the scene that the camera sees.
        let (tube, wrist) = (&bodies[11].0, &bodies[12].0);
        let axis = (wrist.ends[1] - wrist.ends[0]).normalize();
        let from_wrist = tube.ends[1] - wrist.ends[0];
        assert!(
            (from_wrist - axis * from_wrist.dot(&axis)).norm() < 1e-9,
            "the axis of the wrist goes through its end"
        );
    }
}
