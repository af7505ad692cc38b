//! Whether errors of prediction are of the size that a calibration states.
//!
//! The pose error of a capture, `e_i = log(predicted⁻¹ * seen)`, is to first order
//! `e_i = −G_i s − D_i d_i + n_i`: `s` the error of everything that the captures share (both links and whatever of lens,
//! target, the robot's field and the errors of its arm is free, covariance `C`), `d_i` the robot's noise and `n_i` the effect of
//! corner noise on PnP, with `J` and the pose as seen weighted by the stated covariance of each corner, as in the fit. With
//! `B_i = D_i Σ_robot D_iᵀ + (corner_px² + view_px²) (JᵀJ)⁻¹` all errors together have the covariance `diag(B_i) + G C Gᵀ`, and
//! `χ² = eᵀ (diag(B) + G C Gᵀ)⁻¹ e` has `6 n` degrees of freedom: its expectation is `6 n` and its standard deviation `√(12 n)`.
//! The inverse is by the matrix inversion lemma, so the cost is linear in the number of captures.
//!
//! The noise levels are taken as known. From a dozen views they are known to a fifth, and the ratio as badly. They are at least
//! what robots and cameras resolve ([`resolution`]): a simulated cell may be exact, and thousandths of a millimetre are not a
//! failure.

use nalgebra::{Cholesky, DMatrix, DVector, Matrix6, Vector6};

use super::{CaptureCheck, Predictor, Uncertainty};
use crate::handeye::joint::ArmErrors;
use crate::handeye::joint::chain::Chain;
use crate::resolution;
use handeye_geometry::se3;
use handeye_geometry::targets::bent::BoardPoints;
use handeye_geometry::targets::observation::View;
use handeye_geometry::view_equations::{FreeParameters, PoseEquations};

/// Quantile of the normal distribution at 99 %.
const Z_99: f64 = 2.326;

/// Unknowns of the two links.
const LINKS: usize = 12;

/// Errors of prediction against the stated uncertainty.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Consistency {
    /// χ² per degree of freedom; its expectation is 1.
    pub ratio: f64,
    /// Number of degrees of freedom, six for every capture.
    pub degrees_of_freedom: usize,
    /// Limit that the ratio stays below in 99 of 100 cases when the stated uncertainty is true.
    pub limit: f64,
}

impl Consistency {
    /// Whether the errors are no larger than stated. Errors that are smaller count as consistent.
    pub fn is_consistent(&self) -> bool {
        self.ratio <= self.limit
    }
}

/// 99 % quantile of chi-square over its degrees of freedom (Wilson & Hilferty 1931; within 1 % from six on).
fn limit(degrees_of_freedom: usize) -> f64 {
    let spread = 2.0 / (9.0 * degrees_of_freedom as f64);
    (1.0 - spread + Z_99 * spread.sqrt()).powi(3)
}

/// The sums over captures.
pub struct Sums {
    /// `L` with `C = L Lᵀ`: in `s = L u` the prior of `u` is the identity, whatever the units.
    root: DMatrix<f64>,
    covariance: DMatrix<f64>,
    form: FreeParameters,
    robot_variance: Vector6<f64>,
    corner_variance: f64,
    captures: usize,
    plain: f64,
    gradient: DVector<f64>,
    information: DMatrix<f64>,
}

impl Sums {
    /// `None` when the covariance is not valid, or not that of the unknowns of this calibration.
    pub fn new(calibrated: &Predictor, uncertainty: &Uncertainty) -> Option<Self> {
        let form = uncertainty.free.form();
        let slopes = calibrated.field.as_ref().map_or(0, |field| field.slopes().len());
        let of_arm = calibrated.arm.as_ref().map_or(0, ArmErrors::number_count);
        let n = LINKS + form.count(&calibrated.intrinsics) + slopes + of_arm;
        if uncertainty.covariance.shape() != (n, n) {
            return None;
        }
        let judged_by = resolution::judged_by(&uncertainty.noise);
        let (m, rad) = (judged_by.robot_m.powi(2), judged_by.robot_rad.powi(2));
        Some(Self {
            root: Cholesky::new(uncertainty.covariance.clone())?.l(),
            covariance: uncertainty.covariance.clone(),
            form,
            robot_variance: Vector6::new(m, m, m, rad, rad, rad),
            corner_variance: uncertainty.noise.corner_px.powi(2) + uncertainty.noise.view_px.powi(2),
            captures: 0,
            plain: 0.0,
            gradient: DVector::zeros(n),
            information: DMatrix::identity(n, n),
        })
    }

