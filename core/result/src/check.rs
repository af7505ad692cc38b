//! What the types of a result do not ensure: finite, unit length, the frames of the mode.

use super::{
    BoardEstimate, CalibrationResult, EstimateDetails, FORMAT, IntrinsicsEstimate, MethodStatus, PrintEstimate,
    ResidualDistortionEstimate, TransformEstimate, VERSION,
};
use handeye_estimate::handeye::Mode;
use handeye_geometry::camera::residual_distortion::{MOST_DEGREES, functions};

/// Largest deviation of a quaternion's length from 1: far above rounding, far below the nine digits that other programs
/// print.
const UNIT_TOLERANCE: f64 = 1e-6;
/// Largest relative asymmetry of a covariance: rounding of a product of matrices.
const SYMMETRY_TOLERANCE: f64 = 1e-6;

/// A value that a result must not have.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error, handeye_wording::Localized)]
#[error("{at} {problem}")]
#[non_exhaustive]
pub struct BadResult {
    /// The value, as a path of keys.
    pub at: String,
    /// What is wrong with it.
    pub problem: &'static str,
}

pub(super) type Checked = Result<(), BadResult>;

pub(super) fn require(holds: bool, at: impl Into<String>, problem: &'static str) -> Checked {
    if holds { Ok(()) } else { Err(BadResult { at: at.into(), problem }) }
}

pub(super) fn all_finite(values: &[f64], at: &str) -> Checked {
    require(values.iter().all(|v| v.is_finite()), at, "is not finite")
}

pub(super) fn not_negative(value: Option<f64>, at: &str) -> Checked {
    require(value.is_none_or(|v| v.is_finite() && v >= 0.0), at, "must be finite and not negative, or null")
}

fn unit_quaternion(xyzw: &[f64; 4], at: &str) -> Checked {
    all_finite(xyzw, at)?;
    let length = xyzw.iter().map(|v| v * v).sum::<f64>().sqrt();
    require((length - 1.0).abs() <= UNIT_TOLERANCE, at, "is not a unit quaternion")
}

impl CalibrationResult {
    /// Checks what the types do not ensure.
    ///
    /// # Errors
    /// [`BadResult`] names the first value that must not be.
    pub fn check(&self) -> Result<(), BadResult> {
        require(self.format == FORMAT, "format", "is not handeye-calibration")?;
        require(self.version == VERSION, "version", "is not the one that is written here")?;
        self.check_links()?;
        if let Some(intrinsics) = &self.intrinsics {
            intrinsics.check("intrinsics")?;
        }
        if let Some(arm) = &self.arm {
            arm.check()?;
        }
        self.check_quality()?;
        self.check_methods()?;
        for (i, view) in self.views.iter().enumerate() {
            not_negative(view.rms_px, &format!("views[{i}].rms_px"))?;
            not_negative(view.influence_mm, &format!("views[{i}].influence_mm"))?;
            not_negative(view.distance, &format!("views[{i}].distance"))?;
        }
        self.estimate.as_ref().map_or(Ok(()), check_estimate)
    }

    fn check_links(&self) -> Checked {
        let needs_mode = self.hand_eye.is_some() || self.target.is_some();
        require(!needs_mode || self.mode.is_some(), "mode", "is null, but there is a hand_eye or a target")?;
        let (mount, anchor) = match self.mode {
            Some(Mode::EyeInHand) => ("tip", "base"),
            Some(Mode::EyeToHand) => ("base", "tip"),
            None => return Ok(()),
        };
        if let Some(hand_eye) = &self.hand_eye {
            hand_eye.check("hand_eye", mount, "camera")?;
        }
        self.target.as_ref().map_or(Ok(()), |target| target.check("target", anchor, "target"))
    }

