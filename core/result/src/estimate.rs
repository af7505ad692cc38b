//! Details of a joint estimate beyond the answer: its uncertainty and the reasons, the estimated target, the robot's
//! joints.

use nalgebra::{Matrix3, Vector2};
use serde::{Deserialize, Serialize};

use super::check::{Checked, all_finite, require};
use handeye_estimate::diagnose::record::FindingRecord;
use handeye_estimate::handeye::joint::{Noise, PoseDependentError, Slopes};
use handeye_estimate::uncertainty::overdispersion::Overdispersion;

/// Details of a joint estimate. Of a camera alone there are the target as found, and degrees of freedom and widening of the
/// standard deviations of its intrinsics.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct EstimateDetails {
    /// Expected error by the noise alone, 95 %, millimetres: as if the model were true whatever the findings are.
    #[serde(default)]
    pub modelled_error_95_mm: Option<f64>,
    /// Displacement, by the detected effects that are not in the model, of a point where the target was seen,
    /// millimetres; it is part of `quality.tip_error_95_mm`. `None` when no such effect was found.
    #[serde(default)]
    pub moved_mm: Option<f64>,
    /// Point at which the expected error is stated: camera coordinates, metres.
    pub reference_point_m: Option<[f64; 3]>,
    /// Degrees of freedom that the stated error of a point rests on, because the noise levels are estimated; `None` when they
    /// were given, and the errors are Gaussian.
    pub degrees_of_freedom: Option<f64>,
    /// The squared distance `eᵀ C⁻¹ e` of the hand-eye's error times this has the 95 % quantile of
    /// `6 F(6, degrees_of_freedom)`.
    pub region_scale: Option<f64>,
    /// Noise that all corners of a view share, pixels; zero where the data do not need it.
    pub view_sigma_px: Option<f64>,
    /// Factor by which the covariances were widened, because the data scatter more than the noise levels explain.
    pub widening: Option<OverdispersionRecord>,
    /// The target where it was found not to be the one drawn.
    pub board: Option<BoardEstimate>,
    /// The size of the target by the robot's motion, which the answer does not count on unless `board` has it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub target_size: Option<TargetSizeEstimate>,
    /// Errors of the robot that depend on where it is, where the data show them.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub robot_field: Option<PoseDependentErrorEstimate>,
    /// Displacements of the target's points from their drawing, where the data show them.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub print: Option<PrintEstimate>,
    /// The depths of the captures in the estimate, where enough were measured.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub depths: Option<DepthsEstimate>,
    /// The distortion that the lens model does not cover, where the data show it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub residual_distortion: Option<ResidualDistortionEstimate>,
}

/// A widened covariance.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct OverdispersionRecord {
    /// Factor by which standard deviations were widened, at least 1.
    pub factor: f64,
    /// The evidence for it, or the evidence that was checked without result.
    pub by: String,
    /// Additional factor for the standard deviations of an estimated lens, above 1, as far as the views disagree about it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub lens_factor: Option<f64>,
}

impl OverdispersionRecord {
    pub(crate) fn check(&self, at: &str) -> Checked {
        require(self.factor >= 1.0, format!("{at}.factor"), "must be at least 1")?;
        let of_lens = self.lens_factor.is_none_or(|factor| factor >= 1.0);
        require(of_lens, format!("{at}.lens_factor"), "must be at least 1")
    }
}

impl From<&Overdispersion> for OverdispersionRecord {
    fn from(widening: &Overdispersion) -> Self {
        Self {
            factor: widening.factor.sqrt(),
            by: widening.by.map_or_else(|| "none".to_owned(), |by| by.name().to_owned()),
            lens_factor: Some(widening.lens.sqrt()).filter(|factor| *factor > 1.0),
        }
    }
}

/// The size of the target by the robot's motion.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct TargetSizeEstimate {
    /// True size over stated size.
    pub true_over_stated: f64,
    /// Its standard deviation.
    pub sigma: f64,
    /// Whether a size error of 3 %, as prints and rulers have, would be detected.
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

/// The points of the target as printed: displaced from their places in the drawing, within its plane.
///
/// Point `k` in the order of the target's points is at `(x, y) + (x_mm[k], y_mm[k])` where it is drawn at `(x, y)`, along the
/// axes of the target. A shift or a rotation of all points together is not part of it.
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

