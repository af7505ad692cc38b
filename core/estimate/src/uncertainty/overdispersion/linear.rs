//! The effect of every view on the answer, to first order.

use nalgebra::{DMatrix, Matrix6, UnitQuaternion, Vector6};

use crate::handeye::HandEyeError;
use crate::handeye::joint::view_block::{Own, PixelWeights, ViewBlock, prior_weight};
use crate::handeye::joint::{JointProblem, JointSolution};
use handeye_geometry::frames::{Base, Pose, Tip};
use handeye_geometry::progress::Work;

/// One view at the solution of its problem. Displacements of the hand-eye transform are in units of its uncertainty:
/// multiplied by the inverse of the Cholesky factor of its covariance, that of independent errors with the noise levels
/// found, before anything was added to it.
pub struct LinearView {
    /// What the view adds to the displacement of the hand-eye transform; over all views these sum to zero.
    pub pull: Vector6<f64>,
    /// Covariance that `pull` should have.
    pub expected: Matrix6<f64>,
    /// Estimated error of the robot in its base's axes at the tip, in standard deviations.
    pub robot: Vector6<f64>,
    /// How far such an error moves the hand-eye transform.
    pub by_robot: Matrix6<f64>,
    /// Where the tip was.
    pub base_from_tip: Pose<Base, Tip>,
}

/// A covariance of the shared unknowns, and its first six rows in units of the hand-eye's uncertainty.
struct Covariance {
    all: DMatrix<f64>,
    whitened: DMatrix<f64>,
}

/// Linearises a problem at its solution.
pub fn views(
    problem: &JointProblem<'_>,
    solution: &JointSolution,
    work: &Work<'_>,
) -> Result<Vec<LinearView>, HandEyeError> {
    let count = problem.views.len();
    let fails = |reason| HandEyeError::NoSolution { method: "the check of the uncertainty", views: count, reason };
    let system = solution.linearised(problem)?;
    let all = system.reduce(&solution.noise)?.inverse();
    let hand_eye: Matrix6<f64> = all.fixed_view::<6, 6>(0, 0).into_owned();
    let root = hand_eye.cholesky().ok_or_else(|| fails("the covariance is singular"))?.l();
    let rows = all.rows(0, 6).into_owned();
    let whitened = root.solve_lower_triangular(&rows).ok_or_else(|| fails("the covariance is singular"))?;
    let covariance = Covariance { all, whitened };
    let mut views = Vec::with_capacity(count);
    for ((block, correction), view) in system.blocks.iter().zip(&system.corrections).zip(problem.views) {
        if work.is_cancelled() {
            return Err(HandEyeError::Cancelled);
        }
        let linear = LinearView::new(block, correction, &view.base_from_tip, &covariance, solution);
        views.push(linear.ok_or_else(|| fails("the pose correction of a view is undetermined"))?);
    }
    Ok(views)
}

impl LinearView {
    fn new(
        block: &ViewBlock,
        correction: &Vector6<f64>,
        base_from_tip: &Pose<Base, Tip>,
        covariance: &Covariance,
        solution: &JointSolution,
    ) -> Option<Self> {
        let noise = &solution.noise;
        let (information, gradient) = block.information(noise, correction)?;
        // C M C less C M C M C, due to the view's own part in the estimate.
        let by_view = &covariance.whitened * information;
        let expected = &by_view * covariance.whitened.transpose() - &by_view * &covariance.all * by_view.transpose();
        // An error d of the robot shows as own⁻¹ P d in the correction, and its effect on the rest goes through `cross`.
        let weight = PixelWeights::new(noise).pose;
        let prior = prior_weight(noise);
        let own = Own::new(block, correction, weight, &prior, 0.0)?;
        let to_base = turned(&base_from_tip.rotation());
        let scale = Matrix6::from_diagonal(&prior.map(f64::sqrt));
        let gain = &covariance.whitened * &block.by_shared * (block.by_correction * weight);
        let by_robot = gain * own.factor.inverse() * scale * to_base.transpose();
        Some(Self {
            pull: (&covariance.whitened * gradient).fixed_rows::<6>(0).into_owned(),
            expected: expected.fixed_view::<6, 6>(0, 0).into_owned(),
            robot: to_base * scale * correction,
            by_robot: by_robot.fixed_view::<6, 6>(0, 0).into_owned(),
            base_from_tip: *base_from_tip,
        })
    }
}

/// Turns translation and rotation vector equally.
fn turned(rotation: &UnitQuaternion<f64>) -> Matrix6<f64> {
    let r = rotation.to_rotation_matrix().into_inner();
    let mut out = Matrix6::zeros();
    out.fixed_view_mut::<3, 3>(0, 0).copy_from(&r);
    out.fixed_view_mut::<3, 3>(3, 3).copy_from(&r);
    out
}
