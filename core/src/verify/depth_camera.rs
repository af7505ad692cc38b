//! A depth camera against the calibrated lens: how far its depths of the board are off where the board is.
//!
//! Where the board is in a capture is where the calibration has it, by robot and corners together
//! ([`ViewResult::camera_from_target`](crate::estimate::ViewResult::camera_from_target)). A plane is laid through what the depths
//! all over it are off: its height `d` in the middle of the board, its two slopes, and the scatter about it. The heights of all
//! captures say
//!
//! ```text
//! d = offset + scale (z − z̄) + slope g
//! ```
//!
//! with `z` the distance of the board along the optical axis, `z̄` the mean of that, and `g` by how much the depth of the board
//! changes from one pixel to the next: what a renderer's polygon offset, or a matcher that prefers the nearer or the farther
//! pixel, adds. Captures scatter about that by more than their depths do (neighbours have the same error), so the scatter of the
//! captures is what the uncertainty is from, by ordinary least squares. A focal length that is off puts the board off by the same
//! part; its uncertainty is added. A target of another size than stated does the same, and nothing here knows.

use nalgebra::{DMatrix, DVector, Isometry3, Matrix3, Point3, Translation3, Vector3};
use statrs::distribution::{ContinuousCDF as _, StudentsT};

use super::points;
use crate::depth::{DepthImage, DepthSample, outlier_reach_m};
use crate::geometry::camera::Intrinsics;
use crate::geometry::statistics::median_high;
use crate::targets::TargetSpec;
use crate::targets::bent::{BoardPoints, BoardShape};

/// Part of the board that has to be in the image.
const LEAST_IN_IMAGE: f64 = 0.5;
/// Part of that which has to have a depth on one plane, for the plane to be that of the board.
const LEAST_MEASURED: f64 = 0.3;
/// Captures that tell an offset from a scale and the slope's part, with three to spare for the scatter.
const FOR_SCALE: usize = 6;
/// Depths that are off by more than this factor are in another unit, or of another image: the worst depth cameras are off by
/// some percent.
const GROSS: f64 = 1.2;
const ROUNDS: usize = 4;
/// Chance that an error is called one that is none.
const FALSE_ALARM: f64 = 1e-3;

/// A number with its standard deviation.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Estimated {
    /// The value.
    pub value: f64,
    /// One standard deviation.
    pub sigma: f64,
}

/// What the depths of many captures say of a depth camera.
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

/// How far depths are off.
#[derive(Debug, Clone, PartialEq)]
pub struct DepthErrors {
    /// Measured minus expected depth where the board is [`Self::at_m`] away and seen straight, metres.
    pub offset_m: Estimated,
    /// Mean distance of the board, metres.
    pub at_m: f64,
    /// How much faster than the distance the depth grows: 0.001 is 1 mm in a metre. `None` for less than six captures.
    pub scale: Option<Estimated>,
    /// What is added to the depth of a slanted surface, in pixels' worth of its slope. `None` likewise.
    pub slope_px: Option<Estimated>,
    /// How far the plane by depth is turned against the board about the camera's x and y, radians.
    pub tilt_rad: [Estimated; 2],
    /// Scatter of single depths about the plane of a capture, metres.
    pub noise_m: f64,
    /// Scatter of the captures about offset, scale and slope, metres.
    pub between_m: f64,
    /// Captures to spare.
    pub degrees_of_freedom: usize,
}

impl DepthReport {
    /// Whether the depths are not of the right order of magnitude.
    pub fn is_gross(&self) -> bool {
        !(1.0 / GROSS..=GROSS).contains(&self.ratio)
    }
}

impl DepthErrors {
    /// Whether a number is none of chance: a false alarm in one of a thousand depth cameras.
    pub fn is_certain(&self, of: Estimated) -> bool {
        let law = StudentsT::new(0.0, 1.0, self.degrees_of_freedom.max(1) as f64);
        law.is_ok_and(|law| of.value.abs() > of.sigma * law.inverse_cdf(1.0 - 0.5 * FALSE_ALARM))
    }
}

/// Gathers the depths of captures, one image at a time.
pub struct DepthCheck<'a> {
    lens: &'a Intrinsics,
    places: Vec<Point3<f64>>,
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

/// A depth of the board.
struct Sample {
    expected: Point3<f64>,
    off_m: f64,
}

impl<'a> DepthCheck<'a> {
    /// Of a lens, and of the target that the captures show.
    pub fn new(lens: &'a Intrinsics, target: &TargetSpec, shape: &BoardShape) -> Self {
        let places = BoardPoints::new(&target.places_all_over()).points(shape);
        Self { lens, places, middle: target.centre(), fills: Vec::new(), ratios: Vec::new(), planes: Vec::new() }
    }

