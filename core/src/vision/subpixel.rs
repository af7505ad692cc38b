//! Sub-pixel position of chessboard corners by fitting what a lens makes of one.
//!
//! Near an inner corner the board is two straight lines (straight under any perspective) that divide dark from light
//! crosswise. Blurred by the lens and the area of the pixels, the intensity is close to
//!
//! `I(p) = (1 + g·(p − c)) · (m + a · erf(n₁·(p − c) / √2 σ) · erf(n₂·(p − c) / √2 σ))`
//!
//! with the corner `c`, the unit normals `n₁`, `n₂` of the lines, the blur `σ`, the mean level `m`, a relative
//! gradient `g` of the illumination and the signed contrast `a`. All nine are fitted by Levenberg–Marquardt to the
//! pixels around each corner, starting from OpenCV's `cornerSubPix`, whose answer stays where the fit does not
//! converge to a corner.
//! A quadratic saddle (Placht et al. 2014, "ROCHADE") is the second-order expansion of this at `c`; the full model
//! uses the pixels along the edges too, where most of the information is.

use image::GrayImage;
use nalgebra::{SMatrix, SVector, Vector2};
use opencv::core::{Size, TermCriteria, TermCriteria_EPS, TermCriteria_MAX_ITER};

use super::VisionError;
use super::bridge::{failed, from_points2f, mat_from_gray, to_points2f};
use super::order::Ordered;
use super::saddle;

/// Half window as a part of the distance to the nearest neighbour: pixels further out see the next corner.
const WINDOW_PER_SPACING: f64 = 0.4;
/// Half windows that `cornerSubPix` is given, in pixels: less than 2 has no gradient, more gains nothing.
const WINDOW_PX: (i32, i32) = (2, 10);

/// Part of a grid step, along x and along y, up to which a pixel counts for the fit, and the part tried when that
/// fails: the outermost squares of some boards are cut narrow, and dirt or a shadow may lie on a square.
const CELL_PARTS: [f64; 2] = [0.42, 0.22];
/// Pixels further from the corner than this do not count: there curved edges (lens) matter before noise does.
const REACH_PX: f64 = 8.0;
/// Pixels needed for the nine parameters.
const MIN_PIXELS: usize = 20;
const MAX_STEPS: usize = 12;
/// A step of the corner below this ends the fit: a tenth of the best that noise allows.
const CONVERGED_PX: f64 = 5e-4;
/// Blurs that a fit may end at; outside, it has found something else than a corner.
const BLUR_PX: (f64, f64) = (0.1, 4.0);
/// Below this blur an edge has the profile of a pixel's area (0.29 px of its own), not of the Gaussian in the model.
const SHARP_PX: f64 = 0.5;
/// An edge closer than this [tangent] to a row or column of pixels crosses hardly more than one of them within the window,
/// so that the wrong profile of a sharp edge does not average out: up to a tenth of a pixel, the same for all corners.
const ALIGNED: f64 = 0.1;
/// Least contrast (half the difference between dark and light) in grey levels.
const MIN_CONTRAST: f64 = 3.0;
/// Largest RMS misfit as a part of the contrast: noise of a grainy image has a tenth, an edge that does not belong to
/// the corner a third.
const MAX_MISFIT: f64 = 0.2;
/// Largest move from the start that is believed: a part of the spacing, at least that many pixels.
const MAX_MOVE: (f64, f64) = (0.12, 0.75);
/// Starts closer than this are one: the fit converges from further away.
const SAME_START_PX: f64 = 0.75;

type Parameters = SVector<f64, 9>;

/// OpenCV's gradient-orthogonality refinement, with a window matched to the squares around each corner.
pub(super) fn corner_sub_pix(image: &GrayImage, order: &Ordered) -> Result<Ordered, VisionError> {
    let mat = mat_from_gray(image)?;
    let criteria = TermCriteria { typ: TermCriteria_EPS + TermCriteria_MAX_ITER, max_count: 40, epsilon: 1e-3 };
    let mut out = order.clone();
    let window = |index: usize| {
        let spacing = order.spacing(index % order.columns, index / order.columns);
        ((WINDOW_PER_SPACING * spacing) as i32).clamp(WINDOW_PX.0, WINDOW_PX.1)
    };
    for half in WINDOW_PX.0..=WINDOW_PX.1 {
        let members: Vec<usize> = (0..order.points.len()).filter(|&i| window(i) == half).collect();
        if members.is_empty() {
            continue;
        }
        let points: Vec<Vector2<f64>> = members.iter().map(|&i| order.points[i]).collect();
        let mut refined = to_points2f(&points);
        opencv::imgproc::corner_sub_pix(&mat, &mut refined, Size::new(half, half), Size::new(-1, -1), criteria)
            .map_err(failed("refine corners"))?;
        for (&i, point) in members.iter().zip(from_points2f(&refined)) {
            out.points[i] = point;
        }
    }
    Ok(out)
}

