//! How near a tool arrives at a point that the camera saw, where only the accuracy of the arm is known.
//!
//! # What it estimates
//! The distance of [`reach_error`](crate::reach_error) by the uncorrected controller, for an arm whose joints or chain are not
//! known.
//!
//! # Model
//! Where the tip really is differs from where the robot reports it by a shift and a turn, normal and isotropic, with the stated
//! accuracy as the root mean square of the shift. At the view, at the touch and at each turn by which the tool is found they are
//! drawn again, although the errors of an arm in a whole region are similar: of the touches of 17 real arms 95 % and more are
//! within, of arms with larger errors where they touch than where they look 82 % and more. What the views show of the robot's noise
//! and its pose-dependent error counts where it exceeds the stated accuracy.
//!
//! Makers state no accuracy of rotations. It follows from [`TURN_PER_M`].
//!
//! # Reference
//! ISO 9283 (pose accuracy); the 17 factory calibrations of `tests/studies/arm_errors`.

use std::ops::RangeInclusive;

use nalgebra::{Cholesky, Matrix3, Matrix3x6, Matrix6, Point3, UnitQuaternion, Vector3, Vector6};
use statrs::distribution::{ChiSquared, ContinuousCDF as _};

use crate::handeye::draw::Draw;
use crate::handeye::joint::SmallSample;
use crate::handeye::{HandEye, Mode};
use crate::reach_error::{
    APART, DRAWS, Plan, ReachErrors, SEED, USUAL_TOOL, along, camera, pivot_row, planned, quantile, turns,
};
use handeye_geometry::frames::{Camera, Pose, Target};
use handeye_geometry::targets::TargetSpec;

/// Orientation error of the tip in radians per metre of position error, root mean square each: that of a recorded UR5e, whose
/// nominal chain is 0.41 mm and 0.145° off its controller's. For 17 factory calibrations it is 2 to 4.
pub(crate) const TURN_PER_M: f64 = 6.0;

/// Accuracies that may be stated for a robot, millimetres: from better than any arm to a robot that should be calibrated
/// first.
pub const ROBOT_ACCURACY_MM: RangeInclusive<f64> = 0.001..=100.0;

/// What is known of a robot beforehand, and the tool that it positions.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RobotAccuracy {
    /// Distance between where the tip is and where the robot reports it, root mean square over the region in which it works, with
    /// base and TCP where that is least, millimetres.
    pub accuracy_mm: f64,
    /// Where the tip of its tool is in the frame of the tip, metres.
    pub tool_m: [f64; 3],
}

impl RobotAccuracy {
    /// With an accuracy in millimetres, and a usual tool where none is stated.
    pub fn new(accuracy_mm: f64, tool_m: Option<[f64; 3]>) -> Self {
        Self { accuracy_mm, tool_m: tool_m.unwrap_or(USUAL_TOOL) }
    }
}

/// Errors of a robot, standard deviations per axis, metres and radians.
#[derive(Debug, Clone, Copy)]
struct Off {
    metres: f64,
    radians: f64,
}

impl Off {
    /// Covariance of a point in this direction and distance of the tip.
    fn at(self, lever: &Vector3<f64>) -> Matrix3<f64> {
        let turned = Matrix3::identity() * lever.norm_squared() - lever * lever.transpose();
        Matrix3::identity() * self.metres.powi(2) + turned * self.radians.powi(2)
    }
}

/// Jacobian of a touch by the hand-eye transform, and the root of its covariance by the errors of the robot.
type Missed = (Matrix3x6<f64>, Matrix3<f64>);

/// How near a tool arrives by a calibration of a robot of which the accuracy is known.
#[derive(Debug, Clone)]
pub struct ReachByAccuracy {
    hand_eye: HandEye,
    /// Covariance of the hand-eye transform, metres and radians.
    covariance: Matrix6<f64>,
    law: SmallSample,
    views: Vec<Pose<Camera, Target>>,
    target: TargetSpec,
    accuracy: RobotAccuracy,
    off: Off,
    tool: Vector3<f64>,
    /// Covariance of the place where the tip of the tool is found, in the frame of the tip.
    tool_covariance: Matrix3<f64>,
}

impl ReachByAccuracy {
    /// The reach with a calibration by reported poses; `shown` are the errors of the robot that its views show, standard deviations
    /// per axis, metres and radians, and `views` where the camera saw the target. `None` without views, and for a covariance that
    /// is not valid.
    pub(crate) fn new(
        accuracy: &RobotAccuracy,
        shown: [f64; 2],
        (hand_eye, covariance, law): (&HandEye, &Matrix6<f64>, SmallSample),
        views: Vec<Pose<Camera, Target>>,
        target: &TargetSpec,
    ) -> Option<Self> {
        let metres = accuracy.accuracy_mm * 1e-3 / 3.0_f64.sqrt();
        let off = Off { metres: metres.max(shown[0]), radians: (metres * TURN_PER_M).max(shown[1]) };
        let tool = Vector3::from(accuracy.tool_m);
        let tool_covariance = of_tool(&turns(&mut Draw::new(SEED)), &off.at(&tool))?;
        let (hand_eye, covariance, target, accuracy) = (*hand_eye, *covariance, *target, *accuracy);
        let by_accuracy = Self { hand_eye, covariance, law, views, target, accuracy, off, tool, tool_covariance };
        (!by_accuracy.views.is_empty()).then_some(by_accuracy)
    }

