//! The image of one corner, fitted.
//!
//! Near an inner corner the board is two lines that divide dark from light crosswise. Seen through the lens by pixels
//! that have an area, the intensity is
//!
//! `I(p) = (1 + g·d) · (m + a · (E₁(s₁) E₂(s₂) + M(s₁, s₂)))`, `d = p − c`, `sₖ = nₖ·d + ½ κₖ (tₖ·d)²`
//!
//! with the corner `c`, the unit normals `n₁`, `n₂` and tangents `t₁`, `t₂` of the edges, their curvatures `κ₁`, `κ₂` (the
//! bend that a lens gives to straight lines, known from the neighbours), the mean level `m`, a relative gradient `g` of the
//! light and the signed contrast `a`. `E` is the profile of an edge ([`super::edge`]), `M` what is beyond the product where
//! the edges meet ([`super::meeting`]); both depend on the blur `σ`. All but the curvatures are fitted by
//! Levenberg–Marquardt. Pixels at either end of the scale that the model expects beyond it give no information and are left
//! out.
//!
//! The covariance is that of least squares, `s² (JᵀJ)⁻¹` with `s²` the mean square of what the fit leaves.
//!
//! A quadratic saddle (Placht et al. 2014, "ROCHADE") is the second-order expansion of this at `c`; the full model uses
//! the pixels along the edges too, where most of the information is.

use nalgebra::{Matrix2, SMatrix, Vector2};

use super::edge::{Edge, PIXEL_AREA, Place, Profile};
use super::meeting::{Extra, Meeting};
use super::patch::{BLUR, FREE, Group, LANES, Parameters, Patch, Window};

/// The first parameters change sign under half a turn about the corner: the corner (2) and the gradient of the light (2).
/// The others do not: directions of the edges (2), blur, level, contrast. Where an edge is blurred over several pixels
/// the former are independent of the latter, and their products are not summed; pixels as wide as the edge lie to one
/// side of it or the other, and there they are.
const ODD: usize = 4;
const EVEN: usize = FREE - ODD;
const PAIRS: usize = FREE * (FREE + 1) / 2;
/// Pixels are summed in this many lanes.
const SUMS: usize = 8;
/// Pixels beyond the parameters that a variance needs to mean anything.
const MIN_FREEDOM: f64 = 6.0;
const MAX_STEPS: usize = 12;
/// Part of the sum of squares that the last step may take off.
const LAST_GAIN: f64 = 0.05;
/// Part of the corner's standard deviation that a fit may leave of its way: it adds 0.1 % to the RMS of the error.
const LEFT_PART: f64 = 0.05;
/// A step that changes the blur by as much as this \[px\] gains as much as rounding takes from one pixel.
const SMALL_BLUR_PX: f64 = 0.1;
/// Part of the blur of the lens that one step may leave, and its smallest value \[px\].
const LENS_PER_STEP: f64 = 0.25;
const NO_LENS_PX: f64 = 0.05;
/// Least blur of the Gaussian profile, and least that a fit over the area of pixels starts from \[px\]: of an edge that is
/// sharper, samples a pixel apart see at most one, and its blur cannot be separated from its place.
pub(super) const SHARPEST_PX: f64 = 0.4;
/// At this blur \[px\] a fit has found something else than a corner.
const MAX_BLUR_PX: f64 = 8.0;
/// Least contrast (half the difference between dark and light) in grey levels.
const MIN_CONTRAST: f64 = 2.0;
/// Largest RMS misfit as a part of the contrast: noise of a dark, grainy image has a fifth, an edge that does not belong to
/// the corner a third.
const MAX_MISFIT: f64 = 0.3;
/// Least sine of the angle between the edges.
const MIN_ANGLE: f64 = 0.1;
/// Variance of rounding to whole grey levels, below which no residual is believed.
const ROUNDING: f64 = 1.0 / 12.0;

