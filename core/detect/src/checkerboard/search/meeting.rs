//! What a pixel sees where both edges meet, beyond the product of what it sees of each.
//!
//! With `X` the place of the light within the kernel of a pixel (its area and the blur of the lens), the four squares
//! have the mean `E[sgn(s₁ + n₁·X) sgn(s₂ + n₂·X)]`. That is `E₁ E₂` only as far as `n₁·X` and `n₂·X` are independent.
//! They are correlated where the edges do not cross at a right angle, for a kernel of width `σ` by `ρ = n₁·n₂`, and then
//! (Pearson's tetrachoric series, to the third power)
//!
//! `T(σ) = 4 φ(h) φ(k) (ρ + ρ²/2 h k + ρ³/6 (h² − 1)(k² − 1))`, `h = s₁/σ`, `k = s₂/σ`
//!
//! is to be added. In addition, a pixel's area is not round. Without blur the mean is the area `A` of the quadrants, in
//! closed form, and the remainder is `A − E₁ E₂ − T`. Blur reduces it with the sixth power of `σ`: the leading term of
//! its Edgeworth series, `κ₂₂ φ'(h) φ'(k) / σ⁴`, has that at the corner. The sum is exact for no blur; for edges that
//! cross at 60° or more, the rest is at most 2 % of the contrast at any blur.

use super::edge::{Boxes, PIXEL_AREA, Place, erf_and_slope};
use super::patch::{Group, LANES};

/// Where less than this is left of the part that is not Gaussian, it is left out: a tenth of a grey level.
const LEAST_SHARE: f32 = 0.01;
/// Least component of a tangent, so that every edge crosses every side of a pixel somewhere.
const LEAST_TANGENT: f32 = 1e-6;

/// The edges where they meet.
pub(super) struct Meeting {
    centre: [f32; 2],
    t: [[f32; 2]; 2],
    blur: f32,
    /// Cosine of the angle between the edges, and its sine with a sign.
    correlation: f32,
    turn: f32,
    /// Share of the part that is not Gaussian that the blur leaves.
    share: f32,
    boxes: [Boxes; 2],
}

/// The term to be added to the product of both edges, and its derivatives.
pub(super) struct Extra {
    pub value: [f32; LANES],
    /// Derivatives by the corner (2), by the directions of the edges (2), by the blur.
    pub by: [[f32; LANES]; 5],
}

impl Meeting {
    pub fn at(place: &Place) -> Self {
        let t = place.tangents.map(|t| t.map(|c| c.abs().max(LEAST_TANGENT).copysign(c)));
        let [t1, t2] = t;
        Self {
            centre: place.centre,
            t,
            blur: place.blur,
            correlation: t1[0] * t2[0] + t1[1] * t2[1],
            turn: t1[0] * t2[1] - t1[1] * t2[0],
            share: (PIXEL_AREA as f32 / (place.blur * place.blur)).powi(3),
            boxes: t.map(Boxes::across),
        }
    }

    pub fn seen(&self, group: &Group) -> Extra {
        let nothing = [0.0; LANES];
        let mut extra = Extra { value: nothing, by: [nothing; 5] };
        self.add_correlation(group, self.blur, 1.0, &mut extra);
        // Only this one widens with the blur.
        if self.share > LEAST_SHARE {
            let (gaussian, widening) = (extra.value, extra.by[4]);
            self.add_correlation(group, (PIXEL_AREA as f32).sqrt(), -self.share, &mut extra);
            self.add_area(group, &mut extra);
            for l in 0..LANES {
                extra.by[4][l] = widening[l] - 6.0 / self.blur * (extra.value[l] - gaussian[l]);
            }
        }
        extra
    }

