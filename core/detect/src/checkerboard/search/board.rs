//! All corners of a board, refined together.
//!
//! Corner by corner first, on the level of the pyramid where the board was found. Then the neighbours show how the
//! edges bend (lens), and all corners how the light falls off, which a single window of a blurred corner cannot
//! distinguish from a shift; with that every corner is fitted in the image itself, in a larger window.

use nalgebra::{SMatrix, SVector, Vector2};

use super::edge::{PIXEL_AREA, Profile};
use super::fit::{Fit, Light, SHARPEST_PX, fit};
use super::patch::{BLUR, Patch, Window};
use super::pyramid::Level;
use crate::VisionError;
use crate::error::go_on;
use crate::order::Ordered;
use handeye_geometry::progress::CancelToken;
use handeye_geometry::statistics::median_high;

/// Part of a grid step up to which a pixel counts for the first fit, and the part tried when that fails: the outermost
/// squares of some boards are cut narrow, and dirt or a shadow may be on a square.
const FIRST_PARTS: [f64; 2] = [0.42, 0.22];
/// Squares so small that this many pixels are more than the part above are used to there, up to the largest part.
const LEAST_REACH_PX: f64 = 3.0;
const LARGEST_PART: f64 = 0.6;
/// Reach of the first fit [px]: curved edges (lens) matter less than noise.
const FIRST_REACH_PX: f64 = 7.0;
/// Largest part of a grid step for the second fit, and the reach [px]: beyond, nothing is gained on real edges.
const SECOND_PART: f64 = 0.46;
const SECOND_REACH_PX: f64 = 15.0;
/// The next edge must be this many blurs away from the pixels that count.
const BLURS_CLEAR: f64 = 2.5;
/// Pixels count to this many blurs and pixels from an edge.
const BAND: (f64, f64) = (2.6, 1.2);
/// Steps of the corner that end the first and the second fit [px]: the remaining error is a tenth of that.
const CONVERGED_PX: [f64; 2] = [0.1, 0.003];
/// A second fit that moved the corner further than this \[px\] is repeated with the window around it.
const OFF_MIDDLE_PX: f64 = 0.35;
/// Most second fits: the result of the first one, around its position, and with the profile of a sharp edge.
const MOST_FITS: usize = 3;
/// Blur that a first fit starts from where no other corner was fitted yet \[px\], and its minimum as a part of the
/// corner's possible error: a wide edge can be found from further away.
const START_BLUR_PX: f64 = 1.0;
const BLUR_PER_PX: f64 = 0.3;
/// Below this blur an edge is integrated over the pixels: beyond, the error of a Gaussian is `2 · 0.55 / (24 · 120 σ⁴)`
/// of the contrast at most ([`super::edge`]), in full contrast less than the deviation of rounding to whole grey levels.
const SHARP_PX: f64 = 0.64;
/// Pixels within this many blurs of both edges see both; and the error of the corner that is added \[px\].
const MEETING: (f64, f64) = (2.5, 0.2);
/// Furthest usual move of the second fit, in pixels of the level and on top of what the first fit states.
const USUAL_MOVE: f64 = 0.2;
/// Largest move from the start that is believed: a part of the spacing, at least that many pixels.
const MAX_MOVE: (f64, f64) = (0.25, 1.0);
/// Standard deviation of the light's relative gradient by the levels over the board [1/px].
const LIGHT_SD: f64 = 5e-4;
/// Corners that are needed to determine how the light falls off: twice as many as it has parameters.
const MIN_LEVELS: usize = 12;

/// Refines a board found to a pixel or so on `levels[depth]`, in pixels of that level. The result is in pixels of
/// `levels[0]`, the image; corners whose image is not that of a corner stay and have no covariance.
pub(super) fn refine(
    levels: &[Level],
    depth: usize,
    found: &Ordered,
    cancel: &CancelToken,
) -> Result<Ordered, VisionError> {
    let (Some(image), Some(level)) = (levels.first(), levels.get(depth)) else { return Ok(found.clone()) };
    let scale = f64::from(1u32 << depth);
    let mut at = found.clone();
    for point in &mut at.points {
        *point = full_px(*point, scale);
    }
    let mut first: Vec<Option<Fit>> = vec![None; found.points.len()];
    add_first_fits(level, found, 1.0, &mut first, cancel)?;
    if depth > 0 {
        first = first.into_iter().map(|fit| fit.map(|fit| enlarged(fit, scale))).collect();
        // Squares too small on the level may do in the image.
        add_first_fits(image, &at, scale, &mut first, cancel)?;
    }
    for (point, fit) in at.points.iter_mut().zip(&first) {
        *point = fit.map_or(*point, |fit| fit.px);
    }
    let (bends, fall) = (Bends::of(&at), Fall::over(&first));
    let mut out = at.clone();
    // Blur changes slowly over a board.
    let mut blur_px = None;
    for (index, start) in first.iter().enumerate() {
        go_on(cancel)?;
        let Some(start) = start else { continue };
        let (column, row) = (index % at.columns, index / at.columns);
        let (along_x, along_y) = at.steps(column, row);
        let window = Window { bend: [bends.rows[row], bends.columns[column]], ..plain(start.px, [along_x, along_y]) };
        let spacing = at.spacing(column, row);
        let gradient = fall.as_ref().and_then(|fall| fall.gradient(start.px));
        // Unless something else came into the larger window.
        let usual = 4.0 * start.covariance_px2.trace().sqrt() + USUAL_MOVE * scale;
        let from = |start: &Fit| {
            let fit = second_fit(image, &window, spacing, gradient, start);
            fit.filter(|fit| (fit.px - start.px).norm() <= usual)
        };
        // The blur of a coarser level is too large where edges are sharp.
        let like_the_last = blur_px.filter(|_| depth > 0).map(|blur_px| Fit { blur_px, ..*start }.with_its_blur());
        let second = like_the_last.and_then(|start| from(&start)).or_else(|| from(start));
        blur_px = second.map(|fit| fit.blur_px).or(blur_px);
        // On a coarse level the first fit is not good enough to be kept.
        let Some(fit) = second.or((depth == 0).then_some(*start)) else { continue };
        out.points[index] = fit.px;
        out.covariances_px2[index] = Some(fit.covariance_px2);
    }
    Ok(out)
}

