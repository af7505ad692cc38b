//! Commands of arms with fewer joints than a pose has dimensions: the tip of the tool arrives, turned as nearly as wanted as the
//! joints allow.

use std::f64::consts::FRAC_PI_2;

use nalgebra::{DMatrix, DVector, Isometry3, Matrix3, Point3, UnitQuaternion, Vector3};

use crate::corrected_arm::{CorrectError, CorrectedArm};
use handeye_arm::{DlsOptions, IkError};
use handeye_geometry::frames::{Base, Pose, Tip};
use handeye_geometry::se3;

/// Joints of an arm that takes its tip to any pose around it.
const JOINTS_OF_A_POSE: usize = 6;
/// The number of places that the search begins at.
const STARTS: usize = 2;
const STEPS: usize = 100;
/// Largest change of a joint in one step, radians or metres.
const LARGEST_STEP: f64 = 0.2;
/// Change of the joints below which the orientation is the nearest one, radians or metres.
const SETTLED: f64 = 1e-9;
/// Smaller singular values are no direction in which the arm moves, metres or radians per radian.
const SINGULAR: f64 = 1e-6;

/// What of a pose an arm with few joints is sent to.
#[derive(Debug, Clone, Copy)]
pub(crate) struct PointGoal<'a> {
    pub base_from_tip: &'a Pose<Base, Tip>,
    /// Whether rotation about the line from the tip to the tip of the tool is free.
    pub free_about_tool: bool,
    /// Largest angle between the wanted orientation and the nearest one, radians.
    pub turn_rad: f64,
}

/// Whether an arm does not reach poses in general.
pub(crate) fn has_few_joints(arm: &CorrectedArm) -> bool {
    arm.arm.joint_count() < JOINTS_OF_A_POSE
}

/// Joint values that take the tip of the tool where the wanted pose has it, within `arrived_m`, and turn the tip as near to the wanted
/// orientation as they then can, by the corrected arm.
///
/// # Method
/// Gauss-Newton steps for the point, and in their null space for the orientation, from `near` and from the middle of the ranges
/// (Siciliano et al. 2009, *Robotics*, section 3.5.1).
///
/// # Errors
/// [`IkError::NotFound`] where the point is out of reach, [`CorrectError::Orientation`] where the arm does not turn that way.
pub(crate) fn joints_for(
    arm: &CorrectedArm,
    goal: &PointGoal<'_>,
    near: &[f64],
    arrived_m: f64,
) -> Result<Vec<f64>, CorrectError> {
    // The other place counts only where the arm does not get there from the first.
    let mut nearest = Nearest::default();
    for start in [near.to_vec(), arm.middle_rad()] {
        let start = arm.arm.towards(goal.base_from_tip, &start, &DlsOptions::default())?;
        let found = descend(arm, goal, start)?;
        if found.off_m < arrived_m && found.off_rad <= goal.turn_rad {
            return Ok(found.joints_rad);
        }
        // An orientation counts among those that arrive.
        let rank = |one: &Nearest| (one.off_m.max(arrived_m), one.off_rad);
        if rank(&found) < rank(&nearest) {
            nearest = found;
        }
    }
    let angle_deg = nearest.off_rad.to_degrees();
    if nearest.off_m < arrived_m {
        return Err(CorrectError::Orientation { joints: arm.arm.joint_count(), angle_deg });
    }
    Err(IkError::NotFound { distance_mm: nearest.off_m * 1e3, angle_deg, starts: STARTS }.into())
}

/// Joint values and how far off the goal they are.
struct Nearest {
    joints_rad: Vec<f64>,
    off_m: f64,
    off_rad: f64,
}

impl Default for Nearest {
    fn default() -> Self {
        Self { joints_rad: Vec::new(), off_m: f64::INFINITY, off_rad: f64::INFINITY }
    }
}

fn descend(arm: &CorrectedArm, goal: &PointGoal<'_>, mut joints_rad: Vec<f64>) -> Result<Nearest, CorrectError> {
    let ranges = arm.arm.ranges();
    for _ in 0..STEPS {
        let here = Here::new(arm, goal, &joints_rad)?;
        let step = here.step();
        let scale = (LARGEST_STEP / step.amax()).min(1.0);
        let moved: Vec<f64> = joints_rad
            .iter()
            .zip(step.iter())
            .zip(&ranges)
            .map(|((value, step), range)| range.clamp(value + step * scale))
            .collect();
        let change = moved.iter().zip(&joints_rad).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        joints_rad = moved;
        if change < SETTLED {
            break;
        }
    }
    let here = Here::new(arm, goal, &joints_rad)?;
    Ok(Nearest { joints_rad, off_m: here.shift.norm(), off_rad: here.turn.norm() })
}

/// What is left to the goal, and what the joints do about it, in the axes of the base.
struct Here {
    shift: Vector3<f64>,
    turn: Vector3<f64>,
    shift_by_joints: DMatrix<f64>,
    turn_by_joints: DMatrix<f64>,
}

impl Here {
    fn new(arm: &CorrectedArm, goal: &PointGoal<'_>, joints_rad: &[f64]) -> Result<Self, CorrectError> {
        let actual = *arm.actual(joints_rad)?.isometry();
        let wanted: &Isometry3<f64> = goal.base_from_tip.isometry();
        let lever = actual.rotation * arm.tool_m;
        // That of the arm as its controller has it: steps need not be exact.
        let by_joints = arm.arm.jacobian(joints_rad)?;
        let mut shift_by_joints = DMatrix::zeros(3, by_joints.ncols());
        let mut turn_by_joints = DMatrix::zeros(3, by_joints.ncols());
        let free = lever.try_normalize(0.0).filter(|_| goal.free_about_tool);
        let counts = free.map_or_else(Matrix3::identity, |axis| Matrix3::identity() - axis * axis.transpose());
        for (k, column) in by_joints.column_iter().enumerate() {
            let turn = column.fixed_rows::<3>(3).into_owned();
            shift_by_joints.set_column(k, &(column.fixed_rows::<3>(0) + turn.cross(&lever)));
            turn_by_joints.set_column(k, &(counts * turn));
        }
        let turn = if free.is_some() {
            // The shortest rotation between the two directions of the tool; none is shorter if they are opposite.
            let shortest = UnitQuaternion::rotation_between(&lever, &(wanted.rotation * arm.tool_m));
            shortest.map_or_else(|| Vector3::repeat(FRAC_PI_2), |turn| se3::rotation_vector(&turn))
        } else {
            se3::rotation_vector(&(wanted.rotation * actual.rotation.inverse()))
        };
        let tool = Point3::from(arm.tool_m);
        let shift = wanted * tool - actual * tool;
        Ok(Self { shift, turn, shift_by_joints, turn_by_joints })
    }

    fn step(&self) -> DVector<f64> {
        let first = inverse(&self.shift_by_joints);
        let for_point = &first * self.shift;
        let count = self.shift_by_joints.ncols();
        let free = DMatrix::identity(count, count) - &first * &self.shift_by_joints;
        let left = self.turn - &self.turn_by_joints * &for_point;
        for_point + &free * (inverse(&(&self.turn_by_joints * &free)) * left)
    }
}

/// Moore and Penrose's inverse; zero where nothing moves.
fn inverse(of: &DMatrix<f64>) -> DMatrix<f64> {
    of.clone().pseudo_inverse(SINGULAR).unwrap_or_else(|_negative_limit| DMatrix::zeros(of.ncols(), of.nrows()))
}

#[cfg(test)]
#[path = "few_joints_tests.rs"]
mod tests;
