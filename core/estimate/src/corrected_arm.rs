//! An arm whose own errors are known: where its tip really is, and what to command so that it gets where it should be.

use nalgebra::{DMatrix, Matrix3, Matrix6, Matrix6xX, Vector3, Vector6};

use crate::arm_fit::ArmFit;
use crate::few_joints::{self, PointGoal};
use crate::handeye::joint::{ArmErrors, SmallSample};
use crate::reach_error::USUAL_TOOL;
use handeye_arm::{Arm, ArmError, IkError, JointRange};
use handeye_geometry::frames::{Base, Pose, Tip};

/// Steps of [`CorrectedArm::command`]. Each reduces the distance to the relative size of the arm's errors: a few parts in a
/// thousand, and some parts in a hundred where zeros are off by degrees.
const STEPS: usize = 20;
/// Distance in metres and angle in radians at which a command has arrived.
const ARRIVED: f64 = 1e-9;
/// Largest angle between a wanted orientation and that of an arm with fewer than six joints, radians. A wanted pose that the arm has
/// by its own kinematics is off by its errors alone, which are degrees at most.
const TURN_OF_FEW_JOINTS: f64 = 5.0 * std::f64::consts::PI / 180.0;

/// An arm as its controller models it, where it is mounted, and its errors.
#[derive(Debug, Clone, PartialEq)]
pub struct CorrectedArm {
    /// The arm as its controller models it.
    pub arm: Arm,
    /// The errors of the arm.
    pub errors: ArmErrors,
    /// Covariance of the errors, in the order of [`ArmErrors::numbers`].
    pub covariance: DMatrix<f64>,
    /// What the errors do not explain: standard deviations of the tip's position \[m\] and orientation \[rad\] per
    /// axis.
    pub unexplained: (f64, f64),
    /// How errors are distributed in units of the covariance.
    pub small_sample: SmallSample,
    /// The tip of the tool in the frame of the tip, metres: what arrives where the arm has fewer than six joints.
    pub tool_m: Vector3<f64>,
}

/// Why there is no command.
#[derive(Debug, Clone, PartialEq, thiserror::Error, handeye_wording::Localized)]
#[non_exhaustive]
pub enum CorrectError {
    /// The joint values given are of no use.
    #[error(transparent)]
    Arm(#[from] ArmError),
    /// The arm does not get there.
    #[error(transparent)]
    Reach(#[from] IkError),
    /// The corrected pose moves on with every step.
    #[error(
        "no command was found that takes the tip there: after {steps} steps it is {distance_mm:.3} mm off; the pose is where \
         the arm is stretched or its wrist is straight: choose another orientation"
    )]
    NotFound {
        /// How many steps were taken.
        steps: usize,
        /// How far off the last one is, millimetres.
        distance_mm: f64,
    },
    /// An arm with few joints does not turn its tip every way.
    #[error(
        "an arm with {joints} joints does not turn its tip this way: the nearest it gets with its tool at this place is \
         {angle_deg:.1}° off; use an orientation that it has there, by its own kinematics"
    )]
    Orientation {
        /// Joints of the arm.
        joints: usize,
        /// Angle to the nearest orientation, degrees.
        angle_deg: f64,
    },
}

/// A command and what is known of where it takes the tip.
#[derive(Debug, Clone, PartialEq)]
pub struct Command {
    /// Joint values to be commanded: radians.
    pub joints_rad: Vec<f64>,
    /// The same by the controller's own kinematics.
    pub base_from_tip: Pose<Base, Tip>,
    /// Upper limit of the distance of the tip from the wanted pose, with a probability of 95 %, metres.
    pub error_95_m: f64,
}

impl CorrectedArm {
    /// The corrected arm of a calibration, with the arm where it is mounted, see [`place`](crate::placement::place); `None` where
    /// the calibration is of an arm with another number of joints.
    pub fn new(arm: Arm, fit: &ArmFit) -> Option<Self> {
        (arm.joint_count() == fit.errors.joint_count()).then(|| Self {
            arm,
            errors: fit.errors.clone(),
            covariance: fit.errors_covariance(),
            unexplained: (fit.noise.robot_m, fit.noise.robot_rad),
            small_sample: fit.small_sample,
            tool_m: USUAL_TOOL.into(),
        })
    }

    /// The same with another tool.
    #[must_use]
    pub fn with_tool(self, tool_m: Vector3<f64>) -> Self {
        Self { tool_m, ..self }
    }