/// A coordinate u covers u − ½ … u + ½, so it is u + ½ that scales.
fn full_px(px: Vector2<f64>, scale: f64) -> Vector2<f64> {
    px.map(|c| (c + 0.5) * scale - 0.5)
}

/// A fit on a coarser level in pixels of the image.
fn enlarged(fit: Fit, scale: f64) -> Fit {
    let lens = (fit.blur_px * fit.blur_px - PIXEL_AREA).max(0.0);
    let blur_px = if scale > 1.0 { (scale * scale * lens + PIXEL_AREA).sqrt().max(SHARPEST_PX) } else { fit.blur_px };
    let mut parameters = fit.parameters;
    parameters[2] /= scale;
    parameters[3] /= scale;
    parameters[6] = blur_px;
    Fit { px: full_px(fit.px, scale), covariance_px2: fit.covariance_px2 * scale * scale, parameters, blur_px, ..fit }
}

/// Fits at the points of `found`, which are known to about `within_px`, where there is none yet.
fn add_first_fits(
    level: &Level,
    found: &Ordered,
    within_px: f64,
    fits: &mut [Option<Fit>],
    cancel: &CancelToken,
) -> Result<(), VisionError> {
    let mut blur_px = START_BLUR_PX;
    for (index, (point, fit)) in found.points.iter().zip(fits).enumerate() {
        go_on(cancel)?;
        if fit.is_some() {
            continue;
        }
        let (column, row) = (index % found.columns, index / found.columns);
        let (along_x, along_y) = found.steps(column, row);
        let spacing = found.spacing(column, row);
        let bound = (MAX_MOVE.0 * spacing).max(MAX_MOVE.1 * within_px);
        let blur = blur_px.max(BLUR_PER_PX * within_px);
        *fit = first_fit(level, &plain(*point, [along_x, along_y]), spacing, blur)
            .filter(|fit| (fit.px - point).norm() <= bound);
        // Blur changes slowly over a board.
        blur_px = fit.map_or(blur_px, |fit| fit.blur_px.max(SHARPEST_PX));
    }
    Ok(())
}

/// The window of the first fit on a plain chessboard.
fn plain(centre: Vector2<f64>, along: [Vector2<f64>; 2]) -> Window {
    Window {
        centre,
        along,
        bend: [0.0; 2],
        part: FIRST_PARTS[0],
        reach_px: FIRST_REACH_PX,
        band_px: f64::INFINITY,
        meeting_px: 0.0,
    }
}

/// In the larger window and, where that fails, in the smaller.
fn first_fit(level: &Level, window: &Window, spacing: f64, blur_px: f64) -> Option<Fit> {
    FIRST_PARTS.into_iter().find_map(|part| {
        let part = (LEAST_REACH_PX / spacing).clamp(part, LARGEST_PART.max(part));
        let window = Window { part, ..*window };
        let patch = Patch::of(level, &window)?;
        fit(&patch, &window, Profile::Blurred, None, patch.start(&window, blur_px), CONVERGED_PX[0])
    })
}

