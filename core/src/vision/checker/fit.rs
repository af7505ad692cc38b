//! The picture of one corner, fitted.
//!
//! Near an inner corner the board is two lines that divide dark from light crosswise. Blurred by the lens and the area
//! of the pixels, the intensity is close to
//!
//! `I(p) = (1 + g·d) · (m + a · erf(s₁ / √2 σ) · erf(s₂ / √2 σ))`, `d = p − c`, `sₖ = nₖ·d + ½ κₖ (tₖ·d)²`
//!
//! with the corner `c`, the unit normals `n₁`, `n₂` and tangents `t₁`, `t₂` of the edges, their curvatures `κ₁`, `κ₂`
//! (the bend that a lens gives to straight lines, known from the neighbours), the blur `σ`, the mean level `m`, a
//! relative gradient `g` of the light and the signed contrast `a`. All but the curvatures are fitted by
//! Levenberg–Marquardt. Pixels at either end of the scale that the model expects beyond it say nothing and are left out.
//!
//! The covariance is that of least squares, `s² (JᵀJ)⁻¹` with `s²` the mean square of what the fit leaves.
//!
//! A quadratic saddle (Placht et al. 2014, "ROCHADE") is the second-order expansion of this at `c`; the full model uses
//! the pixels along the edges too, where most of the information is.

use nalgebra::{Matrix2, SMatrix, SVector, Vector2};

use super::pyramid::Level;

/// Parameters that change sign under half a turn about the corner: the corner (2) and the gradient of the light (2).
/// The others do not: directions of the edges (2), blur, level, contrast. In a window around the corner the former say
/// nothing about the latter, so that the normal equations fall into two.
const ODD: usize = 4;
const EVEN: usize = 5;
const FREE: usize = ODD + EVEN;
const PAIRS: usize = ODD * (ODD + 1) / 2 + EVEN * (EVEN + 1) / 2;
/// Pixels are worked on in groups of this size, and summed in as many lanes: loops of a length that the compiler turns
/// into vector instructions.
const LANES: usize = 32;
const SUMS: usize = 8;
/// Pixels needed for the nine parameters.
const MIN_PIXELS: usize = 16;
/// Pixels beyond the parameters that a variance needs to mean anything.
const MIN_FREEDOM: f64 = 6.0;
const MAX_STEPS: usize = 12;
/// Part of the sum of squares that the last step may take off.
const LAST_GAIN: f64 = 0.05;
/// Blurs that a fit may take [px]: the area of a pixel alone has 0.29; at the upper end it has found something else than a
/// corner.
const BLUR_PX: (f64, f64) = (0.25, 8.0);
/// Least contrast (half the difference between dark and light) in grey levels.
const MIN_CONTRAST: f64 = 2.0;
/// Largest RMS misfit as a part of the contrast: noise of a dark, grainy image has a fifth, an edge that does not belong to
/// the corner a third.
const MAX_MISFIT: f64 = 0.3;
/// Least sine of the angle between the edges.
const MIN_ANGLE: f64 = 0.1;
/// Variance of rounding to whole grey levels, below which no residual is believed.
const ROUNDING: f64 = 1.0 / 12.0;

/// Corner, gradient of the light, directions of the edges, blur, level, contrast.
pub(super) type Parameters = SVector<f64, FREE>;

/// Where a corner is thought to be, and what of its picture counts.
#[derive(Debug, Clone, Copy)]
pub(super) struct Window {
    pub centre: Vector2<f64>,
    /// One step along x and along y of the board [px].
    pub along: [Vector2<f64>; 2],
    /// Curvature of the edges along x and y, positive towards the normal `(−y, x)` [1/px].
    pub bend: [f64; 2],
    /// Part of a step, along x and along y, up to which a pixel counts.
    pub part: f64,
    /// Pixels further from the corner do not count [px].
    pub reach_px: f64,
    /// Nor do those further than this from both edges [px]: there is nothing to see but the level.
    pub band_px: f64,
    /// Nor those in the light squares further than this part of a step from both edges: there something is printed.
    pub clear_part: f64,
    /// Whether the square between both steps is dark; needed with `clear_part`.
    pub dark: bool,
}