    /// `T` of a kernel of the given width, times `factor`.
    fn add_correlation(&self, group: &Group, blur: f32, factor: f32, extra: &mut Extra) {
        let [t1, t2] = self.t;
        let r = self.correlation;
        let (r2, r3) = (0.5 * r * r, r * r * r / 6.0);
        let inverse = 1.0 / blur;
        for l in 0..LANES {
            let (dx, dy) = (group.x[l] - self.centre[0], group.y[l] - self.centre[1]);
            let (h, k) = ((t1[0] * dy - t1[1] * dx) * inverse, (t2[0] * dy - t2[1] * dx) * inverse);
            // φ(h) is the slope of the error function at h / √2 over 2√2.
            let (_, slope_h) = erf_and_slope(h * std::f32::consts::FRAC_1_SQRT_2);
            let (_, slope_k) = erf_and_slope(k * std::f32::consts::FRAC_1_SQRT_2);
            let density = 0.5 * factor * slope_h * slope_k;
            let (h2, k2) = (h * h - 1.0, k * k - 1.0);
            let series = r + r2 * h * k + r3 * h2 * k2;
            let by_h = density * (r2 * k + 2.0 * r3 * h * k2 - h * series);
            let by_k = density * (r2 * h + 2.0 * r3 * k * h2 - k * series);
            let by_turn = density * (1.0 + r * h * k + r2 * h2 * k2) * self.turn;
            let (by_s1, by_s2) = (by_h * inverse, by_k * inverse);
            extra.value[l] += density * series;
            extra.by[0][l] += by_s1 * t1[1] + by_s2 * t2[1];
            extra.by[1][l] -= by_s1 * t1[0] + by_s2 * t2[0];
            extra.by[2][l] += by_turn - by_s1 * (t1[0] * dx + t1[1] * dy);
            extra.by[3][l] -= by_turn + by_s2 * (t2[0] * dx + t2[1] * dy);
            extra.by[4][l] -= h * by_s1 + k * by_s2;
        }
    }

    /// `A − E₁ E₂` without blur, times the share.
    fn add_area(&self, group: &Group, extra: &mut Extra) {
        let [t1, t2] = self.t;
        // Where the edges cross horizontal and vertical lines at distance one from the corner, and the sign of the pattern
        // far out on these lines.
        let (level, upright) = ([t1[0] / t1[1], t2[0] / t2[1]], [t1[1] / t1[0], t2[1] / t2[0]]);
        let far_level = self.share.copysign(t1[1] * t2[1]);
        let far_upright = self.share.copysign(t1[0] * t2[0]);
        let beside_first = (2.0 * self.share).copysign(-self.turn);
        let beside_second = -beside_first;
        for l in 0..LANES {
            let (dx, dy) = (group.x[l] - self.centre[0], group.y[l] - self.centre[1]);
            // The sign of the pattern is the same along every ray from the corner. So the area is the sum over the sides
            // of the pixel of the triangle with the corner, times the mean sign along the side.
            let along = |at: f32, from: f32, crossings: [f32; 2]| {
                let part = |c: f32| (at * c - from + 0.5).clamp(0.0, 1.0);
                1.0 - 2.0 * (part(crossings[0]) - part(crossings[1])).abs()
            };
            let horizontal = (0.5 - dy) * along(dy - 0.5, dx, level) + (0.5 + dy) * along(dy + 0.5, dx, level);
            let vertical = (0.5 - dx) * along(dx - 0.5, dy, upright) + (0.5 + dx) * along(dx + 0.5, dy, upright);
            let area = 0.5 * (far_level * horizontal + far_upright * vertical);
            let (first, second) = (chord(dx, dy, t1), chord(dx, dy, t2));
            let (s1, s2) = (t1[0] * dy - t1[1] * dx, t2[0] * dy - t2[1] * dx);
            let ((e1, slope1), (e2, slope2)) = (self.boxes[0].without_blur(s1), self.boxes[1].without_blur(s2));
            let (product1, product2) = (self.share * slope1 * e2, self.share * e1 * slope2);
            let by_s1 = beside_first * first.0 - product1;
            let by_s2 = beside_second * second.0 - product2;
            extra.value[l] += area - self.share * e1 * e2;
            extra.by[0][l] += by_s1 * t1[1] + by_s2 * t2[1];
            extra.by[1][l] -= by_s1 * t1[0] + by_s2 * t2[0];
            extra.by[2][l] += product1 * (t1[0] * dx + t1[1] * dy) - beside_first * first.1;
            extra.by[3][l] += product2 * (t2[0] * dx + t2[1] * dy) - beside_second * second.1;
        }
    }
}

/// For an edge within the pixel at `(dx, dy)` from the corner: the length beyond the corner less the one before it, and
/// the same for the first moment of the length.
#[inline]
fn chord(dx: f32, dy: f32, t: [f32; 2]) -> (f32, f32) {
    let (x, y) = (1.0 / t[0], 1.0 / t[1]);
    let (middle_x, half_x) = (dx * x, 0.5 * x.abs());
    let (middle_y, half_y) = (dy * y, 0.5 * y.abs());
    let from = (middle_x - half_x).max(middle_y - half_y);
    let to = (middle_x + half_x).min(middle_y + half_y).max(from);
    (to.abs() - from.abs(), 0.5 * (to * to.abs() - from * from.abs()))
}
