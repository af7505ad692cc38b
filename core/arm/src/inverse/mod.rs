//! From a pose to joint values: in closed form for the arms of Universal Robots, by search for all others.

mod damped;
mod halton;
mod obstacle;
mod search;
mod ur;

use std::f64::consts::{PI, TAU};

use nalgebra::{Isometry3, SMatrix, Vector3, Vector6};

use super::{Arm, ArmError, Axis, JointKind, JointRange, MAX_JOINTS};
use handeye_geometry::frames::{Base, Pose, Tip};
use handeye_geometry::se3;

pub use damped::DlsOptions;
pub use obstacle::Obstacle;
pub(super) use ur::UrGeometry;

/// Why no joint values put the arm at a pose.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error, handeye_wording::Localized)]
#[non_exhaustive]
pub enum IkError {
    /// No configuration reaches it, even without limits.
    #[error("the arm cannot reach this pose: {obstacle}")]
    Unreachable {
        /// What prevents it.
        obstacle: Obstacle,
    },
    /// Configurations reach it, but all of them have a joint out of its range.
    #[error(
        "this pose needs joint {number} at {needed_deg:.1}°, outside its range of {min_deg:.1}° to {max_deg:.1}°, and all \
         other configurations are outside too: turn the tip or move it towards the middle of the workspace",
        number = joint + 1
    )]
    OutsideLimits {
        /// The joint, counted from 0, of the configuration that exceeds its limits least.
        joint: usize,
        /// Its value there.
        needed_deg: f64,
        /// Lower limit of the joint.
        min_deg: f64,
        /// Upper limit of the joint.
        max_deg: f64,
    },
    /// The search found no solution within the limits of the joints.
    #[error(
        "no joint values within their limits were found for this pose from {starts} places; the nearest leave the tip \
         {distance_mm:.1} mm and {angle_deg:.1}° away: move the goal towards the middle of the workspace or turn it"
    )]
    NotFound {
        /// Distance of the nearest one found, millimetres.
        distance_mm: f64,
        /// Angle of the nearest one found, degrees.
        angle_deg: f64,
        /// Number of starts of the search.
        starts: usize,
    },
    /// Values for another number of joints.
    #[error("{got} joint values to begin with, for an arm of {need} joints")]
    WrongCount {
        /// Values given.
        got: usize,
        /// Joints of the arm.
        need: usize,
    },
    /// The goal or the seed is not a finite pose.
    #[error("the pose is not finite: it has a NaN or an infinite number")]
    NotFinite,
}

impl Arm {
    /// Joint values within their ranges that put the tip at a pose, nearest to `near`, the present values of the arm:
    /// radians and metres. A joint with a range of more than one revolution is taken at the revolution nearest to its
    /// value there.
    ///
    /// # Method
    /// An arm with the geometry of Universal Robots, independent of the source of its numbers, has up to eight
    /// configurations in closed form, of which this is the nearest; they agree with the pose to 1e-12 m and rad, and to
    /// 1e-8 where the arm is exactly stretched. Any other arm is searched by damped least squares, first from `near` and
    /// then from places of its workspace that are the same in every call, nearest first; the result agrees to 1e-8 m and
    /// rad. A search may miss an existing configuration, and the nearest one found need not be the nearest one that exists.
    /// With more joints than a pose has dimensions, those near an end of their range are moved inwards in the process, by
    /// no more than the goal itself moves the joints.
    ///
    /// # Errors
    /// [`IkError`] states what prevents it or which joint would leave its range; after a search, how near the tip came.
    pub fn inverse(&self, base_from_tip: &Pose<Base, Tip>, near: &[f64]) -> Result<Vec<f64>, IkError> {
        if near.len() != self.joint_count() {
            return Err(IkError::WrongCount { got: near.len(), need: self.joint_count() });
        }
        if !base_from_tip.is_finite() || !near.iter().all(|q| q.is_finite()) {
            return Err(IkError::NotFinite);
        }
        let goal = base_from_tip.isometry();
        match &self.ur {
            Some(ur) => ur.nearest(self, goal, near, &self.ranges()).map(|joints| joints.to_vec()),
            None => search::nearest(self, goal, near),
        }
    }

    /// The same without a search: in closed form, or by one descent from `near`; `None` where that gives no solution. For many
    /// poses of which some are out of reach, where [`Self::inverse`] takes a hundred times as long.
    pub fn inverse_nearby(&self, base_from_tip: &Pose<Base, Tip>, near: &[f64]) -> Option<Vec<f64>> {
        if self.ur.is_some() {
            return self.inverse(base_from_tip, near).ok();
        }
        let is_usable =
            near.len() == self.joint_count() && base_from_tip.is_finite() && near.iter().all(|q| q.is_finite());
        if is_usable { search::nearby(self, base_from_tip.isometry(), near) } else { None }
    }