    fn check_quality(&self) -> Checked {
        let q = &self.quality;
        let mut numbers = vec![
            ("quality.rms_px", q.rms_px),
            ("quality.sigma_px", q.sigma_px),
            ("quality.heldout_rms_px", q.heldout_rms_px),
            ("quality.tip_error_95_mm", q.tip_error_95_mm),
            ("quality.reach_error_95_mm", q.reach_error_95_mm),
            ("quality.reach_error_corrected_95_mm", q.reach_error_corrected_95_mm),
            ("quality.robot_accuracy_mm", q.robot_accuracy_mm),
            ("quality.robot_sigma_mm", q.robot_sigma_mm),
            ("quality.robot_sigma_deg", q.robot_sigma_deg),
        ];
        if let Some(verification) = &self.verification {
            numbers.push(("verification.rms_px", Some(verification.rms_px)));
            numbers.push(("verification.centre_rms_mm", Some(verification.centre_rms_mm)));
            numbers.push(("verification.orientation_rms_deg", Some(verification.orientation_rms_deg)));
            if let Some(corrected) = &verification.corrected {
                numbers.push(("verification.corrected.rms_px", Some(corrected.rms_px)));
                numbers.push(("verification.corrected.centre_rms_mm", Some(corrected.centre_rms_mm)));
                numbers.push(("verification.corrected.orientation_rms_deg", Some(corrected.orientation_rms_deg)));
            }
        }
        if let Some(depth) = &self.depth {
            numbers.push(("depth.fill", Some(depth.fill)));
            numbers.push(("depth.ratio", Some(depth.ratio)));
            if let Some(errors) = &depth.errors {
                numbers.push(("depth.errors.offset_sigma_mm", Some(errors.offset_sigma_mm)));
                numbers.push(("depth.errors.at_mm", Some(errors.at_mm)));
                numbers.push(("depth.errors.scale_sigma", errors.scale_sigma));
                numbers.push(("depth.errors.slope_sigma_px", errors.slope_sigma_px));
                numbers.push(("depth.errors.noise_mm", Some(errors.noise_mm)));
                numbers.push(("depth.errors.between_mm", Some(errors.between_mm)));
                all_finite(&errors.tilt_deg, "depth.errors.tilt_deg")?;
                all_finite(&errors.tilt_sigma_deg, "depth.errors.tilt_sigma_deg")?;
                let others = [Some(errors.offset_mm), errors.scale, errors.slope_px];
                all_finite(&others.map(|value| value.unwrap_or(0.0)), "depth.errors")?;
            }
        }
        if let Some(truth) = &self.truth {
            numbers.push(("truth.translation_error_mm", truth.translation_error_mm));
            numbers.push(("truth.rotation_error_deg", truth.rotation_error_deg));
            let focal = truth.focal_error_percent;
            require(focal.is_none_or(f64::is_finite), "truth.focal_error_percent", "is not finite")?;
        }
        numbers.into_iter().try_for_each(|(at, value)| not_negative(value, at))
    }

    fn check_methods(&self) -> Checked {
        for (i, method) in self.methods.iter().enumerate() {
            let at = |key| format!("methods[{i}].{key}");
            let solved = method.status == MethodStatus::Ok;
            let as_stated = method.translation_m.is_some() == solved && method.rotation_xyzw.is_some() == solved;
            require(
                as_stated,
                at("status"),
                "must be ok where there is a transform, and the reason where there is none",
            )?;
            method.translation_m.map_or(Ok(()), |t| all_finite(&t, &at("translation_m")))?;
            method.rotation_xyzw.map_or(Ok(()), |q| unit_quaternion(&q, &at("rotation_xyzw")))?;
        }
        Ok(())
    }
}

