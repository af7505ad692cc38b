//! An arm with the geometry of a UR5, enough to have joints.

use nalgebra::{Isometry3, Matrix6, SMatrix, Translation3, UnitQuaternion, Vector3, Vector6};

use handeye_core::geometry::se3;

/// Denavit-Hartenberg parameters `(a, d, alpha)` of a UR5, metres and radians, from its data sheet.
const LINKS: [(f64, f64, f64); 6] = [
    (0.0, 0.089_159, std::f64::consts::FRAC_PI_2),
    (-0.425, 0.0, 0.0),
    (-0.392_25, 0.0, 0.0),
    (0.0, 0.109_15, std::f64::consts::FRAC_PI_2),
    (0.0, 0.094_65, -std::f64::consts::FRAC_PI_2),
    (0.0, 0.082_3, 0.0),
];
const STARTS: [[f64; 6]; 3] =
    [[0.0, -1.2, 1.6, -1.9, -1.5, 0.0], [0.4, -1.6, 2.0, -2.0, -1.6, 1.0], [-0.4, -1.0, 1.2, -1.7, -1.4, -1.0]];

/// What every link has more than its data sheet says: `a`, `d` in metres, `alpha` and the joint's zero in radians.
pub type LinkErrors = [[f64; 4]; 6];

/// The tip's pose at joint angles, radians.
pub fn base_from_tip(joints: &[f64; 6]) -> Isometry3<f64> {
    with_errors(joints, &LinkErrors::default())
}

/// The same of an arm that is not as its data sheet says.
pub fn with_errors(joints: &[f64; 6], errors: &LinkErrors) -> Isometry3<f64> {
    let links = LINKS.iter().zip(errors).zip(joints);
    links.fold(Isometry3::identity(), |pose, (((a, d, alpha), [more_a, more_d, more_alpha, zero]), q)| {
        pose * Isometry3::from_parts(
            Translation3::new(0.0, 0.0, d + more_d),
            UnitQuaternion::from_scaled_axis(Vector3::z() * (q + zero)),
        ) * Isometry3::from_parts(
            Translation3::new(a + more_a, 0.0, 0.0),
            UnitQuaternion::from_scaled_axis(Vector3::x() * (alpha + more_alpha)),
        )
    })
}

/// Twist of the tip per radian of each joint, right perturbation.
pub fn tip_by_joint(joints: &[f64; 6]) -> [Vector6<f64>; 6] {
    const STEP: f64 = 1e-6;
    let here = base_from_tip(joints).inverse();
    std::array::from_fn(|j| {
        let mut moved = *joints;
        moved[j] += STEP;
        se3::log(&(here * base_from_tip(&moved))) / STEP
    })
}

/// Whether the arm stands as it does in a session that is moved through without turning over: in front of its base, the
/// elbow up and the wrist to one side. The errors of its links are other ones on every branch.
fn is_usual(joints: &[f64; 6]) -> bool {
    let [base, shoulder, elbow, _, wrist, _] = joints.map(|angle| angle.sin().atan2(angle.cos()));
    base.abs() < std::f64::consts::FRAC_PI_2 && shoulder < 0.0 && elbow > 0.0 && wrist < 0.0
}

/// Joint angles that reach a pose in the usual way; `None` when it is out of reach.
pub fn joints_at(target: &Isometry3<f64>) -> Option<[f64; 6]> {
    STARTS.iter().find_map(|start| {
        let mut joints = *start;
        for _ in 0..60 {
            let error = se3::log(&(base_from_tip(&joints).inverse() * target));
            if error.norm() < 1e-10 {
                return is_usual(&joints).then_some(joints);
            }
            let columns = tip_by_joint(&joints);
            let jacobian: Matrix6<f64> = SMatrix::from_columns(&columns);
            let damped = jacobian.transpose() * jacobian + Matrix6::identity() * 1e-6;
            let step = damped.try_inverse()? * jacobian.transpose() * error;
            let length = step.amax().max(0.5) / 0.5;
            for (q, s) in joints.iter_mut().zip(step.iter()) {
                *q += s / length;
            }
        }
        None
    })
}