    /// Adds a capture and returns its own ratio; `None`, and nothing added, when its corners do not determine a pose.
    pub fn add(
        &mut self,
        calibrated: &Predictor,
        board: &BoardPoints,
        view: &View,
        check: &CaptureCheck,
    ) -> Option<f64> {
        let chain = Chain::with_arm(
            calibrated.hand_eye.mode(),
            view,
            calibrated.arm.as_ref(),
            &calibrated.field.as_ref().map_or_else(Vector6::zeros, |field| field.correction(&view.base_from_tip)),
            &calibrated.hand_eye.mount_from_camera(),
            &calibrated.hand_eye.anchor_from_target(),
        );
        let seen = check.seen_camera_from_target.isometry();
        let whitener = calibrated.whitener(&view.corners);
        let seen_through = calibrated.view_input(board, (&view.corners, view.depth.as_ref()), &whitener);
        let equations = PoseEquations::new(&seen_through, seen, self.form).ok()?;
        let pose_covariance = Cholesky::new(equations.pose)?.inverse();
        let by_form = pose_covariance * equations.pose_by_form;
        let form = self.form.count(&calibrated.intrinsics);
        let mut by_shared = DMatrix::zeros(6, self.covariance.nrows());
        by_shared.fixed_view_mut::<6, 6>(0, 0).copy_from(&chain.by_hand_eye);
        by_shared.fixed_view_mut::<6, 6>(0, 6).copy_from(&Matrix6::identity());
        by_shared.columns_mut(LINKS, form).copy_from(&by_form);
        if let Some(field) = &calibrated.field {
            let columns = field.columns(&view.base_from_tip, &chain.by_correction);
            by_shared.columns_mut(LINKS + form, columns.ncols()).copy_from(&columns);
        }
        let of_arm = chain.by_arm.ncols();
        by_shared.columns_mut(self.covariance.nrows() - of_arm, of_arm).copy_from(&chain.by_arm);
        let own = chain.by_correction * Matrix6::from_diagonal(&self.robot_variance) * chain.by_correction.transpose()
            + pose_covariance * resolution::pose_variance_px2(self.corner_variance, view.corners.len());
        let error = se3::log((check.predicted_camera_from_target.inverse() * check.seen_camera_from_target).isometry());

        let both = own + &by_shared * &self.covariance * by_shared.transpose();
        let ratio = error.dot(&Cholesky::new(both)?.solve(&error)) / 6.0;
        let own = Cholesky::new(own)?;
        let by_root = by_shared * &self.root;
        let weighted_error = own.solve(&error);
        self.plain += error.dot(&weighted_error);
        self.gradient += by_root.transpose() * weighted_error;
        self.information += by_root.transpose() * own.solve(&by_root);
        self.captures += 1;
        ratio.is_finite().then_some(ratio)
    }

    /// The verdict; `None` without captures.
    pub fn finish(self) -> Option<Consistency> {
        let degrees_of_freedom = 6 * self.captures;
        let shared = Cholesky::new(self.information)?.solve(&self.gradient).dot(&self.gradient);
        let ratio = (self.plain - shared) / degrees_of_freedom as f64;
        (self.captures > 0 && ratio.is_finite()).then(|| Consistency {
            ratio,
            degrees_of_freedom,
            limit: limit(degrees_of_freedom),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::limit;

    #[test]
    fn the_limit_is_the_published_quantile() {
        // 99 % quantiles of chi-square: 16.812 at 6, 88.379 at 60 degrees of freedom.
        assert!((limit(6) * 6.0 - 16.812).abs() < 0.1, "{}", limit(6) * 6.0);
        assert!((limit(60) * 60.0 - 88.379).abs() < 0.1, "{}", limit(60) * 60.0);
    }
}