fn second_fit(
    image: &Level,
    window: &Window,
    spacing: f64,
    gradient: Option<Vector2<f64>>,
    first: &Fit,
) -> Option<Fit> {
    let least = (LEAST_REACH_PX / spacing).min(LARGEST_PART);
    let light = gradient.map(|gradient| Light { gradient, sd: LIGHT_SD, noise: first.noise });
    let mut at = *first;
    let mut profile = Profile::Blurred;
    for _ in 0..MOST_FITS {
        if at.blur_px < SHARP_PX {
            profile = Profile::Pixels;
        }
        at.parameters[BLUR] = at.parameters[BLUR].max(SHARPEST_PX);
        let clear = 1.0 - BLURS_CLEAR * at.blur_px / spacing;
        let mut window = Window {
            centre: at.px,
            part: clear.clamp(0.25, SECOND_PART).max(least),
            reach_px: SECOND_REACH_PX,
            band_px: BAND.0 * at.blur_px + BAND.1,
            meeting_px: MEETING.0 * at.blur_px + MEETING.1,
            ..*window
        };
        let patch = Patch::of(image, &window).or_else(|| {
            // Cut by the border of the image.
            window.part = FIRST_PARTS[1].max(least);
            Patch::of(image, &window)
        })?;
        let next = fit(&patch, &window, profile, light.as_ref(), at.parameters, CONVERGED_PX[1])?;
        let moved = (next.px - at.px).norm();
        at = next;
        // On a coarse level a sharp edge can look like a blurred one.
        let is_sharper = profile == Profile::Blurred && at.blur_px < SHARP_PX;
        if moved <= OFF_MIDDLE_PX && !is_sharper {
            break;
        }
    }
    Some(at)
}

/// How far the lines of a board bend, each by the mean over its corners: the bend of a lens changes slowly, and the
/// mean hardly depends on the errors of single corners.
struct Bends {
    rows: Vec<f64>,
    columns: Vec<f64>,
}

impl Bends {
    fn of(at: &Ordered) -> Self {
        let mean = |count: usize, point: &dyn Fn(usize) -> Vector2<f64>| {
            let all = (1..count - 1).map(|i| curvature(point(i - 1), point(i), point(i + 1)));
            all.sum::<f64>() / (count - 2) as f64
        };
        let (columns, rows) = (at.columns, at.rows());
        Self {
            rows: (0..rows).map(|r| mean(columns, &|c| at.at(c, r))).collect(),
            columns: (0..columns).map(|c| mean(rows, &|r| at.at(c, r))).collect(),
        }
    }
}

/// Curvature of the curve through three points, such that `n·d + ½ κ (t·d)² = 0` on it.
fn curvature(a: Vector2<f64>, b: Vector2<f64>, c: Vector2<f64>) -> f64 {
    let chord = c - a;
    let normal = Vector2::new(-chord.y, chord.x) / chord.norm();
    let sides = (b - a).norm() * (c - b).norm();
    // Height of the middle point over the chord.
    let bulge = normal.dot(&(b - a));
    if sides > 0.0 { 2.0 * bulge / sides } else { 0.0 }
}

/// How the light falls off over the board: the mean levels at the corners as a quadratic function of the place.
struct Fall {
    middle: Vector2<f64>,
    size: f64,
    coefficients: SVector<f64, 6>,
}

impl Fall {
    fn over(fits: &[Option<Fit>]) -> Option<Self> {
        let known: Vec<&Fit> = fits.iter().flatten().collect();
        if known.len() < MIN_LEVELS {
            return None;
        }
        let count = known.len() as f64;
        let middle = known.iter().map(|fit| fit.px).sum::<Vector2<f64>>() / count;
        let size = known.iter().map(|fit| (fit.px - middle).norm()).fold(0.0, f64::max);
        let mut fall = Self { middle, size, coefficients: SVector::zeros() };
        let mut limit = f64::INFINITY;
        // Then once more without the levels that are far off: dirt, a glare.
        for _ in 0..2 {
            let mut normal = SMatrix::<f64, 6, 6>::zeros();
            let mut rhs = SVector::<f64, 6>::zeros();
            for fit in &known {
                let row = fall.row(fit.px);
                if (fit.level - row.dot(&fall.coefficients)).abs() <= limit {
                    normal.ger(1.0, &row, &row, 1.0);
                    rhs.axpy(fit.level, &row, 1.0);
                }
            }
            fall.coefficients = normal.cholesky()?.solve(&rhs);
            let off = known.iter().map(|fit| (fit.level - fall.row(fit.px).dot(&fall.coefficients)).abs());
            limit = 4.0 * median_high(off)? + 1e-9;
        }
        Some(fall)
    }

    fn row(&self, px: Vector2<f64>) -> SVector<f64, 6> {
        let d = (px - self.middle) / self.size;
        SVector::from_column_slice(&[1.0, d.x, d.y, d.x * d.x, d.x * d.y, d.y * d.y])
    }

    /// Relative gradient [1/px].
    fn gradient(&self, px: Vector2<f64>) -> Option<Vector2<f64>> {
        let d = (px - self.middle) / self.size;
        let c = &self.coefficients;
        let level = self.row(px).dot(c);
        let slope = Vector2::new(c[1] + 2.0 * c[3] * d.x + c[4] * d.y, c[2] + c[4] * d.x + 2.0 * c[5] * d.y);
        (level > 1.0).then(|| slope / (level * self.size))
    }
}
