//! What a calibration is worth: expected error in millimetres, and error on views it has not seen.

use nalgebra::{Matrix3, Matrix6, Point3, SMatrix};

use super::HandEyeError;
use super::joint::{JointProblem, JointSolution, JointStart, camera_from_target, estimate};
use crate::observation::View;
use crate::progress::{Stage, Work};
use crate::se3::skew;

/// Covariance in the camera frame of where `point` (camera coordinates, metres) is said to be, given the covariance
/// `[t; r]` of the hand-eye transform (right perturbation).
pub fn point_covariance(hand_eye: &Matrix6<f64>, point: &Point3<f64>) -> Matrix3<f64> {
    let mut by_pose = SMatrix::<f64, 3, 6>::zeros();
    by_pose.fixed_view_mut::<3, 3>(0, 0).copy_from(&Matrix3::identity());
    by_pose.fixed_view_mut::<3, 3>(0, 3).copy_from(&-skew(&point.coords));
    by_pose * hand_eye * by_pose.transpose()
}

/// The length that a Gaussian error vector of this covariance stays under with a probability of 95 %.
///
/// Exact up to quadrature (relative 1e-4): along a direction `u` of the unit sphere the squared length is chi-square
/// with three degrees of freedom scaled by `uᵀ C u`, averaged over all directions.
/// Zero for a zero matrix; not finite when the covariance is not.
pub fn radius_95(covariance: &Matrix3<f64>) -> f64 {
    let eigenvalues = covariance.symmetric_eigenvalues().map(|v| v.max(0.0));
    let largest = eigenvalues.max();
    if largest == 0.0 || !largest.is_finite() {
        return largest;
    }
    let probability = |radius: f64| {
        let mut sum = 0.0;
        // Midpoint rule over one octant: z = cos(polar) is uniform on the sphere, and the integrand is smooth.
        for i in 0..QUADRATURE {
            let z = (i as f64 + 0.5) / QUADRATURE as f64;
            for j in 0..QUADRATURE {
                let azimuth = (j as f64 + 0.5) / QUADRATURE as f64 * std::f64::consts::FRAC_PI_2;
                let r2 = 1.0 - z * z;
                let scale = eigenvalues[0] * r2 * azimuth.cos().powi(2)
                    + eigenvalues[1] * r2 * azimuth.sin().powi(2)
                    + eigenvalues[2] * z * z;
                sum += chi_square_3(radius * radius / scale.max(f64::MIN_POSITIVE));
            }
        }
        sum / (QUADRATURE * QUADRATURE) as f64
    };
    // Between one and three equal axes of the largest size.
    let (mut low, mut high) = (1.9 * largest.sqrt(), 2.8 * largest.sqrt());
    for _ in 0..BISECTIONS {
        let middle = 0.5 * (low + high);
        if probability(middle) < 0.95 {
            low = middle;
        } else {
            high = middle;
        }
    }
    0.5 * (low + high)
}

/// Nodes per angle.
const QUADRATURE: usize = 48;
/// Halvings of a bracket half as wide as the answer: 2⁻²⁰ of it.
const BISECTIONS: usize = 20;

/// Distribution function of chi-square with three degrees of freedom.
fn chi_square_3(x: f64) -> f64 {
    libm::erf((0.5 * x).sqrt()) - (2.0 * x / std::f64::consts::PI).sqrt() * (-0.5 * x).exp()
}

/// Expected error of a point that the camera measures, at the place where it saw the target: 95 % of errors are below
/// this many metres. It counts the hand-eye transform alone, with what robot and corner noise did to it; the noise of
/// a later robot pose or picture comes on top.
pub fn tip_error_95_m(solution: &JointSolution) -> f64 {
    radius_95(&point_covariance(&solution.hand_eye_covariance(), &solution.reference_point))
}

/// Most folds of the cross-validation.
const FOLDS: usize = 5;

/// RMS of 2-D corner residuals [px] on views that the fit did not use, each predicted from its reported robot pose
/// alone, over five folds (or one view at a time when there are fewer than ten). View `i` is in fold `i mod folds`.
///
/// `None` when a fold leaves too few views for a fit. `work` is a `&CancelToken`, or a [`Work`] to follow the progress.
///
/// # Errors
/// [`HandEyeError::Cancelled`].
pub fn held_out_rms_px<'a>(
    problem: &JointProblem<'_>,
    start: &JointStart,
    work: impl Into<Work<'a>>,
) -> Result<Option<f64>, HandEyeError> {
    let work = work.into();
    let count = problem.views.len();
    let folds = if count < 2 * FOLDS { count } else { FOLDS };
    let mut squared = 0.0;
    let mut corners = 0usize;
    for fold in 0..folds {
        work.report(Stage::HeldOut, fold, folds);
        let (held, used): (Vec<_>, Vec<_>) =
            problem.views.iter().cloned().enumerate().partition(|(i, _)| i % folds == fold);
        let used: Vec<View> = used.into_iter().map(|(_, view)| view).collect();
        let fit = match estimate(&JointProblem { views: &used, ..*problem }, start, work.cancel) {
            Ok(fit) => fit,
            Err(HandEyeError::Cancelled) => return Err(HandEyeError::Cancelled),
            Err(_) => return Ok(None),
        };
        for (_, view) in &held {
            let Some(sum) = prediction_squares(problem, &fit, view) else { return Ok(None) };
            squared += sum;
            corners += view.corners.len();
        }
    }
    Ok((corners > 0).then(|| (squared / corners as f64).sqrt()))
}

/// Sum of squared 2-D residuals of one view predicted from its reported robot pose; `None` when a point falls behind
/// the camera.
fn prediction_squares(problem: &JointProblem<'_>, fit: &JointSolution, view: &View) -> Option<f64> {
    let chain = camera_from_target(
        problem.mode,
        &view.base_from_tip,
        &fit.hand_eye.mount_from_camera(),
        &fit.hand_eye.anchor_from_target(),
    );
    view.corners
        .iter()
        .map(|corner| {
            let px = fit.intrinsics.project(&(chain.isometry() * problem.points[corner.index])).ok()?;
            Some((px - corner.px).norm_squared())
        })
        .sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector3;

    #[test]
    fn radius_of_one_two_and_three_equal_axes_is_the_chi_square_quantile() {
        // Square roots of the 95 % quantiles of chi-square with 1, 2 and 3 degrees of freedom.
        for (axes, expected) in [([1.0, 0.0, 0.0], 1.95996), ([1.0, 1.0, 0.0], 2.44775), ([1.0, 1.0, 1.0], 2.79548)] {
            let radius = radius_95(&Matrix3::from_diagonal(&Vector3::from(axes)));
            assert!((radius - expected).abs() < 2e-3, "{axes:?}: {radius}");
        }
    }

    #[test]
    fn radius_scales_with_the_error() {
        let c = Matrix3::new(4.0, 1.0, 0.0, 1.0, 2.0, 0.3, 0.0, 0.3, 1.0);
        assert!((radius_95(&(c * 1e-6)) - radius_95(&c) * 1e-3).abs() < 1e-9);
        assert_eq!(radius_95(&Matrix3::zeros()), 0.0);
    }

    #[test]
    fn a_rotation_error_moves_a_far_point_sideways() {
        let mut c = Matrix6::zeros();
        c[(3, 3)] = 1e-6;
        let moved = point_covariance(&c, &Point3::new(0.0, 0.0, 2.0));
        assert!((moved[(1, 1)] - 4e-6).abs() < 1e-15 && moved[(0, 0)] == 0.0 && moved[(2, 2)] == 0.0);
    }
}