/// What is known about the light from elsewhere: its relative gradient [1/px] and the precision of that.
#[derive(Debug, Clone, Copy)]
pub(super) struct Light {
    pub gradient: Vector2<f64>,
    pub sd: f64,
    /// Variance of the noise [grey levels²].
    pub noise: f64,
}

/// A corner that was fitted.
#[derive(Debug, Clone, Copy)]
pub(super) struct Fit {
    pub px: Vector2<f64>,
    pub covariance_px2: Matrix2<f64>,
    /// What a further fit starts from.
    pub parameters: Parameters,
    pub blur_px: f64,
    /// Mean level at the corner [grey levels].
    pub level: f64,
    /// Variance that the fit leaves [grey levels²].
    pub noise: f64,
}

/// Pixels around a corner, relative to the window's centre, filled up to whole groups with pixels of no weight.
pub(super) struct Patch {
    groups: Vec<Group>,
    count: usize,
}

#[derive(Clone, Copy)]
struct Group {
    x: [f32; LANES],
    y: [f32; LANES],
    level: [f32; LANES],
    weight: [f32; LANES],
}

const EMPTY: Group = Group { x: [0.0; LANES], y: [0.0; LANES], level: [0.0; LANES], weight: [0.0; LANES] };

impl Patch {
    /// The pixels of a window; `None` when too few or cut by the border of the image.
    pub fn of(level: &Level, window: &Window) -> Option<Self> {
        let [along_x, along_y] = window.along;
        let area = along_x.perp(&along_y);
        let half = ((along_x.abs() + along_y.abs()) * window.part).map(|c| c.min(window.reach_px));
        let (width, height) = level.size();
        let low = (window.centre - half).map(f64::ceil);
        let high = (window.centre + half).map(f64::floor);
        let inside = low.x >= 0.0 && low.y >= 0.0 && high.x < width as f64 && high.y < height as f64;
        // Also refuses what is not a number.
        if !inside || !area.is_normal() {
            return None;
        }
        // Distances from the edges are `a` and `b` times these.
        let (from_y, from_x) = ((area / along_y.norm()).abs(), (area / along_x.norm()).abs());
        let mut patch = Self { groups: Vec::with_capacity(40), count: 0 };
        for v in low.y as usize..=high.y as usize {
            let row = level.pixels.get(v * width..(v + 1) * width)?;
            let dy = v as f64 - window.centre.y;
            for (u, grey) in row.iter().enumerate().take(high.x as usize + 1).skip(low.x as usize) {
                let dx = u as f64 - window.centre.x;
                let a = (dx * along_y.y - dy * along_y.x) / area;
                let b = (along_x.x * dy - along_x.y * dx) / area;
                let counts = a.abs() <= window.part
                    && b.abs() <= window.part
                    && dx * dx + dy * dy <= window.reach_px * window.reach_px
                    && (a.abs() * from_y).min(b.abs() * from_x) <= window.band_px
                    && (((a * b > 0.0) == window.dark) || a.abs().min(b.abs()) <= window.clear_part);
                if counts {
                    patch.push(dx, dy, *grey);
                }
            }
        }
        (patch.count >= MIN_PIXELS).then_some(patch)
    }

    fn push(&mut self, dx: f64, dy: f64, level: u8) {
        let lane = self.count % LANES;
        if lane == 0 {
            self.groups.push(EMPTY);
        }
        if let Some(group) = self.groups.last_mut() {
            group.x[lane] = dx as f32;
            group.y[lane] = dy as f32;
            group.level[lane] = f32::from(level);
            group.weight[lane] = 1.0;
            self.count += 1;
        }
    }