/// The use of the captures' depths: the errors of the depth camera are in the result's `depth`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct DepthsEstimate {
    /// Captures with depths of the target.
    pub captures: usize,
    /// Noise of depths that all those of a capture have in common, one standard deviation, millimetres.
    pub noise_mm: f64,
    /// Whether the rotation of the depth camera relative to the lens is estimated, instead of assumed to be zero.
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
/// `position_slopes (p - origin_m)` in metres and the rotation vector `orientation_slopes_rad_per_m (p - origin_m)` in radians,
/// both in the axes of the tip; those in the axes of the base, with the reported rotation `R`, add `Rᵀ position_slopes_in_base (p -
/// origin_m)`, and accordingly for the rotation. Where `p` is farther from the origin than `reach_m` nothing is known, and `p -
/// origin_m` is shortened to that length.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct PoseDependentErrorEstimate {
    /// Point at which the field is zero, in the base, metres: the middle of the session's tip positions.
    pub origin_m: [f64; 3],
    /// Largest distance from there in the session, metres.
    pub reach_m: f64,
    /// Metres of error in the axes of the tip per metre, by rows.
    pub position_slopes: [[f64; 3]; 3],
    /// Radians of error in the axes of the tip per metre, by rows.
    pub orientation_slopes_rad_per_m: [[f64; 3]; 3],
    /// Metres of error in the axes of the base per metre, by rows; only with the errors of an arm.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub position_slopes_in_base: Option<[[f64; 3]; 3]>,
    /// Radians of error in the axes of the base per metre, by rows; only with the errors of an arm.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub orientation_slopes_in_base_rad_per_m: Option<[[f64; 3]; 3]>,
    /// Estimated standard deviation of the error of position per axis, at the RMS distance of the session's tip positions
    /// from the origin, millimetres.
    pub typical_mm: f64,
    /// The same for the error of orientation, degrees.
    pub typical_deg: f64,
    /// Error on held-out views with the correction applied, pixels; `quality.heldout_rms_px` is without it.
    pub heldout_rms_px: Option<f64>,
}

impl PoseDependentErrorEstimate {
    /// The record of a field at these noise levels.
    pub(super) fn new(field: &PoseDependentError, noise: &Noise, heldout_rms_px: Option<f64>) -> Self {
        let rows = |m: &Matrix3<f64>| [0, 1, 2].map(|i| [m[(i, 0)], m[(i, 1)], m[(i, 2)]]);
        let (in_tip, in_base) = (field.in_tip(), field.in_base());
        Self {
            origin_m: field.origin_m().into(),
            reach_m: field.reach_m(),
            position_slopes: rows(&in_tip.position),
            orientation_slopes_rad_per_m: rows(&in_tip.orientation),
            position_slopes_in_base: in_base.map(|slopes| rows(&slopes.position)),
            orientation_slopes_in_base_rad_per_m: in_base.map(|slopes| rows(&slopes.orientation)),
            typical_mm: noise.field_m * 1e3,
            typical_deg: noise.field_rad.to_degrees(),
            heldout_rms_px,
        }
    }

    /// The field, to correct reported poses by.
    pub fn field(&self) -> PoseDependentError {
        let matrix = |rows: &[[f64; 3]; 3]| Matrix3::from_fn(|i, j| rows[i][j]);
        let slopes = |position, orientation| Slopes { position: matrix(position), orientation: matrix(orientation) };
        let in_tip = slopes(&self.position_slopes, &self.orientation_slopes_rad_per_m);
        let in_base = self.position_slopes_in_base.as_ref().zip(self.orientation_slopes_in_base_rad_per_m.as_ref());
        let in_base = in_base.map(|(position, orientation)| slopes(position, orientation));
        PoseDependentError::new(self.origin_m.into(), self.reach_m, &in_tip, in_base.as_ref())
    }

    pub(super) fn check(&self, at: &str) -> Checked {
        let key = |key: &str| format!("{at}.{key}");
        all_finite(&self.origin_m, &key("origin_m"))?;
        require(self.reach_m > 0.0, key("reach_m"), "must be a positive length")?;
        all_finite(self.position_slopes.as_flattened(), &key("position_slopes"))?;
        all_finite(self.orientation_slopes_rad_per_m.as_flattened(), &key("orientation_slopes_rad_per_m"))?;
        let (position, orientation) = (self.position_slopes_in_base, self.orientation_slopes_in_base_rad_per_m);
        let both = position.is_some() == orientation.is_some();
        require(both, key("position_slopes_in_base"), "must be there where orientation_slopes_in_base_rad_per_m is")?;
        let in_base = position.into_iter().chain(orientation).flatten().flatten();
        all_finite(&in_base.collect::<Vec<f64>>(), &key("position_slopes_in_base"))
    }
}

/// The distortion that the lens model does not cover, as an optional correction of image points.
///
/// A point that is measured at pixel `(u, v)` lies at `(u, v) - f(u, v)` by the lens model. Along x `f = sum of x_px[k] P_i(a)
/// P_j(b)`, along y with `y_px[k]`, over all `i + j` up to `degree`, in rising `i + j` and then rising `i`; `a = (u + 1/2) /
/// (width / 2) - 1` and `b = (v + 1/2) / (height / 2) - 1`, kept from -1 to 1, and `P_n` is `sqrt(2 n + 1)` times Legendre's
/// polynomial.
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

/// The findings of the document.
pub type Findings = Vec<FindingRecord>;