    /// All configurations that put the tip at a pose, every joint in (−π, π] whatever its range; `None` for an arm that
    /// has no closed form. Empty when the pose is out of reach or not finite. Where the fourth and sixth axes are parallel,
    /// joint 6 is free, and one configuration represents all.
    pub fn configurations(&self, base_from_tip: &Pose<Base, Tip>) -> Option<Vec<Vec<f64>>> {
        let found = self.ur.as_ref()?.all(self, base_from_tip.isometry());
        Some(found.iter().map(|joints| joints.to_vec()).collect())
    }

    /// Joint values, found by damped least squares from `near`, that take the tip as close to a pose as possible; the
    /// pose need not be in reach.
    ///
    /// # Errors
    /// [`ArmError::WrongCount`] and [`ArmError::NotFinite`].
    pub fn towards(
        &self,
        base_from_tip: &Pose<Base, Tip>,
        near: &[f64],
        options: &DlsOptions,
    ) -> Result<Vec<f64>, ArmError> {
        self.check(near)?;
        Ok(damped::towards(self, base_from_tip.isometry(), near, options, &self.ranges()))
    }

    /// As [`Self::towards`]; `None` when the pose is not within the precision of the options after the last iteration.
    ///
    /// # Errors
    /// As [`Self::towards`].
    pub fn descend(
        &self,
        base_from_tip: &Pose<Base, Tip>,
        near: &[f64],
        options: &DlsOptions,
    ) -> Result<Option<Vec<f64>>, ArmError> {
        let joints = self.towards(base_from_tip, near, options)?;
        let error = pose_error(&self.tip(&joints), base_from_tip.isometry());
        Ok(is_within(&error, options.precision_m, options.precision_rad).then_some(joints))
    }

    /// Pose of the tip; there must be a value for every joint.
    fn tip(&self, joints: &[f64]) -> Isometry3<f64> {
        self.walk(joints, |_, _, _| ()) * self.flange_from_tip
    }

    /// Pose of the tip, and its velocity per velocity of each joint in the axes of the base.
    fn tip_and_columns(&self, joints: &[f64]) -> (Isometry3<f64>, Columns) {
        let still = Axis { kind: JointKind::Revolute, direction: Vector3::zeros(), point: Vector3::zeros() };
        let mut axes = [still; MAX_JOINTS];
        let flange = self.walk(joints, |i, at_rest, _| axes[i] = Axis::of(&self.joints[i], at_rest));
        let tip = flange * self.flange_from_tip;
        let mut columns = Columns::zeros();
        for (i, axis) in axes.iter().take(self.joints.len()).enumerate() {
            columns.set_column(i, &axis.velocity(&tip.translation.vector));
        }
        (tip, columns)
    }
}

/// The Jacobian of an arm of any number of joints; columns beyond it are zero.
type Columns = SMatrix<f64, 6, MAX_JOINTS>;

/// Displacement and rotation vector from `actual` to `goal`, both in the axes of the base.
pub(super) fn pose_error(actual: &Isometry3<f64>, goal: &Isometry3<f64>) -> Vector6<f64> {
    let shift = goal.translation.vector - actual.translation.vector;
    let turn = se3::rotation_vector(&(goal.rotation * actual.rotation.inverse()));
    Vector6::new(shift.x, shift.y, shift.z, turn.x, turn.y, turn.z)
}

/// Whether an error is within a distance and an angle.
fn is_within(error: &Vector6<f64>, precision_m: f64, precision_rad: f64) -> bool {
    error.fixed_rows::<3>(0).norm() <= precision_m && error.fixed_rows::<3>(3).norm() <= precision_rad
}

/// `Δq = Jᵀ (J Jᵀ + λ² I)⁻¹ e`; `None` where that has no solution.
fn damped_step(columns: &Columns, error: &Vector6<f64>, damping_squared: f64) -> Option<SMatrix<f64, MAX_JOINTS, 1>> {
    let mut damped = columns * columns.transpose();
    for i in 0..6 {
        damped[(i, i)] += damping_squared;
    }
    Some(columns.transpose() * damped.cholesky()?.solve(error))
}

/// The value that differs from `value` by whole revolutions, is in the range, and is nearest to `near`.
fn nearest_turn(value: f64, near: f64, range: &JointRange) -> Option<f64> {
    let lowest = ((range.min - value) / TAU - JointRange::SLACK).ceil();
    let highest = ((range.max - value) / TAU + JointRange::SLACK).floor();
    let turns = ((near - value) / TAU).round().max(lowest).min(highest);
    (lowest <= highest && turns.is_finite()).then_some(value + turns * TAU)
}

/// The same angle in (−π, π].
pub(super) fn wrap(angle: f64) -> f64 {
    let wrapped = angle - (angle / TAU).round() * TAU;
    if wrapped <= -PI { wrapped + TAU } else { wrapped }
}

#[cfg(test)]
mod tests;