    /// Errors at points of the target where it was seen.
    pub(crate) fn at_target(&self) -> Option<ReachErrors> {
        let points = self.target.points();
        let seen = |view: usize, random: &mut Draw| self.views[view].isometry() * points[random.below(points.len())];
        if points.is_empty() { None } else { self.errors(seen) }
    }

    /// Errors at points in the coordinates of a camera next to the robot, metres: the largest of their errors. `None` with a camera
    /// on the arm.
    pub(crate) fn at_points(&self, in_camera: &[Point3<f64>]) -> Option<ReachErrors> {
        let points = in_camera.iter().filter(|_| self.is_eye_to_hand());
        points.filter_map(|point| self.errors(|_, _| *point)).reduce(ReachErrors::worse)
    }

    /// Whether the camera is next to the robot (eye to hand).
    pub(crate) fn is_eye_to_hand(&self) -> bool {
        self.hand_eye.mode() == Mode::EyeToHand
    }

    /// What was stated about the robot and its tool.
    pub(crate) fn accuracy(&self) -> &RobotAccuracy {
        &self.accuracy
    }

    fn errors(&self, point: impl Fn(usize, &mut Draw) -> Point3<f64>) -> Option<ReachErrors> {
        let (axis, planned) = (self.mean_axis()?, planned(self.views.len(), point));
        let touches = planned.iter().map(|plan| self.touch(plan, &axis)).collect::<Option<Vec<_>>>()?;
        let as_it_is_95_m = self.quantile(&touches, &Cholesky::new(self.covariance)?.l())?;
        Some(ReachErrors {
            as_it_is_95_m,
            corrected_95_m: None,
            // A draw may get shorter by what is added to it.
            as_it_is_least_95_m: self.quantile(&touches, &Matrix6::zeros())?.min(as_it_is_95_m),
            repeatability_95_m: None,
        })
    }

    /// The quantile of the distances where the covariance of the hand-eye transform has this root.
    fn quantile(&self, touches: &[Missed], of_hand_eye: &Matrix6<f64>) -> Option<f64> {
        // Practically infinite.
        let freedom = self.law.degrees_of_freedom.min(1e4);
        let law = ChiSquared::new(freedom).ok()?;
        let mut random = Draw::new(SEED);
        let mut distances = Vec::with_capacity(DRAWS * touches.len() / APART);
        for k in 0..DRAWS {
            let normal = Vector6::from_fn(|_, _| random.normal());
            let step = of_hand_eye * normal * (freedom / law.inverse_cdf(random.even())).sqrt();
            for (by_hand_eye, by_robot) in touches.iter().skip(k % APART).step_by(APART) {
                let off = by_hand_eye * step + by_robot * Vector3::from_fn(|_, _| random.normal());
                distances.push(off.norm());
            }
        }
        quantile(distances)
    }

    /// Jacobian of a touch by the hand-eye transform, and the root of its covariance by the errors of the robot.
    fn touch(&self, plan: &Plan, axis: &Vector3<f64>) -> Option<Missed> {
        let seen = &self.views[plan.view];
        let base_from_tip = *self.hand_eye.base_from_tip(seen).isometry();
        let base_from_camera = camera(&self.hand_eye, &base_from_tip);
        let turn = along(self.hand_eye.mode(), &base_from_camera, seen, axis) * plan.turn;
        let point = base_from_camera * plan.in_camera;
        let turned = turn.to_rotation_matrix();
        let mut covariance = self.off.at(&(turn * self.tool)) + turned * self.tool_covariance * turned.transpose();
        if self.hand_eye.mode() == Mode::EyeInHand {
            covariance += self.off.at(&(point.coords - base_from_tip.translation.vector));
        }
        let camera = base_from_camera.rotation.to_rotation_matrix();
        let mut by_hand_eye = Matrix3x6::zeros();
        by_hand_eye.fixed_columns_mut::<3>(0).copy_from(camera.matrix());
        by_hand_eye.fixed_columns_mut::<3>(3).copy_from(&(camera * -plan.in_camera.coords.cross_matrix()));
        Some((by_hand_eye, Cholesky::new(covariance)?.l()))
    }

    /// The mean z axis of the tip over the views, in the base.
    fn mean_axis(&self) -> Option<Vector3<f64>> {
        let axes = self.views.iter().map(|seen| self.hand_eye.base_from_tip(seen).rotation() * Vector3::z());
        axes.sum::<Vector3<f64>>().try_normalize(1e-9)
    }
}

/// Covariance of the place `t` of the tip of a tool for which with the shift `s` all `R_k (t − l_k) − s` are least, where each
/// `l_k` has this one.
fn of_tool(turns: &[UnitQuaternion<f64>], of_each: &Matrix3<f64>) -> Option<Matrix3<f64>> {
    let rows = turns.iter().map(|turn| (pivot_row(turn), *turn.to_rotation_matrix().matrix()));
    let information: Matrix6<f64> = rows.clone().map(|(row, _)| row.transpose() * row).sum();
    let solved = Cholesky::new(information)?.inverse();
    let each = rows.map(|(row, turn)| {
        let by_place = (solved * row.transpose() * turn).fixed_rows::<3>(0).into_owned();
        by_place * of_each * by_place.transpose()
    });
    Some(each.sum())
}

#[cfg(test)]
#[path = "robot_accuracy_tests.rs"]
mod tests;