    /// Edges along the grid's own steps; levels from the mean intensity of the two pairs of opposite squares.
    pub fn start(&self, window: &Window, blur_px: f64) -> Parameters {
        let [along_x, along_y] = window.along.map(|v| v.map(|c| c as f32));
        let (mut sums, mut counts) = ([0.0; 2], [0.0; 2]);
        for group in &self.groups {
            for lane in 0..LANES {
                let (x, y) = (group.x[lane], group.y[lane]);
                let side = (x * along_x.y - y * along_x.x) * (x * along_y.y - y * along_y.x);
                let slot = usize::from(side > 0.0);
                sums[slot] += group.level[lane] * group.weight[lane];
                counts[slot] += group.weight[lane];
            }
        }
        let mean = |i: usize| f64::from(sums[i] / f32::max(counts[i], 1.0));
        // Both normals are a quarter turn from the steps, so that the product of the distances is positive where both
        // have one sign; blur lowers the contrast seen, hence the factor.
        let contrast = 0.6 * (mean(1) - mean(0));
        let level = 0.5 * (mean(0) + mean(1));
        let [first, second] = window.along.map(|v| v.y.atan2(v.x));
        Parameters::from_column_slice(&[0.0, 0.0, 0.0, 0.0, first, second, blur_px, level, contrast])
    }
}

/// Levenberg–Marquardt from `start`, until a step moves the corner by less than `converged_px`: each is several times
/// shorter than the one before. `None` when it ends at something that is not a corner.
pub(super) fn fit(
    patch: &Patch,
    window: &Window,
    light: Option<&Light>,
    start: Parameters,
    converged_px: f64,
) -> Option<Fit> {
    let bend = window.bend.map(|c| c as f32);
    let evaluate = |x: &Parameters| {
        let mut sums = Sums::at(patch, x, bend);
        if let Some(light) = light {
            sums.expect(x, light);
        }
        sums
    };
    let mut x = start;
    let mut sums = evaluate(&x);
    let mut damping = 1e-4;
    for _ in 0..MAX_STEPS {
        let step = sums.step(damping)?;
        let mut candidate = x - step;
        candidate[6] = candidate[6].clamp(BLUR_PX.0, BLUR_PX.1);
        let gain = step.rows(0, ODD).dot(&sums.odd_gradient) + step.rows(ODD, EVEN).dot(&sums.even_gradient);
        // A step cut short by the damping is no sign of the end.
        let ends = damping < 1e-2 && step[0].hypot(step[1]) < converged_px && gain < LAST_GAIN * sums.cost;
        if ends {
            // What the linear model says is left is as good as another look.
            sums.misfit = (sums.misfit - gain).max(0.0);
            return finished(window, &candidate, &sums);
        }
        let next = evaluate(&candidate);
        // Single precision of the sums is no reason to go on.
        if next.cost <= sums.cost * (1.0 + 1e-6) {
            (x, sums) = (candidate, next);
            damping *= 0.1;
        } else {
            damping = f64::max(damping * 10.0, 1e-3);
            if damping > 1e3 {
                break;
            }
        }
    }
    finished(window, &x, &sums)
}

fn finished(window: &Window, x: &Parameters, sums: &Sums) -> Option<Fit> {
    let freedom = sums.count - FREE as f64;
    if freedom < MIN_FREEDOM {
        return None;
    }
    let noise = (sums.misfit / freedom).max(ROUNDING);
    let (blur_px, level, contrast) = (x[6], x[7], x[8].abs());
    let is_corner = contrast >= MIN_CONTRAST
        && (sums.misfit / sums.count).sqrt() <= MAX_MISFIT * contrast
        && blur_px < BLUR_PX.1
        && (x[4] - x[5]).sin().abs() > MIN_ANGLE;
    if !is_corner {
        return None;
    }
    let inverse = sums.odd.cholesky()?.inverse();
    let covariance_px2 = inverse.fixed_view::<2, 2>(0, 0) * noise;
    let px = window.centre + Vector2::new(x[0], x[1]);
    let mut parameters = *x;
    (parameters[0], parameters[1]) = (0.0, 0.0);
    Some(Fit { px, covariance_px2, parameters, blur_px, level, noise })
}

