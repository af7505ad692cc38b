//! A depth camera against the calibrated lens: the error of its depths of the board.
//!
//! The place of the board in a capture is that by the calibration, from robot and corners together
//! ([`ViewResult::camera_from_target`](crate::ViewResult::camera_from_target)). A plane is fitted to the errors of the depths
//! all over it: its height `d` in the middle of the board, its two slopes, and the scatter about it. The heights of all
//! captures determine
//!
//! ```text
//! d = offset + scale (z − z̄) + slope g
//! ```
//!
//! with `z` the distance of the board along the optical axis, `z̄` the mean of that, and `g` by how much the depth of the board
//! changes from one pixel to the next ([`DepthBias`](crate::DepthBias)): what a renderer's polygon offset, or a matcher
//! that prefers the nearer or the farther pixel, adds. Captures scatter about that by more than their depths do (neighbours have
//! the same error), so the uncertainty follows from the scatter of the captures, by ordinary least squares. An error of the focal
//! length displaces the board by the same part; its uncertainty is added. A target of another size than stated does the same, and
//! cannot be detected here.

use nalgebra::{DMatrix, DVector, Isometry3, Point3, Vector5};
use statrs::distribution::{ContinuousCDF as _, StudentsT};

use crate::DepthsInFit;
use handeye_geometry::camera::Intrinsics;
use handeye_geometry::statistics::median_high;
use handeye_geometry::targets::TargetSpec;
use handeye_geometry::targets::bent::BoardShape;
use handeye_geometry::targets::depth_plane::{self, DepthPlane};
use handeye_geometry::view_equations::{DepthBias, PredictedDepths};

/// Captures that separate an offset from a scale and the slope's part, with three more for the scatter.
const FOR_SCALE: usize = 6;
/// Probability that an error is reported where there is none.
const FALSE_ALARM: f64 = 1e-3;

/// A number with its standard deviation.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Estimated {
    /// The estimate.
    pub value: f64,
    /// One standard deviation.
    pub sigma: f64,
}

/// The errors of a depth camera by the depths of many captures.
#[derive(Debug, Clone, PartialEq)]
pub struct DepthReport {
    /// Captures with depths of the board.
    pub captures: usize,
    /// Part of the pixels of the board that have a depth.
    pub fill: f64,
    /// Measured over expected depth, median.
    pub ratio: f64,
    /// Errors of depths that are of the right order of magnitude; `None` where they are not ([`Self::is_gross`]), and for a
    /// single capture.
    pub errors: Option<DepthErrors>,
}

/// Errors of depths.
#[derive(Debug, Clone, PartialEq)]
pub struct DepthErrors {
    /// Measured minus expected depth where the board is [`Self::at_m`] away and seen straight, metres.
    pub offset_m: Estimated,
    /// Mean distance of the board, metres.
    pub at_m: f64,
    /// Relative growth of the depth over the distance: 0.001 is 1 mm in a metre. `None` for less than six captures.
    pub scale: Option<Estimated>,
    /// What is added to the depth of a slanted surface, in pixels' worth of its slope. `None` in the same case.
    pub slope_px: Option<Estimated>,
    /// Rotation of the plane by depth against the board about the camera's x and y, radians.
    pub tilt_rad: [Estimated; 2],
    /// Scatter of single depths about the plane of a capture, metres.
    pub noise_m: f64,
    /// Scatter of the captures about offset, scale and slope, metres.
    pub between_m: f64,
    /// Degrees of freedom of that scatter.
    pub degrees_of_freedom: usize,
}

impl DepthReport {
    /// Whether the depths are not of the right order of magnitude.
    pub fn is_gross(&self) -> bool {
        !depth_plane::are_of_right_size(self.ratio)
    }
}

impl DepthErrors {
    /// Whether a number is not due to chance: a false alarm in one of a thousand depth cameras.
    pub(crate) fn is_certain(&self, of: Estimated) -> bool {
        let law = StudentsT::new(0.0, 1.0, self.degrees_of_freedom.max(1) as f64);
        law.is_ok_and(|law| of.value.abs() > of.sigma * law.inverse_cdf(1.0 - 0.5 * FALSE_ALARM))
    }
}

/// Gathers the depths of captures, one at a time.
pub struct DepthCheck<'a> {
    lens: &'a Intrinsics,
    shape: &'a BoardShape,
    middle: Point3<f64>,
    fills: Vec<f64>,
    ratios: Vec<f64>,
    planes: Vec<Plane>,
}

/// The depths of one capture.
struct Plane {
    away_m: f64,
    /// Change of the depth of the board from pixel to pixel, metres.
    slope_m: f64,
    off_m: f64,
    tilt_rad: [f64; 2],
    variance_m2: f64,
}

impl<'a> DepthCheck<'a> {
    /// A check with a lens and the target that the captures show.
    pub fn new(lens: &'a Intrinsics, target: &TargetSpec, shape: &'a BoardShape) -> Self {
        Self { lens, shape, middle: target.centre(), fills: Vec::new(), ratios: Vec::new(), planes: Vec::new() }
    }