/// Refines corners found to a pixel or so: by [`corner_sub_pix`], then by fitting the corner model.
///
/// Both `cornerSubPix`'s answer and, where that is elsewhere (its window held an edge that is not the corner's), the
/// corner as found serve as start; the fit with the smaller misfit counts. Without any fit `cornerSubPix` stands.
/// In a picture sharper than [`SHARP_PX`] corners with an edge along the pixels ([`ALIGNED`]) are finished by
/// [`saddle::refine`], which assumes no profile.
pub(super) fn refine(image: &GrayImage, found: &Ordered) -> Result<Ordered, VisionError> {
    let mut out = corner_sub_pix(image, found)?;
    let mut blurs = Vec::with_capacity(out.points.len());
    for (index, point) in out.points.iter_mut().enumerate() {
        let starts = [*point, found.points[index]];
        let apart = (starts[0] - starts[1]).norm() > SAME_START_PX;
        if let Some(fit) = fit_corner(image, found, index, if apart { &starts } else { &starts[..1] }) {
            *point = fit.corner;
            blurs.push(fit.blur_px);
        }
    }
    blurs.sort_by(f64::total_cmp);
    if blurs.get(blurs.len() / 2).is_some_and(|blur| *blur < SHARP_PX) {
        for index in 0..out.points.len() {
            let (column, row) = (index % found.columns, index / found.columns);
            let (along_x, along_y) = found.steps(column, row);
            if ![along_x, along_y].iter().any(is_aligned) {
                continue;
            }
            let spacing = found.spacing(column, row);
            if let Some(corner) = saddle::refine(image, &out.points[index], spacing) {
                out.points[index] = corner;
            }
        }
    }
    Ok(out)
}

fn is_aligned(edge: &Vector2<f64>) -> bool {
    edge.abs().min() < ALIGNED * edge.abs().max()
}

/// A fitted corner.
struct Fit {
    corner: Vector2<f64>,
    blur_px: f64,
    misfit: f64,
}

fn fit_corner(image: &GrayImage, found: &Ordered, index: usize, starts: &[Vector2<f64>]) -> Option<Fit> {
    let (column, row) = (index % found.columns, index / found.columns);
    let (along_x, along_y) = found.steps(column, row);
    let bound = (MAX_MOVE.0 * found.spacing(column, row)).max(MAX_MOVE.1);
    CELL_PARTS.into_iter().find_map(|part| {
        let fits = starts.iter().filter_map(|start| {
            let patch = Patch::around(image, *start, &along_x, &along_y, part)?;
            let (model, misfit) = fit(&patch, starting_point(&patch, &along_x, &along_y))?;
            let offset = Vector2::new(model[0], model[1]);
            (offset.norm() <= bound).then(|| Fit { corner: start + offset, blur_px: model[4], misfit })
        });
        fits.min_by(|a, b| a.misfit.total_cmp(&b.misfit))
    })
}

/// Pixels around a corner, relative to where it is thought to be.
struct Patch {
    pixels: Vec<(Vector2<f64>, f64)>,
}

impl Patch {
    /// The pixels within `part` of a step along both axes; `None` when too few or cut by the image border.
    fn around(
        image: &GrayImage,
        origin: Vector2<f64>,
        along_x: &Vector2<f64>,
        along_y: &Vector2<f64>,
        part: f64,
    ) -> Option<Self> {
        let area = along_x.perp(along_y);
        let half = (along_x.abs() + along_y.abs()) * part;
        let half = Vector2::new(half.x.min(REACH_PX), half.y.min(REACH_PX));
        let (width, height) = image.dimensions();
        let low = (origin - half).map(f64::ceil);
        let high = (origin + half).map(f64::floor);
        if low.x < 0.0 || low.y < 0.0 || high.x > f64::from(width) - 1.0 || high.y > f64::from(height) - 1.0 {
            return None;
        }
        let mut pixels = Vec::with_capacity(300);
        for v in low.y as u32..=high.y as u32 {
            for u in low.x as u32..=high.x as u32 {
                let p = Vector2::new(f64::from(u), f64::from(v)) - origin;
                let (a, b) = (p.perp(along_y) / area, along_x.perp(&p) / area);
                if a.abs() <= part && b.abs() <= part && p.norm() <= REACH_PX {
                    pixels.push((p, f64::from(image.get_pixel(u, v).0[0])));
                }
            }
        }
        (pixels.len() >= MIN_PIXELS).then_some(Self { pixels })
    }
}

