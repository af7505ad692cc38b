//! One corner of a chessboard whose light squares have something printed in them.
//!
//! The model is that of [`crate::checkerboard::subpixel`]: two straight edges that cross, blurred. Only the pixels near the edges
//! are used, a cross of arms as wide as the light margin around a marker, since the model does not cover what is beyond.

use image::GrayImage;
use nalgebra::{Matrix2, SVector, Vector2};

use super::grey_levels::{self, Sums};
use crate::checkerboard::subpixel::erf_and_slope;

/// Part of a grid step up to which a pixel counts along an edge: half-way to the next corner, less its blur.
const CELL_PART: f64 = 0.42;
/// Pixels further from the corner than this do not count: there a lens bends edges more than noise moves them.
const REACH_PX: f64 = 9.0;
/// The blur of a marker's border reaches this far over the margin \[px\].
const BORDER_BLUR_PX: f64 = 1.5;
/// Arms are at least this wide on either side [px]: an edge and its blur.
const MIN_ARM_PX: f64 = 1.2;
/// Pixels needed for the nine parameters.
const MIN_PIXELS: usize = 20;
const MAX_STEPS: usize = 25;
/// A step of the corner below this ends the fit [px]: a tenth of the best that noise allows.
const CONVERGED_PX: f64 = 5e-4;
const BLUR_PX: (f64, f64) = (0.2, 4.0);
/// Least contrast (half the difference between dark and light) in grey levels.
const MIN_CONTRAST: f64 = 5.0;
/// Largest RMS misfit as a part of the contrast.
const MAX_MISFIT: f64 = 0.2;
/// Variance of rounding to whole grey levels: no image is known better.
const ROUNDING: f64 = 1.0 / 12.0;

type Parameters = SVector<f64, 9>;

/// Expected place of a corner, and its surroundings.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Expected {
    pub px: Vector2<f64>,
    /// One step along x and along y of the board \[px\].
    pub along_x: Vector2<f64>,
    pub along_y: Vector2<f64>,
    /// Whether the square between both directions is dark.
    pub dark: bool,
    /// Light margin around a marker as a part of a step.
    pub margin: f64,
}

/// A corner that is seen.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Crossing {
    pub px: Vector2<f64>,
    pub covariance_px2: Matrix2<f64>,
    /// Half the difference between light and dark \[grey levels\].
    pub contrast: f64,
}

/// The corner within `reach_px` of where it is expected; `None` where there is none of that sign, or where the border of
/// the image cuts its window.
pub(crate) fn fit(image: &GrayImage, expected: &Expected, reach_px: f64) -> Option<Crossing> {
    let first = fit_once(image, expected)?;
    // A window laid around the corner sees the same of all four squares.
    let found = fit_once(image, &Expected { px: first.px, ..*expected })?;
    ((found.px - expected.px).norm() <= reach_px).then_some(found)
}

fn fit_once(image: &GrayImage, expected: &Expected) -> Option<Crossing> {
    let pixels = window(image, expected)?;
    let hold = |x: &mut Parameters| x[4] = x[4].clamp(BLUR_PX.0, BLUR_PX.1);
    let is_small = |step: &Parameters| step[0].hypot(step[1]) < CONVERGED_PX;
    let (x, now) = grey_levels::fit(start(&pixels, expected), MAX_STEPS, |x| sums(&pixels, x), hold, is_small)?;
    let contrast = if expected.dark { x[8] } else { -x[8] };
    let variance = now.cost / (pixels.len() - 9) as f64;
    let lines_apart = (x[2] - x[3]).sin().abs();
    let is_corner = contrast >= MIN_CONTRAST
        && variance.sqrt() <= MAX_MISFIT * contrast
        && x[4] < BLUR_PX.1
        && lines_apart > 0.1
        && x[0].hypot(x[1]) < REACH_PX;
    if !is_corner {
        return None;
    }
    let covariance = now.normal.cholesky()?.inverse() * variance.max(ROUNDING);
    let covariance_px2 = covariance.fixed_view::<2, 2>(0, 0).into_owned();
    Some(Crossing { px: expected.px + Vector2::new(x[0], x[1]), covariance_px2, contrast })
}

