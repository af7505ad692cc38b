//! Ready-made bodies: a UR5, the links of any other arm, a two-finger gripper, floor and table.

use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, Vector3};

use crate::scene::ArmSpec;
use handeye_arm::{Arm, ArmKind, links};
use handeye_render::{Finish, Shape, Solid};

/// Turned aluminium of tubes and housings.
pub(crate) const ALUMINIUM: [f32; 3] = [0.76, 0.78, 0.80];
/// The darker tone of base, wrists and gripper.
pub const GRAPHITE: [f32; 3] = [0.25, 0.27, 0.30];
/// Covers of the joints.
pub const COVER_BLUE: [f32; 3] = [0.24, 0.45, 0.66];

const HOUSING: f64 = 0.058;
const ELBOW: f64 = 0.050;
const WRIST: f64 = 0.038;

/// A part of the arm in its zero configuration, in the base frame of the model.
struct Part {
    link: usize,
    from: [f64; 3],
    to: [f64; 3],
    radius: f64,
    round: bool,
    colour: [f32; 3],
}

const fn housing(link: usize, from: [f64; 3], to: [f64; 3], radius: f64, colour: [f32; 3]) -> Part {
    Part { link, from, to, radius, round: false, colour }
}

const fn tube(link: usize, from: [f64; 3], to: [f64; 3], radius: f64) -> Part {
    Part { link, from, to, radius, round: true, colour: ALUMINIUM }
}

/// Joint axes at zero: J1 up at x = 0; J2, J3, J4 along -x at z = 0.07455, 0.49965, 0.8918; J5 up at x = -0.110; J6
/// along -x at z = 0.98655. The arm's tubes are offset from the plane of the axes as on the real machine.
const PARTS: [Part; 19] = [
    housing(0, [0.0, 0.0, -0.01465], [0.0, 0.0, 0.008], 0.075, GRAPHITE),
    housing(0, [0.0, 0.0, 0.008], [0.0, 0.0, 0.022], 0.064, ALUMINIUM),
    housing(1, [0.0, 0.0, 0.022], [0.0, 0.0, 0.07455], HOUSING, GRAPHITE),
    housing(1, [0.055, 0.0, 0.07455], [-0.075, 0.0, 0.07455], HOUSING, ALUMINIUM),
    housing(1, [0.066, 0.0, 0.07455], [0.055, 0.0, 0.07455], 0.054, COVER_BLUE),
    housing(2, [-0.077, 0.0, 0.07455], [-0.190, 0.0, 0.07455], HOUSING, ALUMINIUM),
    housing(2, [-0.190, 0.0, 0.07455], [-0.200, 0.0, 0.07455], 0.054, COVER_BLUE),
    tube(2, [-0.136, 0.0, 0.07455], [-0.136, 0.0, 0.49965], 0.046),
    housing(2, [-0.075, 0.0, 0.49965], [-0.180, 0.0, 0.49965], ELBOW, ALUMINIUM),
    housing(2, [-0.180, 0.0, 0.49965], [-0.189, 0.0, 0.49965], 0.046, COVER_BLUE),
    housing(3, [0.035, 0.0, 0.49965], [-0.073, 0.0, 0.49965], ELBOW, GRAPHITE),
    tube(3, [-0.0165, 0.0, 0.49965], [-0.0165, 0.0, 0.8918], 0.035),
    housing(3, [0.030, 0.0, 0.8918], [-0.060, 0.0, 0.8918], WRIST, ALUMINIUM),
    housing(3, [0.038, 0.0, 0.8918], [0.030, 0.0, 0.8918], 0.035, COVER_BLUE),
    housing(4, [-0.062, 0.0, 0.8918], [-0.152, 0.0, 0.8918], WRIST, GRAPHITE),
    housing(4, [-0.110, 0.0, 0.8918], [-0.110, 0.0, 0.944], 0.036, GRAPHITE),
    housing(5, [-0.110, 0.0, 0.946], [-0.110, 0.0, 1.030], WRIST, ALUMINIUM),
    housing(5, [-0.110, 0.0, 0.98655], [-0.155, 0.0, 0.98655], 0.036, ALUMINIUM),
    housing(6, [-0.156, 0.0, 0.98655], [-0.18495, 0.0, 0.98655], 0.0315, GRAPHITE),
];