/// Lines along the grid's own steps; levels from the mean intensity of the two pairs of opposite quadrants.
fn starting_point(patch: &Patch, along_x: &Vector2<f64>, along_y: &Vector2<f64>) -> Parameters {
    let normal_angle = |along: &Vector2<f64>| along.x.atan2(-along.y);
    let (mut sums, mut counts) = ([0.0; 2], [0.0; 2]);
    for (p, value) in &patch.pixels {
        let same_side = usize::from(p.perp(along_x) * p.perp(along_y) > 0.0);
        sums[same_side] += value;
        counts[same_side] += 1.0;
    }
    let mean = |i: usize| sums[i] / f64::max(counts[i], 1.0);
    // Normals are perpendicular to the steps in the same sense, so "same side" is where the product of distances is
    // positive; blur lowers the contrast seen, hence the factor.
    let contrast = 0.6 * (mean(1) - mean(0));
    Parameters::from_column_slice(&[
        0.0,
        0.0,
        normal_angle(along_x),
        normal_angle(along_y),
        0.7,
        0.5 * (mean(0) + mean(1)),
        0.0,
        0.0,
        contrast,
    ])
}

/// Levenberg–Marquardt; the parameters and the RMS misfit as a part of the contrast. `None` when it ends at something
/// that is not a corner.
fn fit(patch: &Patch, start: Parameters) -> Option<(Parameters, f64)> {
    let mut x = start;
    let (mut cost, mut hessian, mut gradient) = normal_equations(patch, &x);
    let mut damping = 1e-3;
    for _ in 0..MAX_STEPS {
        let mut damped = hessian;
        for i in 0..9 {
            damped[(i, i)] *= 1.0 + damping;
        }
        let step = damped.cholesky()?.solve(&gradient);
        let mut candidate = x - step;
        candidate[4] = candidate[4].clamp(BLUR_PX.0, BLUR_PX.1);
        let (new_cost, new_hessian, new_gradient) = normal_equations(patch, &candidate);
        if new_cost <= cost {
            (x, cost, hessian, gradient) = (candidate, new_cost, new_hessian, new_gradient);
            damping *= 0.1;
            if step[0].hypot(step[1]) < CONVERGED_PX {
                break;
            }
        } else {
            damping = f64::max(damping * 10.0, 1e-3);
            if damping > 1e3 {
                break;
            }
        }
    }
    let misfit = (cost / patch.pixels.len() as f64).sqrt() / x[8].abs();
    let lines_apart = (x[2] - x[3]).sin().abs();
    let is_corner = x[8].abs() >= MIN_CONTRAST && misfit <= MAX_MISFIT && x[4] < BLUR_PX.1 && lines_apart > 0.1;
    is_corner.then_some((x, misfit))
}

/// Sum of squared misfits, JᵀJ and Jᵀr.
fn normal_equations(patch: &Patch, x: &Parameters) -> (f64, SMatrix<f64, 9, 9>, Parameters) {
    let scale = std::f64::consts::FRAC_1_SQRT_2 / x[4];
    let (n1, n2) = (Vector2::new(x[2].cos(), x[2].sin()), Vector2::new(x[3].cos(), x[3].sin()));
    let (t1, t2) = (Vector2::new(-n1.y, n1.x), Vector2::new(-n2.y, n2.x));
    let centre = Vector2::new(x[0], x[1]);
    let contrast = x[8];
    let mut cost = 0.0;
    let mut hessian = SMatrix::<f64, 9, 9>::zeros();
    let mut gradient = Parameters::zeros();
    for (p, value) in &patch.pixels {
        let d = p - centre;
        let (s1, s2) = (n1.dot(&d) * scale, n2.dot(&d) * scale);
        let ((e1, g1), (e2, g2)) = (erf_and_slope(s1), erf_and_slope(s2));
        let light = 1.0 + x[6] * d.x + x[7] * d.y;
        let level = x[5] + contrast * e1 * e2;
        // Derivatives of the intensity by the two scaled distances.
        let (by_s1, by_s2) = (light * contrast * g1 * e2, light * contrast * e1 * g2);
        let by_centre = -(n1 * by_s1 + n2 * by_s2) * scale - Vector2::new(x[6], x[7]) * level;
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
        let residual = level * light - value;
        cost += residual * residual;
        for j in 0..9 {
            gradient[j] += row[j] * residual;
            for i in j..9 {
                hessian[(i, j)] += row[i] * row[j];
            }
        }
    }
    hessian.fill_upper_triangle_with_lower_triangle();
    (cost, hessian, gradient)
}

/// erf(x) to 1.5·10⁻⁷ and its derivative. Abramowitz & Stegun 1964, 7.1.26.
pub(crate) fn erf_and_slope(x: f64) -> (f64, f64) {
    const A: [f64; 5] = [0.254829592, -0.284496736, 1.421413741, -1.453152027, 1.061405429];
    let gauss = (-x * x).exp();
    let t = 1.0 / (1.0 + 0.3275911 * x.abs());
    let poly = t * (A[0] + t * (A[1] + t * (A[2] + t * (A[3] + t * A[4]))));
    ((1.0 - poly * gauss).copysign(x), gauss * std::f64::consts::FRAC_2_SQRT_PI)
}

#[cfg(test)]
#[path = "subpixel_tests.rs"]
mod tests;