    /// Where the tip really is with these joint values.
    ///
    /// # Errors
    /// As [`Arm::forward`].
    pub fn actual(&self, joints_rad: &[f64]) -> Result<Pose<Base, Tip>, ArmError> {
        let reported = self.arm.forward(joints_rad)?;
        let frames = self.arm.tip_from_joints(&reported, joints_rad)?;
        Ok(Pose::from_isometry(reported.isometry() * self.errors.reported_from_true(&reported, &frames)))
    }

    /// The same with its derivatives by the errors.
    ///
    /// # Errors
    /// As [`Arm::forward`].
    pub fn tip_at(&self, joints_rad: &[f64]) -> Result<TipAt, ArmError> {
        let reported = self.arm.forward(joints_rad)?;
        let tip = self.errors.true_tip(&reported, &self.arm.tip_from_joints(&reported, joints_rad)?);
        let base_from_tip = Pose::from_isometry(reported.isometry() * tip.reported_from_true);
        Ok(TipAt { base_from_tip, by_errors: tip.by_errors })
    }

    /// The chain of its links alone, with its joints where they really are, for descriptions of robots: [`Self::actual`] without
    /// the joints' compliance under gravity and without the field, which no fixed chain has.
    ///
    /// # Errors
    /// [`ArmError`] where the errors are not those of an arm.
    pub fn of_links(&self) -> Result<Arm, ArmError> {
        self.arm.displaced(&self.errors.at_rest())
    }

    /// Joint values in the middle of the ranges of the joints, as the start of a search when nothing else is known.
    pub fn middle_rad(&self) -> Vec<f64> {
        let middle = |range: JointRange| {
            if range.min.is_finite() && range.max.is_finite() { f64::midpoint(range.min, range.max) } else { 0.0 }
        };
        self.arm.ranges().into_iter().map(middle).collect()
    }

    /// How far the tip is from [`Self::actual`] at most with a probability of 95 %, metres.
    ///
    /// # Errors
    /// As [`Arm::forward`].
    pub fn error_95_m(&self, joints_rad: &[f64]) -> Result<f64, ArmError> {
        let covariance: Matrix6<f64> = self.tip_covariance(joints_rad)?;
        Ok(self.small_sample.radius_95(&position(&covariance)))
    }

    /// Covariance of the tip's pose `[t; r]` in its own axes: what is not known of the errors, and what they do not explain.
    ///
    /// # Errors
    /// As [`Arm::forward`].
    pub(crate) fn tip_covariance(&self, joints_rad: &[f64]) -> Result<Matrix6<f64>, ArmError> {
        let by_errors = self.tip_at(joints_rad)?.by_errors;
        let known = &by_errors * &self.covariance * by_errors.transpose();
        let (m, rad) = (self.unexplained.0.powi(2), self.unexplained.1.powi(2));
        let unexplained = Matrix6::from_diagonal(&Vector6::new(m, m, m, rad, rad, rad));
        Ok(unexplained + Matrix6::from_iterator(known.iter().copied()))
    }

    /// The command that takes the tip to the true pose `wanted`, by the configuration nearest to `near`. An arm with fewer than six
    /// joints takes the tip of its tool where that pose has it, and turns as near to the orientation as it can: within 5°.
    ///
    /// # Errors
    /// [`CorrectError`] states why the arm does not get there.
    pub fn command(&self, wanted: &Pose<Base, Tip>, near: &[f64]) -> Result<Command, CorrectError> {
        let joints_rad = self.joints_for(wanted, near, ARRIVED)?;
        let error_95_m = self.error_95_m(&joints_rad)?;
        Ok(Command { base_from_tip: self.arm.forward(&joints_rad)?, joints_rad, error_95_m })
    }

    /// The joint values of [`Self::command`], as near to the wanted pose as `arrived` requires, metres and radians.
    pub(crate) fn joints_for(
        &self,
        wanted: &Pose<Base, Tip>,
        near: &[f64],
        arrived: f64,
    ) -> Result<Vec<f64>, CorrectError> {
        if few_joints::has_few_joints(self) {
            let goal = PointGoal { base_from_tip: wanted, free_about_tool: false, turn_rad: TURN_OF_FEW_JOINTS };
            return few_joints::joints_for(self, &goal, near, arrived);
        }
        let mut pose = *wanted;
        let mut joints_rad = near.to_vec();
        let mut distance_m = f64::INFINITY;
        for _ in 0..STEPS {
            joints_rad = self.arm.inverse(&pose, &joints_rad)?;
            let actual = self.actual(&joints_rad)?;
            let (off_m, off_rad) = actual.distance_to(wanted);
            if off_m.max(off_rad) < arrived {
                return Ok(joints_rad);
            }
            distance_m = off_m;
            // The error of the tip there is also its error nearby.
            let by_errors = actual.inverse() * pose;
            pose = *wanted * by_errors;
        }
        Err(CorrectError::NotFound { steps: STEPS, distance_mm: distance_m * 1e3 })
    }
}