/// What is known about the light from elsewhere: its relative gradient [1/px] and the precision of that.
#[derive(Debug, Clone, Copy)]
pub(super) struct Light {
    pub gradient: Vector2<f64>,
    pub sd: f64,
    /// Variance of the noise \[grey levels²\].
    pub noise: f64,
}

/// A corner that was fitted.
#[derive(Debug, Clone, Copy)]
pub(super) struct Fit {
    pub px: Vector2<f64>,
    pub covariance_px2: Matrix2<f64>,
    /// Start of a further fit.
    pub parameters: Parameters,
    pub blur_px: f64,
    /// Mean level at the corner \[grey levels\].
    pub level: f64,
    /// Variance that the fit leaves \[grey levels²\].
    pub noise: f64,
}

impl Fit {
    /// The same with its blur among the parameters that a further fit starts from.
    pub fn with_its_blur(mut self) -> Self {
        self.parameters[BLUR] = self.blur_px;
        self
    }
}

/// Levenberg–Marquardt from `start`, until a step moves the corner by less than `converged_px`, each being several times
/// shorter than the one before, or leaves less of the way than noise. `None` when it ends at something that is not a corner.
pub(super) fn fit(
    patch: &Patch,
    window: &Window,
    profile: Profile,
    light: Option<&Light>,
    start: Parameters,
    converged_px: f64,
) -> Option<Fit> {
    let least_blur = match profile {
        Profile::Blurred => SHARPEST_PX,
        Profile::Pixels => PIXEL_AREA.sqrt(),
    };
    let evaluate = |x: &Parameters, is_sharp: bool| {
        let mut sums = Sums::at(patch, x, window.bend.map(|c| c as f32), profile);
        // Sharp edges along the pixels may not depend on a small change of the blur.
        sums.normal[(BLUR, BLUR)] += ROUNDING / (SMALL_BLUR_PX * SMALL_BLUR_PX);
        if let Some(light) = light {
            sums.expect(x, light);
        }
        // No image is sharper than its pixels, and samples of a Gaussian do not resolve a narrower one: a blur that would go below
        // stays where it is.
        if x[BLUR] <= least_blur && (is_sharp || sums.gradient[BLUR] > 0.0) {
            sums.hold(BLUR);
        }
        sums
    };
    let mut x = start;
    x[BLUR] = x[BLUR].max(least_blur);
    let mut is_sharp = false;
    let mut sums = evaluate(&x, is_sharp);
    let mut damping = 1e-4;
    for _ in 0..MAX_STEPS {
        let step = sums.step(damping)?;
        let mut candidate = x - step;
        candidate[BLUR] = candidate[BLUR].clamp(least_blur_after(x[BLUR], profile), MAX_BLUR_PX);
        let gain = step.dot(&sums.gradient);
        // A step shortened by the damping does not show the end.
        let is_last = step[0].hypot(step[1]) < converged_px || left_px(&x, &step) < LEFT_PART * sums.least_sd_px(gain);
        let ends = damping < 1e-2 && is_last && gain < LAST_GAIN * sums.cost;
        if ends {
            // The remaining misfit by the linear model is as good as another evaluation.
            sums.misfit = (sums.misfit - gain).max(0.0);
            return finished(window, &candidate, &sums);
        }
        let next = evaluate(&candidate, is_sharp);
        // Differences within the single precision of the sums do not justify another step.
        if next.cost <= sums.cost * (1.0 + 1e-6) {
            (x, sums) = (candidate, next);
            damping *= 0.1;
        } else if !is_sharp && x[BLUR] <= least_blur {
            // Without blur the profile has kinks, where a derivative by the blur is of little use.
            is_sharp = true;
            sums.hold(BLUR);
        } else {
            damping = f64::max(damping * 10.0, 1e-3);
            if damping > 1e3 {
                break;
            }
        }
    }
    finished(window, &x, &sums)
}

