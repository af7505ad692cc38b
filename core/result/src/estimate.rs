//! What a joint estimate says beyond the answer: how sure it is and why, the target as it found it, the robot's joints.

use nalgebra::{Matrix3, Vector2};
use serde::{Deserialize, Serialize};

use handeye_estimate::diagnose::record::FindingRecord;
use handeye_estimate::handeye::joint::PoseDependentError;

/// Details of a joint estimate. Of a camera alone there are the target as found, and degrees of freedom and widening of the
/// standard deviations of its intrinsics.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct EstimateDetails {
    /// Expected error by the noise alone, 95 %, millimetres: as if the model were true whatever the findings say.
    #[serde(default)]
    pub modelled_error_95_mm: Option<f64>,
    /// How far what was found and is not in the model would move a point where the target was seen, millimetres; it is
    /// part of `quality.tip_error_95_mm`. `None` when nothing of the kind was found.
    #[serde(default)]
    pub moved_mm: Option<f64>,
    /// Where the expected error is stated: camera coordinates, metres.
    pub reference_point_m: Option<[f64; 3]>,
    /// Degrees of freedom that the stated error of a point rests on, because the noise levels are estimated; `None` when they
    /// were given, and the errors are Gaussian.
    pub degrees_of_freedom: Option<f64>,
    /// The squared distance `eᵀ C⁻¹ e` of the hand-eye's error times this has the 95 % quantile of
    /// `6 F(6, degrees_of_freedom)`.
    pub region_scale: Option<f64>,
    /// Noise that all corners of a view share, pixels; zero where the data ask for none.
    pub view_sigma_px: Option<f64>,
    /// By how much the covariances were widened, because the data scatter more than the noise levels say.
    pub widening: Option<OverdispersionRecord>,
    /// The target where it was found not to be the one drawn.
    pub board: Option<BoardEstimate>,
    /// The size of the target by the robot's motion, which the answer does not count on unless `board` has it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub target_size: Option<TargetSizeEstimate>,
    /// Errors of the robot that depend on where it stands, where the data show them.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub robot_field: Option<PoseDependentErrorEstimate>,
    /// What the points of the target are off their drawing, where the data show it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub print: Option<PrintEstimate>,
    /// The depths of the captures in the estimate, where enough were measured.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub depths: Option<DepthsEstimate>,
    /// What the lens does beyond its model, where the data show it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub residual_distortion: Option<ResidualDistortionEstimate>,
}

/// A widened covariance.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct OverdispersionRecord {
    /// By how much standard deviations were widened, at least 1.
    pub factor: f64,
    /// Which evidence asked for it, or which was looked at in vain.
    pub by: String,
    /// By how much standard deviations of an estimated lens were widened besides, above 1, because the views disagree about it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub lens_factor: Option<f64>,
}

/// The size of the target by the robot's motion.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct TargetSizeEstimate {
    /// True size over stated size.
    pub true_over_stated: f64,
    /// Its standard deviation.
    pub sigma: f64,
    /// Whether a size that is off by 3 %, as prints and rulers are, would be found.
    pub determined: bool,
}

/// The target as found.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct BoardEstimate {
    /// Deflection of the middle against the edges along x and y, millimetres, positive into the board.
    pub warp_mm: [f64; 2],
    /// Their standard deviations; `None` when the target is taken as flat.
    pub warp_sigma_mm: Option<[f64; 2]>,
    /// True size over stated size.
    pub scale: f64,
    /// Its standard deviation; `None` when the stated size is taken as exact.
    pub scale_sigma: Option<f64>,
}

/// Where the points of the target are: printed off their places in the drawing, within its plane.
///
/// Point `k` in the order of the target's points is at `(x, y) + (x_mm[k], y_mm[k])` where it is drawn at `(x, y)`, along the
/// axes of the target. A shift or a turn of all points together is none of it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct PrintEstimate {
    /// RMS of all errors per axis, millimetres.
    pub rms_mm: f64,
    /// Errors along x, millimetres.
    pub x_mm: Vec<f64>,
    /// Along y, millimetres.
    pub y_mm: Vec<f64>,
    /// Standard deviation of both of a point, millimetres.
    pub sigma_mm: Vec<f64>,
}