fn position(covariance: &Matrix6<f64>) -> Matrix3<f64> {
    covariance.fixed_view::<3, 3>(0, 0).into_owned()
}

/// A tip pose.
#[derive(Debug, Clone)]
pub struct TipAt {
    /// The pose as reported, or corrected for the errors of the arm.
    pub base_from_tip: Pose<Base, Tip>,
    /// The twists `[t; r]` on its right by which it changes with these errors; no columns where it is not corrected.
    pub by_errors: Matrix6xX<f64>,
}

impl From<&Pose<Base, Tip>> for TipAt {
    fn from(reported: &Pose<Base, Tip>) -> Self {
        Self { base_from_tip: *reported, by_errors: Matrix6xX::zeros(0) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::handeye::joint::{ArmParameter, LinkError, arm_parameters};
    use handeye_arm::ArmKind;

    fn corrected(degrees: f64) -> CorrectedArm {
        let count = arm_parameters(6).len();
        let size = |k: usize| if arm_parameters(6)[k].error.kind() == 1 { 1e-3 } else { degrees.to_radians() };
        let values = (0..count).map(|k| size(k) * ((k * k) as f64).sin()).collect();
        CorrectedArm {
            arm: ArmKind::Ur5e.arm(),
            errors: ArmErrors::new(6, values).expect("so many"),
            covariance: DMatrix::identity(count, count) * 1e-10,
            unexplained: (2e-5, 1e-5),
            small_sample: SmallSample::KNOWN,
            tool_m: USUAL_TOOL.into(),
        }
    }

    #[test]
    fn what_is_commanded_takes_the_tip_where_it_shall_be() {
        let joints = [0.3, -1.3, 1.7, -1.9, -1.6, 0.4];
        for degrees in [0.05, 2.0] {
            let corrected = corrected(degrees);
            let wanted = corrected.arm.forward(&joints).expect("six joints");
            let command = corrected.command(&wanted, &joints).expect("within reach");
            let (off_m, off_rad) = corrected.actual(&command.joints_rad).expect("six joints").distance_to(&wanted);
            assert!(off_m < 1e-9 && off_rad < 1e-9, "{degrees}°: {off_m} m, {off_rad} rad");
            assert!(command.base_from_tip.distance_to(&wanted).0 > 1e-4, "the errors are seen");
            assert!(command.error_95_m > 2e-5 && command.error_95_m < 1e-3, "{}", command.error_95_m);
        }
    }

    #[test]
    fn the_chain_of_links_is_the_real_arm_where_nothing_gives_way() {
        for arm in [ArmKind::Ur5e.arm(), handeye_arm::testing::UR5.arm().expect("an arm")] {
            let rigid = |(parameter, value): (&ArmParameter, &f64)| {
                if parameter.error == LinkError::Compliance { 0.0 } else { *value }
            };
            let values = arm_parameters(6).iter().zip(corrected(0.5).errors.values()).map(rigid).collect();
            let errors = ArmErrors::new(6, values).expect("so many");
            let mount = nalgebra::Isometry3::new([0.1, -0.2, 0.3].into(), [0.4, 1.2, -0.7].into());
            let corrected = CorrectedArm { arm: arm.mounted(mount, mount.inverse()), errors, ..corrected(0.5) };
            let chain = corrected.of_links().expect("an arm");
            for q in [[0.0; 6], [0.3, -1.3, 1.7, -1.9, -1.6, 0.4], [-2.0, 0.4, 2.2, 1.1, 0.8, -3.0]] {
                let (m, rad) = chain.forward(&q).expect("six").distance_to(&corrected.actual(&q).expect("six"));
                assert!(m < 1e-12 && rad < 1e-7, "{m} m, {rad} rad");
                assert!(chain.forward(&q).expect("six").distance_to(&corrected.arm.forward(&q).expect("six")).0 > 1e-4);
            }
        }
    }

    #[test]
    fn a_pose_out_of_reach_says_so() {
        let far = Pose::from_isometry(nalgebra::Isometry3::translation(3.0, 0.0, 0.0));
        assert!(matches!(corrected(0.05).command(&far, &[0.1; 6]), Err(CorrectError::Reach(_))));
    }
}
