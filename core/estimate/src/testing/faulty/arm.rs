//! The UR5 of the simulated sessions, whose links may have errors.

use nalgebra::{Isometry3, Matrix6, SMatrix};

use handeye_arm::{Arm, ArmKind, DhRow};
use handeye_geometry::se3;

/// Where the search for joint angles starts.
const STARTS: [[f64; 6]; 3] =
    [[0.0, -1.2, 1.6, -1.9, -1.5, 0.0], [0.4, -1.6, 2.0, -2.0, -1.6, 1.0], [-0.4, -1.0, 1.2, -1.7, -1.4, -1.0]];

/// What every link has more than its data sheet says: `a`, `d` in metres, `alpha` and the joint's zero in radians.
pub type LinkErrors = [[f64; 4]; 6];

/// An arm of servo motors: what lies between the angles that are commanded and reported, and where the links are.
#[derive(Debug, Clone, Copy)]
pub struct Servo {
    /// A gear or sensor that is not centred: amplitude \[rad\] once per turn, and its phase, of every joint.
    pub eccentric: [[f64; 2]; 6],
    /// Play of every joint, radians: a link stays behind by half of it on the side that it comes from.
    pub play_rad: [f64; 6],
    /// How far shoulder, elbow and wrist give way under the weight of a horizontal arm, radians.
    pub sag_rad: [f64; 3],
    /// Step of the sensor, radians.
    pub step_rad: f64,
}

impl Servo {
    /// Where the links are that are commanded to `joints`, in an arm whose links were behind the commanded angles by `behind`,
    /// which is brought up to date.
    pub(super) fn really(&self, joints: &[f64; 6], last: &mut Option<([f64; 6], [f64; 6])>) -> [f64; 6] {
        let (before, behind) = last.unwrap_or((*joints, [0.0; 6]));
        // A joint goes through its play before it takes the link along.
        let behind: [f64; 6] = std::array::from_fn(|j| {
            let half = 0.5 * self.play_rad[j];
            (behind[j] - (joints[j] - before[j])).clamp(-half, half)
        });
        *last = Some((*joints, behind));
        let [_, shoulder, elbow, wrist, ..] = *joints;
        let upper = shoulder.cos();
        let fore = (shoulder + elbow).cos();
        let hand = (shoulder + elbow + wrist).sin();
        let sag = [0.0, 0.6 * upper + 0.4 * fore, fore, hand, 0.0, 0.0];
        std::array::from_fn(|j| {
            let [amplitude, phase] = self.eccentric[j];
            let given_way = if (1..=3).contains(&j) { self.sag_rad[j - 1] * sag[j] } else { 0.0 };
            let read =
                if self.step_rad > 0.0 { (joints[j] / self.step_rad).round() * self.step_rad } else { joints[j] };
            read + amplitude * (joints[j] + phase).sin() + behind[j] + given_way
        })
    }
}

/// The arm of the data sheet.
pub(super) fn as_stated() -> Arm {
    ArmKind::Ur5.arm()
}

/// The same with errors of its links.
pub(super) fn with_errors(errors: &LinkErrors) -> Arm {
    let stated = ArmKind::Ur5.rows();
    let rows = stated.iter().zip(errors).map(|(row, [a, d, alpha, zero])| DhRow {
        a_m: row.a_m + a,
        alpha_rad: row.alpha_rad + alpha,
        d_m: row.d_m + d,
        theta_offset_rad: row.theta_offset_rad + zero,
    });
    Arm::from_dh(&rows.collect::<Vec<_>>()).expect("small errors")
}

/// The tip's pose at joint angles, radians.
pub(super) fn base_from_tip(arm: &Arm, joints: &[f64; 6]) -> Isometry3<f64> {
    *arm.forward(joints).expect("six joints").isometry()
}

/// Whether the arm stands as it does in a session that is moved through without turning over: in front of its base, not
/// bent backwards over its shoulder, the elbow up and the wrist to one side. The errors of its links are other ones on every
/// branch.
fn is_usual(joints: &[f64; 6]) -> bool {
    let [_, upper, fore, _, hand, _] = ArmKind::Ur5.rows();
    let [base, shoulder, elbow, wrist_1, wrist_2, _] = joints.map(|angle| angle.sin().atan2(angle.cos()));
    let forwards_m = upper.a_m * shoulder.cos()
        + fore.a_m * (shoulder + elbow).cos()
        + hand.d_m * (shoulder + elbow + wrist_1).sin();
    base.abs() < std::f64::consts::FRAC_PI_2 && forwards_m > 0.0 && elbow > 0.0 && wrist_2 < 0.0
}

/// Joint angles that reach a pose in the usual way; `None` when it is out of reach.
pub(super) fn joints_at(arm: &Arm, target: &Isometry3<f64>) -> Option<[f64; 6]> {
    STARTS.iter().find_map(|start| {
        let mut joints = *start;
        for _ in 0..60 {
            let error = se3::log(&(base_from_tip(arm, &joints).inverse() * target));
            if error.norm() < 1e-10 {
                return is_usual(&joints).then_some(joints);
            }
            let jacobian: Matrix6<f64> = SMatrix::from_columns(&arm.tip_by_joint(&joints).ok()?);
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