/// Offsets and grey levels of the pixels that count; `None` when too few or cut by the border of the image.
fn window(image: &GrayImage, expected: &Expected) -> Option<Vec<(Vector2<f64>, f64)>> {
    let Expected { px, along_x, along_y, margin, .. } = expected;
    let area = along_x.perp(along_y);
    let spacing = along_x.norm().min(along_y.norm());
    if !(area.is_finite() && area.abs() > spacing) {
        return None;
    }
    let arm = (margin - BORDER_BLUR_PX / spacing).max(MIN_ARM_PX / spacing);
    let half = (along_x.abs() + along_y.abs()) * CELL_PART;
    let half = Vector2::new(half.x.min(REACH_PX), half.y.min(REACH_PX));
    let (low, high) = ((px - half).map(f64::ceil), (px + half).map(f64::floor));
    let (width, height) = image.dimensions();
    let inside = low.x >= 0.0 && low.y >= 0.0 && high.x <= f64::from(width) - 1.0 && high.y <= f64::from(height) - 1.0;
    if !inside {
        return None;
    }
    let mut pixels = Vec::with_capacity(256);
    for v in low.y as u32..=high.y as u32 {
        for u in low.x as u32..=high.x as u32 {
            let p = Vector2::new(f64::from(u), f64::from(v)) - px;
            let (a, b) = ((p.perp(along_y) / area).abs(), (along_x.perp(&p) / area).abs());
            if a.max(b) <= CELL_PART && a.min(b) <= arm && p.norm() <= REACH_PX {
                pixels.push((p, f64::from(image.get_pixel(u, v).0[0])));
            }
        }
    }
    (pixels.len() >= MIN_PIXELS).then_some(pixels)
}

/// Edges along the steps of the board; levels from the mean of the two pairs of opposite squares.
fn start(pixels: &[(Vector2<f64>, f64)], expected: &Expected) -> Parameters {
    let normal_angle = |along: &Vector2<f64>| along.x.atan2(-along.y);
    let (mut sums, mut counts) = ([0.0; 2], [0.0; 2]);
    for (p, value) in pixels {
        let same_side = usize::from(p.perp(&expected.along_x) * p.perp(&expected.along_y) > 0.0);
        sums[same_side] += value;
        counts[same_side] += 1.0;
    }
    let mean = |i: usize| sums[i] / f64::max(counts[i], 1.0);
    let (level, contrast) = (0.5 * (mean(0) + mean(1)), 0.6 * (mean(1) - mean(0)));
    let angles = [normal_angle(&expected.along_x), normal_angle(&expected.along_y)];
    Parameters::from_column_slice(&[0.0, 0.0, angles[0], angles[1], 0.7, level, 0.0, 0.0, contrast])
}

/// Sums for centre (2), angles of both normals, blur, level, relative gradient of the light (2) and
/// contrast.
fn sums(pixels: &[(Vector2<f64>, f64)], x: &Parameters) -> Sums<9> {
    let scale = std::f64::consts::FRAC_1_SQRT_2 / x[4];
    let (n1, n2) = (Vector2::new(x[2].cos(), x[2].sin()), Vector2::new(x[3].cos(), x[3].sin()));
    let (t1, t2) = (Vector2::new(-n1.y, n1.x), Vector2::new(-n2.y, n2.x));
    let (centre, light_slope) = (Vector2::new(x[0], x[1]), Vector2::new(x[6], x[7]));
    let mut out = Sums::zero();
    for (p, value) in pixels {
        let d = p - centre;
        let (s1, s2) = (n1.dot(&d) * scale, n2.dot(&d) * scale);
        let ((e1, g1), (e2, g2)) = (erf_and_slope(s1), erf_and_slope(s2));
        let light = 1.0 + light_slope.dot(&d);
        let level = x[5] + x[8] * e1 * e2;
        let (by_s1, by_s2) = (light * x[8] * g1 * e2, light * x[8] * e1 * g2);
        let by_centre = -(n1 * by_s1 + n2 * by_s2) * scale - light_slope * level;
        let row = Parameters::from_column_slice(&[
            by_centre.x,
            by_centre.y,
            by_s1 * t1.dot(&d) * scale,
            by_s2 * t2.dot(&d) * scale,
            -(by_s1 * s1 + by_s2 * s2) / x[4],
            light,
            level * d.x,
            level * d.y,
            light * e1 * e2,
        ]);
        out.add(&row, level * light - value);
    }
    out
}
