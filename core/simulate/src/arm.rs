//! A UR5 whose links, joints and motors may have errors, by its rows of Denavit and Hartenberg.

use nalgebra::{Isometry3, SMatrix, Translation3, UnitQuaternion, Vector3, Vector6};

use handeye_arm::{ArmKind, DhRow};
use handeye_geometry::frames::{Base, Pose, Tip};

/// Starts of the search for joint angles.
const STARTS: [[f64; 6]; 3] =
    [[0.0, -1.2, 1.6, -1.9, -1.5, 0.0], [0.4, -1.6, 2.0, -2.0, -1.6, 1.0], [-0.4, -1.0, 1.2, -1.7, -1.4, -1.0]];

/// Deviations of every link from its data sheet: `a`, `d` in metres, `alpha` and the joint's zero in radians.
pub type LinkErrors = [[f64; 4]; 6];

/// An arm of servo motors: the errors between the commanded and reported angles, and the links.
#[derive(Debug, Clone, Copy)]
pub struct Servo {
    /// A gear or sensor that is not centred: amplitude \[rad\] once per turn, and its phase, of every joint.
    pub eccentric: [[f64; 2]; 6],
    /// Play of every joint, radians: a link stays behind by half of it on the side that it comes from.
    pub play_rad: [f64; 6],
    /// Deflections of shoulder, elbow and wrist under the weight of a horizontal arm, radians.
    pub sag_rad: [f64; 3],
    /// Step of the sensor, radians.
    pub step_rad: f64,
}

/// Previous command of the joints, and how far the links are behind it, radians.
pub(crate) type Before = Option<([f64; 6], [f64; 6])>;

impl Servo {
    /// True angles of the links for the command `joints`; `last` is the previous state of the arm, which is updated.
    pub(crate) fn really(&self, joints: &[f64; 6], last: &mut Before) -> [f64; 6] {
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

/// The links of an arm, from the base to the tip.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Ur5([DhRow; 6]);

impl Ur5 {
    /// As in the data sheet.
    pub fn as_stated() -> Self {
        Self(ArmKind::Ur5.rows())
    }

    /// The same with errors of its links.
    pub fn with_errors(errors: &LinkErrors) -> Self {
        let mut rows = ArmKind::Ur5.rows();
        for (row, [a, d, alpha, zero]) in rows.iter_mut().zip(errors) {
            row.a_m += a;
            row.d_m += d;
            row.alpha_rad += alpha;
            row.theta_offset_rad += zero;
        }
        Self(rows)
    }

    /// The frame that each joint carries, from that of the base, which none does, to the tip; joint angles in radians.
    fn frames(&self, joints: &[f64; 6]) -> [Isometry3<f64>; 7] {
        let mut frames = [Isometry3::identity(); 7];
        for (j, (row, angle)) in self.0.iter().zip(joints).enumerate() {
            let about_z = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), angle + row.theta_offset_rad);
            let about_x = UnitQuaternion::from_axis_angle(&Vector3::x_axis(), row.alpha_rad);
            frames[j + 1] = frames[j] * about_z * Translation3::new(row.a_m, 0.0, row.d_m) * about_x;
        }
        frames
    }

    /// The tip's pose.
    pub fn base_from_tip(&self, joints: &[f64; 6]) -> Isometry3<f64> {
        self.frames(joints)[6]
    }

    /// The frames whose z axes the joints turn about, in that of the tip: every joint turns about z of the frame before it.
    pub fn tip_from_joints(&self, joints: &[f64; 6]) -> [Isometry3<f64>; 6] {
        let frames = self.frames(joints);
        std::array::from_fn(|j| frames[6].inverse() * frames[j])
    }

    /// The twist of the tip per radian of each joint, in its own axes.
    pub fn tip_by_joint(&self, joints: &[f64; 6]) -> [Vector6<f64>; 6] {
        self.tip_from_joints(joints).map(|tip_from_axis| {
            let turn = tip_from_axis.rotation * Vector3::z();
            let shift = tip_from_axis.translation.vector.cross(&turn);
            Vector6::new(shift.x, shift.y, shift.z, turn.x, turn.y, turn.z)
        })
    }

    /// Joint angles that reach a pose in the usual way; `None` when it is out of reach.
    pub fn joints_at(&self, goal: &Pose<Base, Tip>) -> Option<[f64; 6]> {
        STARTS.iter().find_map(|start| {
            let mut joints = *start;
            for _ in 0..60 {
                let off = self.base_from_tip(&joints).inverse() * goal.isometry();
                let (shift, turn) = (off.translation.vector, off.rotation.scaled_axis());
                let off = Vector6::new(shift.x, shift.y, shift.z, turn.x, turn.y, turn.z);
                if off.norm() < 1e-10 {
                    return is_usual(&joints).then_some(joints);
                }
                let by_joint = SMatrix::<f64, 6, 6>::from_columns(&self.tip_by_joint(&joints));
                let damped = by_joint.transpose() * by_joint + SMatrix::<f64, 6, 6>::identity() * 1e-6;
                let step = damped.try_inverse()? * by_joint.transpose() * off;
                let length = step.amax().max(0.5) / 0.5;
                for (q, s) in joints.iter_mut().zip(step.iter()) {
                    *q += s / length;
                }
            }
            None
        })
    }
}

/// Whether the configuration is that of a session that is moved through without turning over: in front of its base, not bent
/// backwards over its shoulder, the elbow up and the wrist to one side. The errors of its links differ on every branch.
fn is_usual(joints: &[f64; 6]) -> bool {
    let [_, upper, fore, _, hand, _] = ArmKind::Ur5.rows();
    let [base, shoulder, elbow, wrist_1, wrist_2, _] = joints.map(|angle| angle.sin().atan2(angle.cos()));
    let forwards_m = upper.a_m * shoulder.cos()
        + fore.a_m * (shoulder + elbow).cos()
        + hand.d_m * (shoulder + elbow + wrist_1).sin();
    base.abs() < std::f64::consts::FRAC_PI_2 && forwards_m > 0.0 && elbow > 0.0 && wrist_2 < 0.0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_arm_of_the_data_sheet_is_that_of_the_estimator() {
        let (here, there) = (Ur5::as_stated(), ArmKind::Ur5.arm());
        for joints in STARTS {
            let tip = here.base_from_tip(&joints);
            let (off_m, _) = there.forward(&joints).expect("six joints").distance_to(&Pose::from_isometry(tip));
            assert!(off_m < 1e-14, "{off_m}");
            let twists = there.tip_by_joint(&joints).expect("six joints");
            for (a, b) in here.tip_by_joint(&joints).iter().zip(twists) {
                assert!((a - b).norm() < 1e-13, "{a} {b}");
            }
        }
    }
}