    /// Adds the depths of a capture with the board at this pose.
    pub fn add(&mut self, measured: &DepthPlane, camera_from_target: &Isometry3<f64>) {
        let expected = PredictedDepths::new(self.lens, self.shape, measured, &DepthBias::default(), camera_from_target);
        self.fills.push(measured.fill);
        self.ratios.push(measured.depth.x / expected.depth.x);
        let off = DepthPlane { depth: measured.depth - expected.depth, ..*measured };
        // Along the board's x and y; the camera's x and y change with these by the direction of its axes.
        let rotation = camera_from_target.rotation.to_rotation_matrix().into_inner();
        let axes = rotation.fixed_view::<2, 2>(0, 0).transpose();
        let Some(by_camera) = axes.try_inverse().map(|inverse| inverse * off.depth.yz()) else { return };
        let away_m = (camera_from_target * self.middle).z;
        self.planes.push(Plane {
            away_m,
            slope_m: expected.by_bias[2].x,
            off_m: off.depth_at(&self.middle),
            // A turn about x moves what is at positive y away, one about y brings what is at positive x nearer.
            tilt_rad: [by_camera.y, -by_camera.x],
            variance_m2: measured.scatter_m.powi(2),
        });
    }

    /// The result of all of them, with the standard deviation of the focal length \[px\]; `None` without a capture that shows
    /// depths of the board. Where a joint estimate was tried with the depths (`in_fit`), the result is the errors in that estimate:
    /// its covariance includes the uncertainty of lens and camera, and the captures of an answer that uses depths agree with them.
    pub fn finish(self, sigma_focal_px: f64, in_fit: Option<&DepthsInFit>) -> Option<DepthReport> {
        let ratio = median_high(self.ratios.iter().copied())?;
        let fill = self.fills.iter().sum::<f64>() / self.fills.len() as f64;
        let report = DepthReport { captures: self.fills.len(), fill, ratio, errors: None };
        if report.is_gross() {
            return Some(report);
        }
        let of_focal = sigma_focal_px * 2.0 / (self.lens.fx + self.lens.fy);
        let errors = match in_fit.filter(|_| !self.planes.is_empty()) {
            Some(depths) => estimated_with(depths, &self.planes),
            None => errors(&self.planes, of_focal),
        };
        Some(DepthReport { errors, ..report })
    }
}

/// Errors of the depths in a joint estimate.
fn estimated_with(depths: &DepthsInFit, planes: &[Plane]) -> Option<DepthErrors> {
    let count = planes.len();
    let mean = |value: &dyn Fn(&Plane) -> f64| planes.iter().map(value).sum::<f64>() / count as f64;
    let at_m = mean(&|plane| plane.away_m);
    let values = Vector5::from(depths.bias.values());
    let along = |row: Vector5<f64>| Estimated {
        value: row.dot(&values),
        sigma: row.dot(&(depths.covariance * row)).max(0.0).sqrt(),
    };
    let of = |k: usize| along(Vector5::ith(k, 1.0));
    Some(DepthErrors {
        offset_m: along(Vector5::new(1.0, at_m, 0.0, 0.0, 0.0)),
        at_m,
        scale: Some(of(1)),
        slope_px: Some(of(2)),
        tilt_rad: [of(3), of(4)],
        noise_m: mean(&|plane| plane.variance_m2).sqrt(),
        between_m: depths.noise_m,
        degrees_of_freedom: (3 * depths.views).checked_sub(DepthBias::COUNT)?,
    })
}

fn errors(planes: &[Plane], of_focal: f64) -> Option<DepthErrors> {
    let count = planes.len();
    let mean = |value: &dyn Fn(&Plane) -> f64| planes.iter().map(value).sum::<f64>() / count.max(1) as f64;
    let at_m = mean(&|plane| plane.away_m);
    let unknowns = if count >= FOR_SCALE { 3 } else { 1 };
    if count <= unknowns {
        return None;
    }
    let row = |plane: &Plane| [1.0, plane.away_m - at_m, plane.slope_m];
    let design = DMatrix::from_fn(count, unknowns, |i, k| row(&planes[i])[k]);
    let off = DVector::from_iterator(count, planes.iter().map(|plane| plane.off_m));
    let degrees_of_freedom = count - unknowns;
    let covariance = (design.transpose() * &design).try_inverse()?;
    let found = &covariance * (design.transpose() * &off);
    let variance = (off - design * &found).norm_squared() / degrees_of_freedom as f64;
    let estimated = |k: usize, more: f64| Estimated {
        value: found[k],
        sigma: (covariance[(k, k)] * variance + more * more).sqrt(),
    };
    let tilt = |axis: usize| {
        let value = mean(&|plane| plane.tilt_rad[axis]);
        let squares = planes.iter().map(|plane| (plane.tilt_rad[axis] - value).powi(2)).sum::<f64>();
        Estimated { value, sigma: (squares / ((count - 1) * count) as f64).sqrt() }
    };
    Some(DepthErrors {
        offset_m: estimated(0, of_focal * at_m),
        at_m,
        scale: (unknowns > 1).then(|| estimated(1, of_focal)),
        slope_px: (unknowns > 1).then(|| estimated(2, 0.0)),
        tilt_rad: [tilt(0), tilt(1)],
        noise_m: mean(&|plane| plane.variance_m2).sqrt(),
        between_m: variance.sqrt(),
        degrees_of_freedom,
    })
}

#[cfg(test)]
#[path = "depth_camera_tests.rs"]
mod tests;
