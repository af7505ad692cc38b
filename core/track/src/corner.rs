//! One corner of a chessboard near where it is expected.
//!
//! First roughly, by the light and dark squares around it; then by fitting the corner model of
//! [`handeye_detect::checkerboard::subpixel`] with the directions of both edges taken from the expected pose. Half a turn about the
//! corner changes the image of a corner only where its place is wrong, and errors in directions, blur and contrast
//! only where it is right; so directions that are off by a degree do not move the corner, and without them the fit costs
//! a fraction of the full one.

use image::GrayImage;
use nalgebra::{SMatrix, SVector, Vector2};

use handeye_detect::checkerboard::saddle;
use handeye_detect::checkerboard::subpixel::erf_and_slope;

/// Expected position of a corner and orientation of the board there.
#[derive(Debug, Clone, Copy)]
pub(super) struct Place {
    pub px: Vector2<f64>,
    /// One step along x and along y of the board \[px\].
    pub along_x: Vector2<f64>,
    pub along_y: Vector2<f64>,
    /// Whether the square between both directions is dark.
    pub dark: bool,
}

/// A corner that is seen.
#[derive(Debug, Clone, Copy)]
pub(super) struct Found {
    pub px: Vector2<f64>,
    pub blur_px: f64,
    /// Half the difference between light and dark \[grey levels\].
    pub contrast: f64,
}

/// Samples in each of the four squares, as parts of its diagonal from the corner: clear of the blurred edges, and of the
/// next corners.
const SAMPLES: [f64; 3] = [0.14, 0.22, 0.30];
/// Least difference \[grey levels\] between the darkest light and the lightest dark square: three deviations of the noise
/// of a grainy image.
const MIN_STEP: f64 = 10.0;
/// Places with more than this part of the best difference make up the middle that counts.
const PLATEAU: f64 = 0.75;
/// Largest search step as a part of a square: a third of the plateau of the difference.
const STEP_PER_SQUARE: f64 = 0.08;

/// As in the full fit: part of a grid step up to which a pixel counts, and the part where the border of the image
/// cuts that.
const CELL_PARTS: [f64; 2] = [0.42, 0.24];
/// Pixels further from the corner do not count \[px\].
const REACH_PX: f64 = 7.0;
const MIN_PIXELS: usize = 20;
const MAX_STEPS: usize = 8;
/// A step of the corner below this ends the fit [px]: a fifth of the best that noise allows.
const CONVERGED_PX: f64 = 1e-3;
/// A single step is cut to this length [px]: beyond, the edges are not where the derivatives were taken.
const LONGEST_PX: f64 = 1.5;
const BLUR_PX: (f64, f64) = (0.25, 4.0);
/// Furthest from the start that is believed: a part of a step, at least that many pixels.
const MAX_MOVE: (f64, f64) = (0.15, 1.5);
/// The window is laid again around a corner further than this from the middle of it \[px\].
const OFF_MIDDLE_PX: f64 = 0.5;
/// Least contrast \[grey levels\], and largest misfit as a part of it, as in the full fit.
const MIN_CONTRAST: f64 = 3.0;
const MAX_MISFIT: f64 = 0.2;
/// Sharper than this, edges along the rows or columns of pixels (tangent below [`ALIGNED`]) are left to the saddle, which
/// assumes no profile; see [`handeye_detect::checkerboard::subpixel`].
const SHARP_PX: f64 = 0.5;
const ALIGNED: f64 = 0.1;

impl Place {
    /// The shorter step \[px\].
    pub fn spacing(&self) -> f64 {
        self.along_x.norm().min(self.along_y.norm())
    }

    /// Whether the board is seen from its front there, with squares of at least `least_px`.
    pub fn is_usable(&self, least_px: f64) -> bool {
        let area = self.along_x.perp(&self.along_y);
        area > 0.0 && area >= least_px * self.along_x.norm().max(self.along_y.norm())
    }

    pub fn at(&self, px: Vector2<f64>) -> Self {
        Self { px, ..*self }
    }
}

fn grey(image: &GrayImage, px: Vector2<f64>) -> Option<f64> {
    let (u, v) = (px.x + 0.5, px.y + 0.5);
    if u < 0.0 || v < 0.0 {
        return None;
    }
    let (u, v) = (u as usize, v as usize);
    let width = image.width() as usize;
    // Bounds of the row too: a column past the end would be the next row.
    if u < width { image.as_raw().get(v * width + u).map(|level| f64::from(*level)) } else { None }
}