fn check_estimate(estimate: &EstimateDetails) -> Checked {
    not_negative(estimate.modelled_error_95_mm, "estimate.modelled_error_95_mm")?;
    not_negative(estimate.moved_mm, "estimate.moved_mm")?;
    not_negative(estimate.degrees_of_freedom, "estimate.degrees_of_freedom")?;
    not_negative(estimate.region_scale, "estimate.region_scale")?;
    not_negative(estimate.view_sigma_px, "estimate.view_sigma_px")?;
    estimate.reference_point_m.map_or(Ok(()), |p| all_finite(&p, "estimate.reference_point_m"))?;
    estimate.widening.as_ref().map_or(Ok(()), |widening| widening.check("estimate.widening"))?;
    if let Some(board) = &estimate.board {
        board.check("estimate.board")?;
    }
    if let Some(size) = &estimate.target_size {
        require(size.true_over_stated > 0.0, "estimate.target_size.true_over_stated", "must be positive")?;
        not_negative(Some(size.sigma), "estimate.target_size.sigma")?;
    }
    if let Some(field) = &estimate.robot_field {
        field.check("estimate.robot_field")?;
    }
    if let Some(print) = &estimate.print {
        let PrintEstimate { rms_mm, x_mm, y_mm, sigma_mm } = print;
        not_negative(Some(*rms_mm), "estimate.print.rms_mm")?;
        for (mm, key) in
            [(x_mm, "estimate.print.x_mm"), (y_mm, "estimate.print.y_mm"), (sigma_mm, "estimate.print.sigma_mm")]
        {
            all_finite(mm, key)?;
            require(mm.len() == x_mm.len(), key, "must have a number for each point of the target")?;
        }
    }
    if let Some(depths) = &estimate.depths {
        not_negative(Some(depths.noise_mm), "estimate.depths.noise_mm")?;
        let probability = depths.other_probability;
        require((0.0..=1.0).contains(&probability), "estimate.depths.other_probability", "must be a probability")?;
    }
    if let Some(distortion) = &estimate.residual_distortion {
        let ResidualDistortionEstimate { degree, x_px, y_px, .. } = distortion;
        require(*degree <= MOST_DEGREES, "estimate.residual_distortion.degree", "is more than any image shows")?;
        for (px, key) in [(x_px, "estimate.residual_distortion.x_px"), (y_px, "estimate.residual_distortion.y_px")] {
            all_finite(px, key)?;
            require(px.len() == functions(*degree), key, "must have a coefficient for each polynomial of the degree")?;
        }
    }
    Ok(())
}

impl TransformEstimate {
    fn check(&self, key: &str, parent: &str, child: &str) -> Checked {
        let at = |field| format!("{key}.{field}");
        require(self.parent_frame == parent, at("parent_frame"), "is not the frame that the mode says")?;
        require(self.child_frame == child, at("child_frame"), "is not the frame that the mode says")?;
        all_finite(&self.translation_m, &at("translation_m"))?;
        unit_quaternion(&self.rotation_xyzw, &at("rotation_xyzw"))?;
        let Some(c) = &self.covariance else { return Ok(()) };
        all_finite(c.as_flattened(), &at("covariance"))?;
        for i in 0..6 {
            require(c[i][i] >= 0.0, at("covariance"), "has a negative variance")?;
            for j in 0..i {
                let scale = (c[i][i] * c[j][j]).sqrt();
                let is_symmetric = (c[i][j] - c[j][i]).abs() <= SYMMETRY_TOLERANCE * scale;
                require(is_symmetric, at("covariance"), "is not symmetric")?;
            }
        }
        Ok(())
    }
}

impl BoardEstimate {
    pub(super) fn check(&self, at: &str) -> Checked {
        all_finite(&self.warp_mm, &format!("{at}.warp_mm"))?;
        require(self.scale > 0.0, format!("{at}.scale"), "must be positive")?;
        not_negative(self.scale_sigma, &format!("{at}.scale_sigma"))
    }
}

impl IntrinsicsEstimate {
    pub(super) fn check(&self, at: &str) -> Checked {
        let intrinsics = self.intrinsics().ok_or_else(|| BadResult {
            at: format!("{at}.model"),
            problem: "is not none (0 coefficients), brown_conrady (5), rational (8) or fisheye (4)",
        })?;
        let problem = "must be finite numbers, sizes and focal lengths positive";
        require(intrinsics.validate().is_ok(), at, problem)?;
        let sigma = &self.sigma;
        let at = format!("{at}.sigma");
        [sigma.fx, sigma.fy, sigma.cx, sigma.cy].into_iter().try_for_each(|s| not_negative(s, &at))
    }
}