/// The UR5 of the reference scene.
///
/// `motion_of_link(n)` is `base_from_link_n(q) · base_from_link_n(0)⁻¹`, what the joints 1 to n do to points that are
/// given in the base frame at zero angles; for n = 0 the identity.
pub fn ur5(world_from_base: &Isometry3<f64>, motion_of_link: impl Fn(usize) -> Isometry3<f64>) -> Vec<Solid> {
    let placed = |(link, solid): (usize, Solid)| {
        let world_from_shape = world_from_base * motion_of_link(link) * solid.world_from_shape;
        Solid { world_from_shape, ..solid }
    };
    ur5_parts().map(placed).collect()
}

/// Its solids in its base frame at zero angles, each with the number of its link.
pub fn ur5_parts() -> impl Iterator<Item = (usize, Solid)> {
    PARTS.iter().map(|part| {
        let (a, b) = (Point3::from(part.from), Point3::from(part.to));
        let solid = if part.round {
            Solid::new(Shape::Capsule { a, b, radius: part.radius }, Isometry3::identity(), part.colour)
        } else {
            let (shape, base_from_shape) = cylinder_between(&a, &b, part.radius);
            Solid::new(shape, base_from_shape, part.colour)
        };
        let finish = if part.colour == ALUMINIUM && !part.round { Finish::Brushed } else { Finish::Satin };
        (part.link, solid.with_finish(finish))
    })
}

/// The solids of the arm of a scene in the arm frame with all joints at zero, each with the number of joints that carry it.
/// The UR5 of CoppeliaSim has its housings; of any other arm the links are tubes between its joints.
pub fn arm_parts(model: &ArmSpec, arm: &Arm) -> Vec<(usize, Solid)> {
    if model.kind() == Some(ArmKind::Ur5Coppeliasim) { ur5_parts().collect() } else { link_parts(arm) }
}

/// The links of an arm whose shape is not known, as tubes between its joints; otherwise as [`arm_parts`].
pub fn link_parts(arm: &Arm) -> Vec<(usize, Solid)> {
    let at_zero = arm.frames(&vec![0.0; arm.joint_count()]);
    let arm_from_links: Vec<_> = at_zero.iter().flat_map(links::arm_from_links).collect();
    let tube = |(index, link): (usize, links::LinkCapsule)| {
        let shape = Shape::Capsule { a: link.from, b: link.to, radius: link.radius_m };
        // Two tones by turns, so that the joints are seen.
        let colour = [GRAPHITE, ALUMINIUM][index % 2];
        (link.link, Solid::new(shape, arm_from_links[link.link], colour).with_finish(Finish::Satin))
    };
    links::capsules(arm).into_iter().enumerate().map(tube).collect()
}

/// The cylinder from `a` to `b` and the pose of its frame.
pub(crate) fn cylinder_between(a: &Point3<f64>, b: &Point3<f64>, radius: f64) -> (Shape, Isometry3<f64>) {
    let axis = b - a;
    // Opposite to z any axis across will do for the half turn.
    let rotation = UnitQuaternion::rotation_between(&Vector3::z(), &axis)
        .unwrap_or_else(|| UnitQuaternion::from_axis_angle(&Vector3::x_axis(), std::f64::consts::PI));
    let pose = Isometry3::from_parts(Translation3::from((a.coords + b.coords) / 2.0), rotation);
    (Shape::Cylinder { radius, half_height: 0.5 * axis.norm() }, pose)
}

/// A small two-finger gripper on a tip whose z axis points out of the flange; its fingers open along y and reach to
/// z = 95 mm.
pub fn gripper(world_from_tip: &Isometry3<f64>) -> Vec<Solid> {
    let part = |x: f64, y: f64, z: f64, half: [f64; 3], colour| {
        let shape = Shape::Box { half_extents: Vector3::from(half) };
        Solid::new(shape, world_from_tip * Translation3::new(x, y, z), colour).with_finish(Finish::Satin)
    };
    let finger = |side: f64| {
        [
            part(0.0, side * 0.027, 0.066, [0.009, 0.005, 0.022], ALUMINIUM),
            part(0.0, side * 0.021, 0.086, [0.008, 0.004, 0.009], GRAPHITE),
        ]
    };
    let palm = part(0.0, 0.0, 0.022, [0.020, 0.040, 0.022], GRAPHITE);
    [palm].into_iter().chain(finger(1.0)).chain(finger(-1.0)).collect()
}