/// How much lighter the darker of the two light squares is than the lighter of the two dark ones; `None` at the border.
fn step_between_squares(image: &GrayImage, place: &Place, at: Vector2<f64>) -> Option<f64> {
    let (first, second) = (place.along_x + place.along_y, place.along_x - place.along_y);
    let square = |direction: Vector2<f64>| {
        let mut sum = 0.0;
        for part in SAMPLES {
            sum += grey(image, at + direction * part)?;
        }
        Some(sum / SAMPLES.len() as f64)
    };
    let (a, b) = (square(first)?, square(-first)?);
    let (c, d) = (square(second)?, square(-second)?);
    Some(if place.dark { c.min(d) - a.max(b) } else { a.min(b) - c.max(d) })
}

/// Sign of the pattern at a corner that is known: positive where the square between both directions is dark.
pub(super) fn darkness(image: &GrayImage, place: &Place) -> f64 {
    let as_is = step_between_squares(image, &Place { dark: true, ..*place }, place.px).unwrap_or(0.0);
    let other = step_between_squares(image, &Place { dark: false, ..*place }, place.px).unwrap_or(0.0);
    if as_is > other { as_is.max(0.0) } else { -other.max(0.0) }
}

/// The corner within `radius_px` of where it is expected, to a pixel or so.
pub(super) fn roughly(image: &GrayImage, place: &Place, radius_px: f64) -> Option<Vector2<f64>> {
    let stride = (STEP_PER_SQUARE * place.spacing()).max(1.0);
    let count = (radius_px / stride).ceil() as i32;
    let mut all = Vec::with_capacity((2 * count + 1).pow(2) as usize);
    let mut best = MIN_STEP;
    for row in -count..=count {
        for column in -count..=count {
            let offset = Vector2::new(f64::from(column), f64::from(row)) * stride;
            if offset.norm() > radius_px + stride {
                continue;
            }
            if let Some(step) = step_between_squares(image, place, place.px + offset)
                && step >= MIN_STEP
            {
                best = best.max(step);
                all.push((offset, step));
            }
        }
    }
    let mut sum = Vector2::zeros();
    let mut weight = 0.0;
    for (offset, step) in all {
        if step >= PLATEAU * best {
            sum += offset * step;
            weight += step;
        }
    }
    (weight > 0.0).then(|| place.px + sum / weight)
}

struct Patch {
    /// Offset from the start \[px\] and grey level.
    pixels: Vec<[f64; 3]>,
}

impl Patch {
    fn around(image: &GrayImage, place: &Place, part: f64) -> Option<Self> {
        let area = place.along_x.perp(&place.along_y);
        let half = (place.along_x.abs() + place.along_y.abs()) * part;
        let half = Vector2::new(half.x.min(REACH_PX), half.y.min(REACH_PX));
        let (width, height) = image.dimensions();
        let (low, high) = ((place.px - half).map(f64::ceil), (place.px + half).map(f64::floor));
        if low.x < 0.0 || low.y < 0.0 || high.x > f64::from(width) - 1.0 || high.y > f64::from(height) - 1.0 {
            return None;
        }
        let mut pixels = Vec::with_capacity(160);
        for v in low.y as usize..=high.y as usize {
            let row = image.as_raw().get(v * width as usize..(v + 1) * width as usize)?;
            let dy = v as f64 - place.px.y;
            for (u, level) in row.iter().enumerate().take(high.x as usize + 1).skip(low.x as usize) {
                let dx = u as f64 - place.px.x;
                let a = (dx * place.along_y.y - dy * place.along_y.x) / area;
                let b = (place.along_x.x * dy - place.along_x.y * dx) / area;
                if a.abs() <= part && b.abs() <= part && dx * dx + dy * dy <= REACH_PX * REACH_PX {
                    pixels.push([dx, dy, f64::from(*level)]);
                }
            }
        }
        (pixels.len() >= MIN_PIXELS).then_some(Self { pixels })
    }
}

/// Centre (2), blur, level, contrast, relative gradient of the light (2).
type Parameters = SVector<f64, 7>;

/// The corner near `place`, to what the noise allows; `None` where there is no such corner.
pub(super) fn exactly(image: &GrayImage, place: &Place, blur_px: f64) -> Option<Found> {
    let bound = (MAX_MOVE.0 * place.spacing()).max(MAX_MOVE.1);
    let part = CELL_PARTS.into_iter().find_map(|part| Patch::around(image, place, part).map(|patch| (part, patch)));
    let (part, patch) = part?;
    let mut found = fit(&patch, place, blur_px)?;
    let moved = found.px - place.px;
    if moved.norm() > bound {
        return None;
    }
    if moved.norm() > OFF_MIDDLE_PX
        && let Some(patch) = Patch::around(image, &place.at(found.px), part)
    {
        found = fit(&patch, &place.at(found.px), found.blur_px)?;
    }
    let aligned = |along: Vector2<f64>| along.abs().min() < ALIGNED * along.abs().max();
    if found.blur_px < SHARP_PX
        && (aligned(place.along_x) || aligned(place.along_y))
        && let Some(px) = saddle::refine(image, &found.px, place.spacing())
    {
        found.px = px;
    }
    ((found.px - place.px).norm() <= bound).then_some(found)
}