impl PrintEstimate {
    /// The errors of all points, metres.
    pub fn errors_m(&self) -> Vec<Vector2<f64>> {
        self.x_mm.iter().zip(&self.y_mm).map(|(x, y)| Vector2::new(*x, *y) * 1e-3).collect()
    }
}

/// What was tried with the depths of the captures: the errors of the depth camera are in the result's `depth`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct DepthsEstimate {
    /// Captures with depths of the target.
    pub captures: usize,
    /// Noise of depths that all those of a capture have in common, one standard deviation, millimetres.
    pub noise_mm: f64,
    /// Whether the answer leaves it open how far the depth camera is turned against the lens, and does not take it for straight.
    pub turned: bool,
    /// Probability that it is the other way.
    pub other_probability: f64,
    /// Error on held-out views without the depths, pixels.
    pub heldout_before_px: f64,
    /// And with them, pixels.
    pub heldout_after_px: f64,
    /// Whether the answer uses them.
    pub accepted: bool,
}

/// Errors of the robot as an affine function of where its tip is: an optional correction of reported poses.
///
/// With `p` the reported tip position in the base, the true tip pose is `base_from_tip * E`: `E` has the translation
/// `position_slopes (p - origin_m)` in metres and the rotation vector `orientation_slopes_rad_per_m (p - origin_m)` in
/// radians, both in the axes of the tip. Where `p` is farther from the origin than `reach_m` nothing is known, and
/// `p - origin_m` is shortened to that length.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct PoseDependentErrorEstimate {
    /// Where the field is zero, in the base, metres: the middle of the session's tip positions.
    pub origin_m: [f64; 3],
    /// How far from there the session went, metres.
    pub reach_m: f64,
    /// Metres of error per metre, by rows.
    pub position_slopes: [[f64; 3]; 3],
    /// Radians of error per metre, by rows.
    pub orientation_slopes_rad_per_m: [[f64; 3]; 3],
    /// Estimated standard deviation of the error of position per axis, at the RMS distance of the session's tip positions
    /// from the origin, millimetres.
    pub typical_mm: f64,
    /// Of the error of orientation likewise, degrees.
    pub typical_deg: f64,
    /// Error on held-out views with the correction applied, pixels; `quality.heldout_rms_px` is without it.
    pub heldout_rms_px: Option<f64>,
}

impl PoseDependentErrorEstimate {
    /// The field, to correct reported poses by.
    pub fn field(&self) -> PoseDependentError {
        let matrix = |rows: &[[f64; 3]; 3]| Matrix3::from_fn(|i, j| rows[i][j]);
        let (position, orientation) = (matrix(&self.position_slopes), matrix(&self.orientation_slopes_rad_per_m));
        PoseDependentError::new(self.origin_m.into(), self.reach_m, &position, &orientation)
    }
}

/// What the lens does beyond its model, as an optional correction of image points.
///
/// A point that is measured at pixel `(u, v)` lies at `(u, v) - f(u, v)` by the lens model. Along x
/// `f = sum of x_px[k] P_i(a) P_j(b)`, along y likewise, over all `i + j` up to `degree`, in rising `i + j` and then rising `i`;
/// `a = (u + 1/2) / (width / 2) - 1` and `b = (v + 1/2) / (height / 2) - 1`, kept from -1 to 1, and `P_n` is `sqrt(2 n + 1)` times
/// Legendre's polynomial.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ResidualDistortionEstimate {
    /// Highest total degree of the polynomials.
    pub degree: usize,
    /// Coefficients of the displacement along x, pixels.
    pub x_px: Vec<f64>,
    /// Along y.
    pub y_px: Vec<f64>,
    /// RMS of the displacement over the corners of the fit, both axes together, pixels.
    pub rms_px: f64,
}

/// Findings as they stand in the document.
pub type Findings = Vec<FindingRecord>;