/// How far from its end a Gauss–Newton step leaves the corner \[px\], to the leading order: half a turn turns the terms of
/// second order in the corner alone into themselves, so that it is the product of its step with the relative change of
/// contrast and profile, and the third power of the step.
fn left_px(x: &Parameters, step: &Parameters) -> f64 {
    let moved = step[0].hypot(step[1]);
    let relative = |i: usize| (step[i] / x[i]).abs();
    moved * (relative(BLUR) + relative(8) + (step[4].abs() + step[5].abs()) + (moved / x[BLUR]).powi(2))
}

/// Least blur that one step may lead to: as the blur of the lens goes, pixels stop to feel an edge that is not in them, so
/// the corner has to be in its place before.
fn least_blur_after(blur: f64, profile: Profile) -> f64 {
    match profile {
        Profile::Blurred => SHARPEST_PX,
        Profile::Pixels => {
            let lens = (blur * blur - PIXEL_AREA).max(0.0).sqrt();
            if lens < NO_LENS_PX { PIXEL_AREA.sqrt() } else { (LENS_PER_STEP * lens).hypot(PIXEL_AREA.sqrt()) }
        }
    }
}

fn finished(window: &Window, x: &Parameters, sums: &Sums) -> Option<Fit> {
    let freedom = sums.count - FREE as f64;
    if freedom < MIN_FREEDOM {
        return None;
    }
    let noise = (sums.misfit / freedom).max(ROUNDING);
    let (blur_px, level, contrast) = (x[BLUR], x[7], x[8].abs());
    let is_corner = contrast >= MIN_CONTRAST
        && (sums.misfit / sums.count).sqrt() <= MAX_MISFIT * contrast
        && blur_px < MAX_BLUR_PX
        && (x[4] - x[5]).sin().abs() > MIN_ANGLE;
    if !is_corner {
        return None;
    }
    let covariance_px2 = sums.inverse()? * noise;
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
    /// Number of pixels with information.
    count: f64,
    normal: SMatrix<f64, FREE, FREE>,
    gradient: Parameters,
    /// Whether `normal` has the products of odd and even parameters.
    together: bool,
}

impl Sums {
    fn at(patch: &Patch, x: &Parameters, bend: [f32; 2], profile: Profile) -> Self {
        let model = Model::at(x, bend, profile);
        match profile {
            Profile::Blurred => Self::over::<false>(patch, &model),
            Profile::Pixels => Self::over::<true>(patch, &model),
        }
    }

    fn over<const TOGETHER: bool>(patch: &Patch, model: &Model) -> Self {
        let mut lanes = Lanes::default();
        let (both, rest) = patch.split();
        let meeting = Meeting::at(&model.place);
        for group in both {
            let mut rows = model.rows(group);
            model.add(group, &meeting.seen(group), &mut rows);
            lanes.add::<TOGETHER>(&rows);
        }
        for group in rest {
            lanes.add::<TOGETHER>(&model.rows(group));
        }
        lanes.total(TOGETHER)
    }

    /// The damped Gauss–Newton step; `None` when the pixels do not determine the parameters.
    fn step(&self, damping: f64) -> Option<Parameters> {
        let mut damped = self.normal;
        for i in 0..FREE {
            damped[(i, i)] *= 1.0 + damping;
        }
        if self.together {
            return Some(damped.cholesky()?.solve(&self.gradient));
        }
        let odd = damped.fixed_view::<ODD, ODD>(0, 0).into_owned().cholesky()?;
        let even = damped.fixed_view::<EVEN, EVEN>(ODD, ODD).into_owned().cholesky()?;
        let mut step = self.gradient;
        odd.solve_mut(&mut step.fixed_rows_mut::<ODD>(0));
        even.solve_mut(&mut step.fixed_rows_mut::<EVEN>(ODD));
        Some(step)
    }

    /// Standard deviation of the corner if all else were known \[px\], which is the least it can be, after a step that takes
    /// `gain` off the squares.
    fn least_sd_px(&self, gain: f64) -> f64 {
        let noise = ((self.misfit - gain) / self.count).max(ROUNDING);
        (noise / self.normal[(0, 0)].max(self.normal[(1, 1)])).sqrt()
    }