    /// Adds the depths of a capture in which the board is there; `far_m` is the sensor's far plane in metres, infinity when it has
    /// none. An image of another size than the lens is for, and one without most of the board in it, says nothing.
    pub fn add(&mut self, depth: &DepthImage, far_m: f32, camera_from_target: &Isometry3<f64>) {
        let lens = self.lens;
        if (depth.width, depth.height) != (lens.width, lens.height) {
            return;
        }
        let (mut in_image, mut samples, mut ratios) = (0usize, Vec::new(), Vec::new());
        for place in &self.places {
            let Ok(px) = lens.project(&(camera_from_target * place)) else { continue };
            let within = |value: f64, size: u32| value >= 0.0 && value <= f64::from(size) - 1.0;
            if !within(px.x, lens.width) || !within(px.y, lens.height) {
                continue;
            }
            // The depth is that of the pixel's middle. There a bent board is a plane as deep in it as the place.
            let pixel = px.map(f64::round);
            let surface = camera_from_target * Translation3::new(0.0, 0.0, place.z);
            let Ok(expected) = points::on_plane(lens, &pixel, &surface) else { continue };
            in_image += 1;
            if let DepthSample::Metres(depth_m) = depth.sample(pixel.x as u32, pixel.y as u32, far_m) {
                let depth_m = f64::from(depth_m);
                ratios.push(depth_m / expected.z);
                samples.push(Sample { expected, off_m: depth_m - expected.z });
            }
        }
        if (in_image as f64) < LEAST_IN_IMAGE * self.places.len() as f64 {
            return;
        }
        self.fills.push(samples.len() as f64 / in_image as f64);
        let Some(ratio) = median_high(ratios) else { return };
        let least = (LEAST_MEASURED * in_image as f64) as usize;
        if samples.len() < least {
            return;
        }
        self.ratios.push(ratio);
        let middle = camera_from_target * self.middle;
        self.planes.extend(plane(samples, least, middle).map(|mut plane| {
            // The depth along a ray is z = h / (n · ray).
            let normal = camera_from_target.rotation * Vector3::z();
            let towards = normal.xy().norm() / normal.dot(&(middle.coords / middle.z)).abs().max(f64::EPSILON);
            plane.slope_m = plane.away_m * towards * 2.0 / (lens.fx + lens.fy);
            plane
        }));
    }

    /// What all of them say, with the standard deviation of the focal length \[px\]; `None` without a capture that shows depths of
    /// the board.
    pub fn finish(self, sigma_focal_px: f64) -> Option<DepthReport> {
        let ratio = median_high(self.ratios.iter().copied())?;
        let fill = self.fills.iter().sum::<f64>() / self.fills.len() as f64;
        let report = DepthReport { captures: self.fills.len(), fill, ratio, errors: None };
        if report.is_gross() {
            return Some(report);
        }
        let of_focal = sigma_focal_px * 2.0 / (self.lens.fx + self.lens.fy);
        Some(DepthReport { errors: errors(&self.planes, of_focal), ..report })
    }
}

/// The plane through what depths are off, with those left out that are not on it.
fn plane(mut samples: Vec<Sample>, least: usize, middle: Point3<f64>) -> Option<Plane> {
    // The first plane is one of the same height everywhere: what covers the board must not tilt it.
    let centre = median_high(samples.iter().map(|sample| sample.off_m))?;
    keep_near(&mut samples, |_| centre);
    let mut found = None;
    for _ in 0..ROUNDS {
        if samples.len() < least.max(4) {
            return None;
        }
        let row = |sample: &Sample| {
            let aside = sample.expected - middle;
            Vector3::new(1.0, aside.x, aside.y)
        };
        let (mut information, mut pull) = (Matrix3::zeros(), Vector3::zeros());
        for sample in &samples {
            information += row(sample) * row(sample).transpose();
            pull += row(sample) * sample.off_m;
        }
        let height: Vector3<f64> = information.cholesky()?.solve(&pull);
        let squares: f64 = samples.iter().map(|sample| (sample.off_m - height.dot(&row(sample))).powi(2)).sum();
        found = Some(Plane {
            away_m: middle.z,
            slope_m: 0.0,
            off_m: height.x,
            // A turn about x takes what lies at positive y away, one about y brings what lies at positive x nearer.
            tilt_rad: [height.z, -height.y],
            variance_m2: squares / (samples.len() - 3) as f64,
        });
        let before = samples.len();
        keep_near(&mut samples, |sample| height.dot(&row(sample)));
        if samples.len() == before {
            break;
        }
    }
    found
}

fn keep_near(samples: &mut Vec<Sample>, height: impl Fn(&Sample) -> f64) {
    let off: Vec<f64> = samples.iter().map(|sample| (sample.off_m - height(sample)).abs()).collect();
    let reach = outlier_reach_m(&off);
    samples.retain(|sample| (sample.off_m - height(sample)).abs() <= reach);
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