/// Sums over the pixels at one set of parameters.
struct Sums {
    /// What is minimised, with what is expected of the light; and without.
    cost: f64,
    misfit: f64,
    /// Pixels that say something.
    count: f64,
    odd: SMatrix<f64, ODD, ODD>,
    odd_gradient: SVector<f64, ODD>,
    even: SMatrix<f64, EVEN, EVEN>,
    even_gradient: SVector<f64, EVEN>,
}

impl Sums {
    fn at(patch: &Patch, x: &Parameters, bend: [f32; 2]) -> Self {
        let p: [f32; FREE] = std::array::from_fn(|i| x[i] as f32);
        let ((sin1, cos1), (sin2, cos2)) = (x[4].sin_cos(), x[5].sin_cos());
        let (t1, t2) = ([cos1 as f32, sin1 as f32], [cos2 as f32, sin2 as f32]);
        let scale = std::f32::consts::FRAC_1_SQRT_2 / p[6];
        let mut squares = [0.0f32; SUMS];
        let mut counts = [0.0f32; SUMS];
        let mut pairs = [[0.0f32; SUMS]; PAIRS];
        let mut products = [[0.0f32; SUMS]; FREE];
        for group in &patch.groups {
            let one = Edge::seen(group, [p[0], p[1]], t1, bend[0], scale);
            let two = Edge::seen(group, [p[0], p[1]], t2, bend[1], scale);
            let mut rows = [[0.0f32; LANES]; FREE];
            let mut residuals = [0.0f32; LANES];
            let mut weights = [0.0f32; LANES];
            for l in 0..LANES {
                let (dx, dy) = (group.x[l] - p[0], group.y[l] - p[1]);
                let light = 1.0 + p[2] * dx + p[3] * dy;
                let product = one.erf[l] * two.erf[l];
                let shade = p[7] + p[8] * product;
                let model = shade * light;
                let level = group.level[l];
                let beyond = f32::min(level - 255.0, model - 255.0).max(f32::min(-level, -model));
                let w = if beyond >= 0.0 { 0.0 } else { group.weight[l] };
                weights[l] = w;
                residuals[l] = (model - level) * w;
                let k = light * p[8] * w * scale;
                // Derivatives of the intensity by the distances from both edges [per px].
                let (d1, d2) = (k * one.slope[l] * two.erf[l], k * one.erf[l] * two.slope[l]);
                let (c1, c2) = (bend[0] * one.along[l], bend[1] * two.along[l]);
                let by = w * shade;
                rows[0][l] = d1 * (t1[1] - c1 * t1[0]) + d2 * (t2[1] - c2 * t2[0]) - p[2] * by;
                rows[1][l] = -d1 * (t1[0] + c1 * t1[1]) - d2 * (t2[0] + c2 * t2[1]) - p[3] * by;
                rows[2][l] = by * dx;
                rows[3][l] = by * dy;
                rows[4][l] = -d1 * one.along[l];
                rows[5][l] = -d2 * two.along[l];
                rows[6][l] = -(d1 * one.scaled[l] + d2 * two.scaled[l]) * std::f32::consts::SQRT_2;
                rows[7][l] = w * light;
                rows[8][l] = w * light * product;
            }
            add_products(&mut squares, &residuals, &residuals);
            add_products(&mut counts, &weights, &weights);
            let mut slot = 0;
            for i in 0..FREE {
                add_products(&mut products[i], &rows[i], &residuals);
                for j in if i < ODD { 0 } else { ODD }..=i {
                    add_products(&mut pairs[slot], &rows[i], &rows[j]);
                    slot += 1;
                }
            }
        }
        let total = |lanes: &[f32; SUMS]| lanes.iter().map(|v| f64::from(*v)).sum::<f64>();
        let (odd_pairs, even_pairs) = pairs.split_at(ODD * (ODD + 1) / 2);
        let pair = |i: usize, j: usize| i.max(j) * (i.max(j) + 1) / 2 + i.min(j);
        let misfit = total(&squares);
        Self {
            cost: misfit,
            misfit,
            count: total(&counts),
            odd: SMatrix::from_fn(|i, j| total(&odd_pairs[pair(i, j)])),
            odd_gradient: SVector::from_fn(|i, _| total(&products[i])),
            even: SMatrix::from_fn(|i, j| total(&even_pairs[pair(i, j)])),
            even_gradient: SVector::from_fn(|i, _| total(&products[ODD + i])),
        }
    }