    /// `(JᵀJ)⁻¹` of the corner.
    fn inverse(&self) -> Option<Matrix2<f64>> {
        let corner = if self.together {
            self.normal.cholesky()?.solve(&SMatrix::<f64, FREE, 2>::identity()).fixed_view::<2, 2>(0, 0).into_owned()
        } else {
            let odd = self.normal.fixed_view::<ODD, ODD>(0, 0).into_owned().cholesky()?;
            odd.solve(&SMatrix::<f64, ODD, 2>::identity()).fixed_view::<2, 2>(0, 0).into_owned()
        };
        // Symmetric to the last bit.
        Some(0.5 * (corner + corner.transpose()))
    }

    /// Adds what is known about the light.
    fn expect(&mut self, x: &Parameters, light: &Light) {
        let weight = light.noise / (light.sd * light.sd);
        for i in 2..ODD {
            let off = x[i] - light.gradient[i - 2];
            self.cost += weight * off * off;
            self.gradient[i] += weight * off;
            self.normal[(i, i)] += weight;
        }
    }

    /// Takes a parameter as known.
    fn hold(&mut self, parameter: usize) {
        self.normal.fill_row(parameter, 0.0);
        self.normal.fill_column(parameter, 0.0);
        self.normal[(parameter, parameter)] = 1.0;
        self.gradient[parameter] = 0.0;
    }
}

/// The model at one set of parameters.
struct Model {
    place: Place,
    profile: Profile,
    gradient: [f32; 2],
    level: f32,
    contrast: f32,
}

/// Equations of a group of pixels.
struct Rows {
    by: [[f32; LANES]; FREE],
    residuals: [f32; LANES],
    weights: [f32; LANES],
}

impl Model {
    fn at(x: &Parameters, bend: [f32; 2], profile: Profile) -> Self {
        let p: [f32; FREE] = std::array::from_fn(|i| x[i] as f32);
        let tangents = [x[4], x[5]].map(|angle| [angle.cos() as f32, angle.sin() as f32]);
        let place = Place { centre: [p[0], p[1]], tangents, bend, blur: p[BLUR] };
        Self { place, profile, gradient: [p[2], p[3]], level: p[7], contrast: p[8] }
    }

    #[expect(clippy::inline_always, reason = "a call keeps the compiler from working on all lanes at once")]
    #[inline(always)]
    fn rows(&self, group: &Group) -> Rows {
        let Place { centre, tangents: [t1, t2], bend, .. } = self.place;
        let one = Edge::seen(group, &self.place, 0, self.profile);
        let two = Edge::seen(group, &self.place, 1, self.profile);
        let mut rows = Rows { by: [[0.0; LANES]; FREE], residuals: [0.0; LANES], weights: [0.0; LANES] };
        for l in 0..LANES {
            let (dx, dy) = (group.x[l] - centre[0], group.y[l] - centre[1]);
            let light = 1.0 + self.gradient[0] * dx + self.gradient[1] * dy;
            let product = one.value[l] * two.value[l];
            let shade = self.level + self.contrast * product;
            let model = shade * light;
            let level = group.level[l];
            let beyond = f32::min(level - 255.0, model - 255.0).max(f32::min(-level, -model));
            let w = if beyond >= 0.0 { 0.0 } else { group.weight[l] };
            rows.weights[l] = w;
            rows.residuals[l] = (model - level) * w;
            let k = light * self.contrast * w;
            // Derivatives of the intensity by the distances from both edges [per px].
            let (d1, d2) = (k * one.slope[l] * two.value[l], k * one.value[l] * two.slope[l]);
            let (c1, c2) = (bend[0] * one.along[l], bend[1] * two.along[l]);
            let by = w * shade;
            rows.by[0][l] = d1 * (t1[1] - c1 * t1[0]) + d2 * (t2[1] - c2 * t2[0]) - self.gradient[0] * by;
            rows.by[1][l] = -d1 * (t1[0] + c1 * t1[1]) - d2 * (t2[0] + c2 * t2[1]) - self.gradient[1] * by;
            rows.by[2][l] = by * dx;
            rows.by[3][l] = by * dy;
            rows.by[4][l] = -d1 * one.along[l];
            rows.by[5][l] = -d2 * two.along[l];
            rows.by[BLUR][l] = k * (one.widening[l] * two.value[l] + one.value[l] * two.widening[l]);
            rows.by[7][l] = w * light;
            rows.by[8][l] = w * light * product;
        }
        rows
    }