/// The floor of the hall at z = 0.
pub fn floor() -> Solid {
    Solid::new(Shape::Plane, Isometry3::identity(), [0.70, 0.71, 0.72])
        .with_finish(Finish::Tiles { pitch_m: 0.5, joint_m: 0.006 })
}

/// A table with a wooden top of 30 mm and four legs down to z = 0; `middle_m` is the middle of the upper side.
pub fn table(middle_m: Point3<f64>, size_m: [f64; 2]) -> Vec<Solid> {
    let half = [0.5 * size_m[0], 0.5 * size_m[1]];
    let place = |x: f64, y: f64, z: f64| Isometry3::translation(middle_m.x + x, middle_m.y + y, z);
    let top = Solid::new(
        Shape::Box { half_extents: Vector3::new(half[0], half[1], 0.015) },
        place(0.0, 0.0, middle_m.z - 0.015),
        [0.78, 0.60, 0.42],
    )
    .with_finish(Finish::Wood);
    let leg_half = 0.5 * (middle_m.z - 0.03);
    let leg = |x: f64, y: f64| {
        let shape = Shape::Cylinder { radius: 0.022, half_height: leg_half };
        Solid::new(shape, place(x, y, leg_half), GRAPHITE).with_finish(Finish::Satin)
    };
    let (x, y) = (half[0] - 0.05, half[1] - 0.05);
    vec![top, leg(x, y), leg(-x, y), leg(x, -y), leg(-x, -y)]
}

/// A post and a plate that hold a sheet from behind; `world_from_target` and `paper_m` as of the board, with the
/// pattern's middle at `middle_in_target`.
pub fn stand(world_from_target: &Isometry3<f64>, middle_in_target: Point3<f64>, paper_m: [f64; 2]) -> Vec<Solid> {
    let plate_half = Vector3::new(0.5 * paper_m[0] - 0.004, 0.5 * paper_m[1] - 0.004, 0.003);
    let plate_pose = world_from_target * Translation3::new(middle_in_target.x, middle_in_target.y, 0.0035);
    let plate = Solid::new(Shape::Box { half_extents: plate_half }, plate_pose, [0.5, 0.52, 0.55]);
    let top = world_from_target * Point3::new(middle_in_target.x, middle_in_target.y, 0.018);
    let (shape, pose) = cylinder_between(&Point3::new(top.x, top.y, 0.0), &top, 0.012);
    vec![plate, Solid::new(shape, pose, GRAPHITE).with_finish(Finish::Satin)]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cylinder_between_two_points_ends_at_both() {
        let a = Point3::new(0.1, -0.2, 0.3);
        for b in [Point3::new(0.4, 0.5, -0.1), Point3::new(0.1, -0.2, 0.9), Point3::new(0.1, -0.2, -0.9)] {
            let (shape, pose) = cylinder_between(&a, &b, 0.05);
            let Shape::Cylinder { half_height, .. } = shape else { panic!("{shape:?}") };
            assert!((pose * Point3::new(0.0, 0.0, -half_height) - a).norm() < 1e-12);
            assert!((pose * Point3::new(0.0, 0.0, half_height) - b).norm() < 1e-12);
        }
    }

    #[test]
    fn parts_of_the_arm_follow_their_link() {
        let lifted = |link: usize| Isometry3::translation(0.0, 0.0, link as f64);
        let (still, moved) =
            (ur5(&Isometry3::identity(), |_| Isometry3::identity()), ur5(&Isometry3::identity(), lifted));
        for ((part, a), b) in PARTS.iter().zip(&still).zip(&moved) {
            let rise = b.world_from_shape.translation.vector - a.world_from_shape.translation.vector;
            assert!((rise - Vector3::z() * part.link as f64).norm() < 1e-12);
        }
    }
}
