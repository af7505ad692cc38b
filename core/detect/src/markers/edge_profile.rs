//! A blurred step fitted to all pixels of an edge.
//!
//! `I = m(s) + h(s) erf((x − c(s)) / √2 σ)` with the place `s` along the edge, `x` across it, the curve `c` of second degree,
//! the blur `σ`, and the mean level `m` and half the step `h` changing evenly along the edge, by Levenberg–Marquardt.

use nalgebra::{SVector, Vector3};

use super::edge::{Edge, Scan};
use super::grey_levels::{self, Sums};
use crate::checkerboard::subpixel::erf_and_slope;

/// Largest RMS misfit of the Gaussian profile as a part of half the contrast.
const MAX_MISFIT: f64 = 0.2;
/// A step of the fit below this ends it \[px\].
const CONVERGED_PX: f64 = 5e-4;
const MAX_STEPS: usize = 15;
/// Variance of rounding to whole grey levels: no image is known better.
const ROUNDING: f64 = 1.0 / 12.0;

/// Curve (3), blur across the edge, mean level (2), half the step (2).
type Parameters = SVector<f64, 8>;

/// The pixels near an edge with a Gaussian profile.
pub(super) struct Profile<'a> {
    pub scan: &'a Scan<'a>,
    /// Lines of pixels that count.
    pub along: Vec<i64>,
    /// Deviation of the second coefficient of the curve a priori \[px\].
    pub bend: f64,
    /// Least blur across the edge \[px\] for which the profile is valid.
    pub least_blur: f64,
}

impl Profile<'_> {
    /// The edge by least squares; `None` where the profile is another.
    pub fn fit(&self, start: &Edge) -> Option<Edge> {
        let pixels = self.pixels(start)?;
        let level = |beyond: bool| {
            let side = pixels.iter().filter(|p| (p.y > start.curve.dot(&Vector3::new(1.0, p.x, p.x * p.x))) == beyond);
            side.clone().map(|p| p.z).sum::<f64>() / side.count().max(1) as f64
        };
        let (before, after) = (level(false), level(true));
        let mut x = Parameters::zeros();
        x.fixed_rows_mut::<3>(0).copy_from(&start.curve);
        x[3] = 0.8;
        x[4] = f64::midpoint(before, after);
        // Blur lowers the step seen.
        x[6] = 0.6 * (after - before);
        let hold = |x: &mut Parameters| x[3] = x[3].clamp(0.1, 6.0);
        let is_small = |step: &Parameters| step.fixed_rows::<3>(0).amax() < CONVERGED_PX;
        let (x, now) = grey_levels::fit(x, MAX_STEPS, |x| self.sums(&pixels, x), hold, is_small)?;
        let variance = now.cost / (pixels.len() as f64 - 8.0);
        let curve = x.fixed_rows::<3>(0).into_owned();
        let near = (curve - start.curve).amax() < 0.5;
        if !(near && x[3] >= self.least_blur && variance.sqrt() <= MAX_MISFIT * x[6].abs()) {
            return None;
        }
        let covariance = now.normal.cholesky()?.inverse().fixed_view::<3, 3>(0, 0) * variance.max(ROUNDING);
        let mut found = *start;
        (found.curve, found.covariance) = (curve, covariance);
        Some(found)
    }

    /// Place along (as s) and across, and grey level.
    fn pixels(&self, edge: &Edge) -> Option<Vec<Vector3<f64>>> {
        let steps = self.scan.reach.round() as i64;
        let mut pixels = Vec::with_capacity(self.along.len() * (2 * steps as usize + 1));
        for &along in &self.along {
            let middle = edge.across(along as f64).round() as i64;
            for across in middle - steps..=middle + steps {
                let grey = self.scan.grey(edge.axis, along, across)?;
                pixels.push(Vector3::new(edge.terms(along as f64).y, across as f64, grey));
            }
        }
        (pixels.len() > 16).then_some(pixels)
    }

    fn sums(&self, pixels: &[Vector3<f64>], x: &Parameters) -> Sums<8> {
        let scale = std::f64::consts::FRAC_1_SQRT_2 / x[3];
        let mut out = Sums::zero();
        for p in pixels {
            let s = p.x;
            let half = x[6] + x[7] * s;
            let q = (p.y - (x[0] + x[1] * s + x[2] * s * s)) * scale;
            let (e, slope) = erf_and_slope(q);
            let by_curve = -half * slope * scale;
            let by_blur = -half * slope * q / x[3];
            let row =
                Parameters::from_column_slice(&[by_curve, by_curve * s, by_curve * s * s, by_blur, 1.0, s, e, e * s]);
            out.add(&row, x[4] + x[5] * s + half * e - p.z);
        }
        // The curvature a priori, for noise of two grey levels.
        let weight = 4.0 / (self.bend * self.bend);
        out.cost += weight * x[2] * x[2];
        out.gradient[2] += weight * x[2];
        out.normal[(2, 2)] += weight;
        out
    }
}