/// Gauss–Newton with steps cut short.
fn fit(patch: &Patch, place: &Place, blur_px: f64) -> Option<Found> {
    // Normals of both edges; their product is positive in the squares adjacent to the one between both directions.
    let normal = |along: Vector2<f64>| Vector2::new(-along.y, along.x) / along.norm();
    let (n1, n2) = (normal(place.along_x), normal(place.along_y));
    let mut x = start(patch, &n1, &n2, blur_px);
    let mut misfit = f64::INFINITY;
    for _ in 0..MAX_STEPS {
        let sums = sums(patch, &x, &n1, &n2);
        let mut step: Parameters = -sums.hessian.cholesky()?.solve(&sums.gradient);
        // Expected residual of the model after this step.
        let left = (sums.cost + step.dot(&sums.gradient)).max(0.0);
        misfit = (left / patch.pixels.len() as f64).sqrt();
        let length = step[0].hypot(step[1]);
        if length > LONGEST_PX {
            step[0] *= LONGEST_PX / length;
            step[1] *= LONGEST_PX / length;
        }
        x += step;
        x[2] = x[2].clamp(BLUR_PX.0, BLUR_PX.1);
        if x[0].hypot(x[1]) > 2.0 * REACH_PX {
            return None;
        }
        if length < CONVERGED_PX {
            break;
        }
    }
    let contrast = if place.dark { x[4] } else { -x[4] };
    let is_corner = contrast >= MIN_CONTRAST && misfit <= MAX_MISFIT * contrast && x[2] < BLUR_PX.1;
    is_corner.then(|| Found { px: place.px + Vector2::new(x[0], x[1]), blur_px: x[2], contrast })
}

fn start(patch: &Patch, n1: &Vector2<f64>, n2: &Vector2<f64>, blur_px: f64) -> Parameters {
    let (mut total, mut counts) = ([0.0; 2], [0.0; 2]);
    for [dx, dy, level] in &patch.pixels {
        let side = usize::from((n1.x * dx + n1.y * dy) * (n2.x * dx + n2.y * dy) > 0.0);
        total[side] += level;
        counts[side] += 1.0;
    }
    let mean = |i: usize| total[i] / f64::max(counts[i], 1.0);
    // Blur lowers the contrast seen, hence more than a half.
    let contrast = 0.6 * (mean(1) - mean(0));
    let level = 0.5 * (mean(0) + mean(1));
    Parameters::from_column_slice(&[0.0, 0.0, blur_px.clamp(BLUR_PX.0, BLUR_PX.1), level, contrast, 0.0, 0.0])
}

struct Sums {
    cost: f64,
    hessian: SMatrix<f64, 7, 7>,
    gradient: Parameters,
}

fn sums(patch: &Patch, x: &Parameters, n1: &Vector2<f64>, n2: &Vector2<f64>) -> Sums {
    let [cx, cy, blur, level, contrast, gx, gy] = [x[0], x[1], x[2], x[3], x[4], x[5], x[6]];
    let scale = std::f64::consts::FRAC_1_SQRT_2 / blur;
    let mut cost = 0.0;
    let mut gradient = [0.0; 7];
    let mut lower = [0.0; 28];
    for [px, py, grey] in &patch.pixels {
        let (dx, dy) = (px - cx, py - cy);
        let (s1, s2) = ((n1.x * dx + n1.y * dy) * scale, (n2.x * dx + n2.y * dy) * scale);
        let ((e1, slope1), (e2, slope2)) = (erf_and_slope(s1), erf_and_slope(s2));
        let light = 1.0 + gx * dx + gy * dy;
        let shade = level + contrast * e1 * e2;
        let (by_s1, by_s2) = (light * contrast * slope1 * e2, light * contrast * e1 * slope2);
        let row = [
            -(n1.x * by_s1 + n2.x * by_s2) * scale - gx * shade,
            -(n1.y * by_s1 + n2.y * by_s2) * scale - gy * shade,
            -(by_s1 * s1 + by_s2 * s2) / blur,
            light,
            light * e1 * e2,
            shade * dx,
            shade * dy,
        ];
        let residual = shade * light - grey;
        cost += residual * residual;
        let mut slot = 0;
        for i in 0..7 {
            gradient[i] += row[i] * residual;
            for j in 0..=i {
                lower[slot] += row[i] * row[j];
                slot += 1;
            }
        }
    }
    let mut hessian = SMatrix::<f64, 7, 7>::zeros();
    let mut slot = 0;
    for i in 0..7 {
        for j in 0..=i {
            hessian[(i, j)] = lower[slot];
            hessian[(j, i)] = lower[slot];
            slot += 1;
        }
    }
    Sums { cost, hessian, gradient: Parameters::from_column_slice(&gradient) }
}
