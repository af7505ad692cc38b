//! The frames that Universal Robots' description gives the joints of its arms, found in a chain by its geometry.
//!
//! Their links are placed by `Π_j Trans(x_j, y_j, z_j) Rz(yaw_j) Ry(pitch_j) Rx(roll_j) Rz(q_j)` behind the controller's base. With
//! nominal numbers that is
//!
//! `Tz(d1) Rz(q1) · Rx(90°) Rz(q2) · Tx(a2) Rz(q3) · T(a3, 0, d4) Rz(q4) · Ty(−d5) Rx(90°) Rz(q5) · Ty(d6) Rx(−90°) Rz(q6)`
//!
//! with the tool flange at the end. The source of a chain determines where its own frames are along their axes; these are where the
//! meshes of the description expect them.

use std::f64::consts::FRAC_PI_2;

use nalgebra::{Isometry3, Matrix3, Rotation3, Translation3, UnitQuaternion, Vector3};

use super::corrected::frames_at_zero;
use handeye_arm::Arm;

/// Largest difference of a chain from that of the description with the same lengths, metres and radians: files write a quarter
/// turn with five digits.
const SAME: f64 = 1e-4;
/// Joint values at which the two are compared: none is special for any of the axes.
const COMPARED_AT: [[f64; 6]; 3] = [[0.0; 6], [0.7, -1.3, 1.9, 0.4, -0.8, 2.3], [-2.1, 0.6, -0.9, -1.7, 1.2, -0.5]];

/// Frames of the description in a chain.
pub(super) struct UrFrames {
    /// The controller's base, in the base that poses are in.
    pub base_from_robot: Isometry3<f64>,
    /// From the frame of each joint in the chain, with z along its axis, to that of the description: a turn about z and a shift
    /// along it.
    pub axis_from_own: Vec<Isometry3<f64>>,
}

impl UrFrames {
    /// From the nominal chain of an arm; otherwise a text that states how it differs from an arm of Universal Robots.
    pub fn of(arm: &Arm) -> Result<Self, &'static str> {
        if arm.joint_count() != 6 {
            return Err("an arm of Universal Robots has six joints");
        }
        let (axes, tip) = frames_at_zero(arm);
        let flange = tip * arm.flange_from_tip.inverse();
        let (base_from_robot, lengths) = measured(&arm.base_from_first, &axes, &flange)?;
        let frames = frames_of(&lengths);
        let robot_from_flange = base_from_robot.inverse() * flange;
        let end = at_zero(&frames).inverse() * robot_from_flange;
        let is_same = COMPARED_AT.iter().all(|joints| {
            let described = base_from_robot * forward(&frames, joints) * end * arm.flange_from_tip;
            let own = arm.forward(joints).map(|pose| *pose.isometry());
            own.is_ok_and(|own| distance(&own, &described) < SAME)
        });
        if !is_same {
            return Err(
                "its axes, the directions in which its joints count or their zeros are not those of Universal Robots",
            );
        }
        let mut base_from_own = base_from_robot;
        let mut axis_from_own = Vec::with_capacity(axes.len());
        for (axis, frame) in axes.iter().zip(&frames) {
            base_from_own *= frame;
            axis_from_own.push(about_axis(&(axis.inverse() * base_from_own)));
        }
        Ok(Self { base_from_robot, axis_from_own })
    }
}

/// The nearest turn about z and shift along it: only such a frame turns with the joint as it did.
fn about_axis(near: &Isometry3<f64>) -> Isometry3<f64> {
    let x = near.rotation * Vector3::x();
    let turn = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), x.y.atan2(x.x));
    Isometry3::from_parts(Translation3::new(0.0, 0.0, near.translation.z), turn)
}

/// The controller's base, and `d1 a2 a3 d4 d5 d6`, from where the chain begins, and the axes (z of each frame) and the flange where
/// every joint is at zero.
fn measured(
    first: &Isometry3<f64>,
    axes: &[Isometry3<f64>],
    flange: &Isometry3<f64>,
) -> Result<(Isometry3<f64>, [f64; 6]), &'static str> {
    let direction = |i: usize| axes[i].rotation * Vector3::z();
    let point = |i: usize| axes[i].translation.vector;
    let (z, y) = (direction(0), -direction(1));
    if z.dot(&y).abs() > SAME {
        return Err("its first two axes are not at a right angle");
    }
    let x = y.cross(&z).normalize();
    let turn = Rotation3::from_matrix_unchecked(Matrix3::from_columns(&[x, z.cross(&x), z]));
    // The beginning of the chain, if that is on the first axis; otherwise the nearest point of the axis.
    let origin = point(0) + z * (first.translation.vector - point(0)).dot(&z);
    let rotation = UnitQuaternion::from_rotation_matrix(&turn);
    let base_from_robot = Isometry3::from_parts(origin.into(), rotation);
    let in_robot = |point: Vector3<f64>| rotation.inverse() * (point - origin);
    let [elbow, wrist, end] = [in_robot(point(2)), in_robot(point(3)), in_robot(flange.translation.vector)];
    let (shoulder, fifth, sixth) = (in_robot(point(1)), in_robot(point(4)), in_robot(point(5)));
    // Axes 2 to 4 are along −y, the fifth is along −z and the sixth along −y again; the links lie along x.
    let (d1, a2, a3, d4) = (shoulder.z, elbow.x, wrist.x - elbow.x, -fifth.y);
    let (d5, d6) = (wrist.z - sixth.z, fifth.y - end.y);
    if a2 > -SAME || a3 > -SAME {
        return Err("with all joints at zero its long links do not point along -x, as those of Universal Robots do");
    }
    Ok((base_from_robot, [d1, a2, a3, d4, d5, d6]))
}

/// The transform before each joint in the description with nominal numbers.
fn frames_of([d1, a2, a3, d4, d5, d6]: &[f64; 6]) -> [Isometry3<f64>; 6] {
    let frame = |x: f64, y: f64, z: f64, roll: f64| {
        let turn = UnitQuaternion::from_axis_angle(&Vector3::x_axis(), roll);
        Isometry3::from_parts(Translation3::new(x, y, z), turn)
    };
    [
        frame(0.0, 0.0, *d1, 0.0),
        frame(0.0, 0.0, 0.0, FRAC_PI_2),
        frame(*a2, 0.0, 0.0, 0.0),
        frame(*a3, 0.0, *d4, 0.0),
        frame(0.0, -d5, 0.0, FRAC_PI_2),
        frame(0.0, *d6, 0.0, -FRAC_PI_2),
    ]
}

/// Pose of the last of these frames with these joint values.
pub(super) fn forward(frames: &[Isometry3<f64>], joints: &[f64]) -> Isometry3<f64> {
    let turn = |angle: f64| UnitQuaternion::from_axis_angle(&Vector3::z_axis(), angle);
    frames.iter().zip(joints).fold(Isometry3::identity(), |before, (frame, angle)| before * frame * turn(*angle))
}

fn at_zero(frames: &[Isometry3<f64>]) -> Isometry3<f64> {
    frames.iter().fold(Isometry3::identity(), |before, frame| before * frame)
}

fn distance(a: &Isometry3<f64>, b: &Isometry3<f64>) -> f64 {
    (a.translation.vector - b.translation.vector).norm().max(a.rotation.angle_to(&b.rotation))
}