    /// The damped Gauss–Newton step; `None` when the pixels do not tell the parameters apart.
    fn step(&self, damping: f64) -> Option<Parameters> {
        let (mut odd, mut even) = (self.odd, self.even);
        for i in 0..ODD {
            odd[(i, i)] *= 1.0 + damping;
        }
        for i in 0..EVEN {
            even[(i, i)] *= 1.0 + damping;
        }
        let (odd, even) = (odd.cholesky()?.solve(&self.odd_gradient), even.cholesky()?.solve(&self.even_gradient));
        Some(Parameters::from_fn(|i, _| if i < ODD { odd[i] } else { even[i - ODD] }))
    }

    /// Adds what is known about the light.
    fn expect(&mut self, x: &Parameters, light: &Light) {
        let weight = light.noise / (light.sd * light.sd);
        for i in 2..4 {
            let off = x[i] - light.gradient[i - 2];
            self.cost += weight * off * off;
            self.odd_gradient[i] += weight * off;
            self.odd[(i, i)] += weight;
        }
    }
}

fn add_products(sums: &mut [f32; SUMS], a: &[f32; LANES], b: &[f32; LANES]) {
    let mut all = *sums;
    for (a, b) in a.chunks_exact(SUMS).zip(b.chunks_exact(SUMS)) {
        for l in 0..SUMS {
            all[l] += a[l] * b[l];
        }
    }
    *sums = all;
}

/// One edge as the pixels of a group see it.
struct Edge {
    /// Distance along the edge from the corner [px], and from the edge in units of √2 blurs.
    along: [f32; LANES],
    scaled: [f32; LANES],
    erf: [f32; LANES],
    slope: [f32; LANES],
}

impl Edge {
    // A call of its own: inlined, the compiler works on both edges of one pixel instead of one edge of many.
    #[inline(never)]
    fn seen(group: &Group, centre: [f32; 2], t: [f32; 2], bend: f32, scale: f32) -> Self {
        let nothing = [0.0; LANES];
        let mut edge = Self { along: nothing, scaled: nothing, erf: nothing, slope: nothing };
        for l in 0..LANES {
            let (dx, dy) = (group.x[l] - centre[0], group.y[l] - centre[1]);
            let along = t[0] * dx + t[1] * dy;
            let scaled = (t[0] * dy - t[1] * dx + 0.5 * bend * along * along) * scale;
            edge.along[l] = along;
            edge.scaled[l] = scaled;
            (edge.erf[l], edge.slope[l]) = erf_and_slope(scaled);
        }
        edge
    }
}

/// erf(x) to 3·10⁻⁷ (Abramowitz & Stegun 1964, 7.1.28) and its derivative, without a branch or a call.
fn erf_and_slope(x: f32) -> (f32, f32) {
    const A: [f32; 6] = [0.070_523_076, 0.042_282_01, 0.009_270_527, 0.0001520143, 0.0002765672, 0.0000430638];
    // Beyond, the power below leaves single precision.
    let t = x.abs().min(4.0);
    let p = 1.0 + t * (A[0] + t * (A[1] + t * (A[2] + t * (A[3] + t * (A[4] + t * A[5])))));
    let slope = A[0] + t * (2.0 * A[1] + t * (3.0 * A[2] + t * (4.0 * A[3] + t * (5.0 * A[4] + t * 6.0 * A[5]))));
    let inverse = 1.0 / p;
    let p2 = inverse * inverse;
    let p4 = p2 * p2;
    let p8 = p4 * p4;
    let p16 = p8 * p8;
    ((1.0 - p16).copysign(x), 16.0 * slope * p16 * inverse)
}