    /// Adds to the product of both edges what is seen where they meet.
    fn add(&self, group: &Group, extra: &Extra, rows: &mut Rows) {
        let centre = self.place.centre;
        for l in 0..LANES {
            let (dx, dy) = (group.x[l] - centre[0], group.y[l] - centre[1]);
            let w = rows.weights[l];
            let light = 1.0 + self.gradient[0] * dx + self.gradient[1] * dy;
            let k = light * self.contrast * w;
            let by = w * self.contrast * extra.value[l];
            rows.residuals[l] += light * by;
            rows.by[0][l] += k * extra.by[0][l] - self.gradient[0] * by;
            rows.by[1][l] += k * extra.by[1][l] - self.gradient[1] * by;
            rows.by[2][l] += by * dx;
            rows.by[3][l] += by * dy;
            rows.by[4][l] += k * extra.by[2][l];
            rows.by[5][l] += k * extra.by[3][l];
            rows.by[BLUR][l] += k * extra.by[4][l];
            rows.by[8][l] += w * light * extra.value[l];
        }
    }
}

/// Sums of products in lanes.
struct Lanes {
    squares: [f32; SUMS],
    counts: [f32; SUMS],
    pairs: [[f32; SUMS]; PAIRS],
    products: [[f32; SUMS]; FREE],
}

impl Default for Lanes {
    fn default() -> Self {
        let nothing = [0.0; SUMS];
        Self { squares: nothing, counts: nothing, pairs: [nothing; PAIRS], products: [nothing; FREE] }
    }
}

impl Lanes {
    #[expect(clippy::inline_always, reason = "a call keeps the compiler from working on all lanes at once")]
    #[inline(always)]
    fn add<const TOGETHER: bool>(&mut self, rows: &Rows) {
        add_products(&mut self.squares, &rows.residuals, &rows.residuals);
        add_products(&mut self.counts, &rows.weights, &rows.weights);
        for i in 0..FREE {
            add_products(&mut self.products[i], &rows.by[i], &rows.residuals);
            let first = if i < ODD || TOGETHER { 0 } else { ODD };
            for j in first..=i {
                add_products(&mut self.pairs[i * (i + 1) / 2 + j], &rows.by[i], &rows.by[j]);
            }
        }
    }

    fn total(&self, together: bool) -> Sums {
        let total = |lanes: &[f32; SUMS]| lanes.iter().map(|v| f64::from(*v)).sum::<f64>();
        let pair = |i: usize, j: usize| i.max(j) * (i.max(j) + 1) / 2 + i.min(j);
        let misfit = total(&self.squares);
        Sums {
            cost: misfit,
            misfit,
            count: total(&self.counts),
            normal: SMatrix::from_fn(|i, j| total(&self.pairs[pair(i, j)])),
            gradient: Parameters::from_fn(|i, _| total(&self.products[i])),
            together,
        }
    }
}

#[expect(clippy::inline_always, reason = "a call keeps the compiler from working on all lanes at once")]
#[inline(always)]
fn add_products(sums: &mut [f32; SUMS], a: &[f32; LANES], b: &[f32; LANES]) {
    let mut all = *sums;
    for (a, b) in a.chunks_exact(SUMS).zip(b.chunks_exact(SUMS)) {
        for l in 0..SUMS {
            all[l] += a[l] * b[l];
        }
    }
    *sums = all;
}

#[cfg(test)]
#[path = "fit_tests.rs"]
mod tests;
