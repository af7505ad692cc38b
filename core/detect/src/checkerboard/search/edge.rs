//! The profile of one edge as pixels see it.
//!
//! A pixel takes the mean of the light over its area, a unit square. Seen along an edge with the normal `n`, that square is
//! a box of width |nx| spread over a box of width |ny|. A step from −1 to 1 that the lens has blurred by a Gaussian of
//! width `l` is therefore, at the distance `s` from it, the second difference
//!
//! `E(s) = (G(s + p) − G(s + q) − G(s − q) + G(s − p)) / |nx ny|`, `p, q = (|nx| ± |ny|) / 2`, `G'' = erf(· / √2 l)`,
//!
//! for no blur the exact area. Its variance is `σ² = l² + 1/12` for any direction; that `σ` is called blur. Where it is
//! large, `erf(s / √2 σ)` is the same and takes a quarter of the time: the difference is that of the fourth cumulants, at
//! most `2 · 0.55 / (24 · 120 σ⁴)` of the contrast.

use super::patch::{Group, LANES};

/// Variance of the area of a pixel \[px²\], in any direction.
pub(super) const PIXEL_AREA: f64 = 1.0 / 12.0;
/// Smallest blur of the lens that is distinguished from none [px]: there an edge along the pixels has moved no grey
/// level by as much as one in full contrast.
const LEAST_LENS_PX: f32 = 0.01;
/// Least width of the narrower box: it keeps the second difference clear of rounding in single precision, and nothing is
/// as sharp as that.
const LEAST_BOX_PX: f32 = 0.01;
/// Blurs of the lens beyond which an edge is not seen.
const UNSEEN: f32 = 4.5;

/// The model of an edge.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Profile {
    /// Gaussian, of lens and pixel together.
    Blurred,
    /// Gaussian of the lens, integrated over the pixel.
    Pixels,
}

/// Both edges and their corner, as far as their places are concerned.
#[derive(Debug, Clone, Copy)]
pub(super) struct Place {
    pub centre: [f32; 2],
    /// Unit vectors along both edges.
    pub tangents: [[f32; 2]; 2],
    pub bend: [f32; 2],
    pub blur: f32,
}

/// One edge as the pixels of a group see it.
pub(super) struct Edge {
    /// Distance along the edge from the corner \[px\].
    pub along: [f32; LANES],
    /// The image of a step from −1 to 1, and its derivatives by the distance and by the blur [1/px].
    pub value: [f32; LANES],
    pub slope: [f32; LANES],
    pub widening: [f32; LANES],
}

impl Edge {
    pub fn seen(group: &Group, place: &Place, which: usize, profile: Profile) -> Self {
        match profile {
            Profile::Blurred => {
                Self::blurred(group, place.centre, place.tangents[which], place.bend[which], place.blur)
            }
            Profile::Pixels => {
                Self::in_pixels(group, place.centre, place.tangents[which], place.bend[which], place.blur)
            }
        }
    }

    // A separate call: inlined, the compiler works on both edges of one pixel instead of one edge of many.
    #[inline(never)]
    fn blurred(group: &Group, centre: [f32; 2], t: [f32; 2], bend: f32, blur: f32) -> Self {
        let nothing = [0.0; LANES];
        let mut edge = Self { along: nothing, value: nothing, slope: nothing, widening: nothing };
        let scale = std::f32::consts::FRAC_1_SQRT_2 / blur;
        for l in 0..LANES {
            let (along, off) = from_corner(group, centre, t, bend, l);
            let scaled = off * scale;
            let (erf, slope) = erf_and_slope(scaled);
            edge.along[l] = along;
            edge.value[l] = erf;
            edge.slope[l] = slope * scale;
            edge.widening[l] = slope * scaled * (-1.0 / blur);
        }
        edge
    }

    #[inline(never)]
    fn in_pixels(group: &Group, centre: [f32; 2], t: [f32; 2], bend: f32, blur: f32) -> Self {
        let nothing = [0.0; LANES];
        let mut edge = Self { along: nothing, value: nothing, slope: nothing, widening: nothing };
        let boxes = Boxes::across(t);
        let lens = (blur * blur - PIXEL_AREA as f32).max(LEAST_LENS_PX * LEAST_LENS_PX).sqrt();
        let scale = std::f32::consts::FRAC_1_SQRT_2 / lens;
        let reach = boxes.outer + UNSEEN * lens;
        let mut off = nothing;
        for (l, off) in off.iter_mut().enumerate() {
            let (along, from) = from_corner(group, centre, t, bend, l);
            edge.along[l] = along;
            *off = from.clamp(-reach, reach);
        }
        for (shift, sign) in boxes.terms() {
            for (l, off) in off.iter().enumerate() {
                let x = off + shift;
                let (erf, slope) = erf_and_slope(x * scale);
                let tail = slope * lens * std::f32::consts::FRAC_1_SQRT_2;
                edge.value[l] += sign * 0.5 * ((x * x + lens * lens) * erf + x * tail);
                edge.slope[l] += sign * (x * erf + tail);
                // The heat equation: the derivative by half the variance is the second by the distance.
                edge.widening[l] += sign * blur * erf;
            }
        }
        edge
    }
}

/// Distances of a pixel along an edge and across it.
#[inline]
fn from_corner(group: &Group, centre: [f32; 2], t: [f32; 2], bend: f32, l: usize) -> (f32, f32) {
    let (dx, dy) = (group.x[l] - centre[0], group.y[l] - centre[1]);
    let along = t[0] * dx + t[1] * dy;
    (along, t[0] * dy - t[1] * dx + 0.5 * bend * along * along)
}

/// The two boxes that a pixel is across an edge.
#[derive(Debug, Clone, Copy)]
pub(super) struct Boxes {
    /// Half the sum and half the difference of their widths \[px\].
    outer: f32,
    inner: f32,
    /// One over the product of their widths.
    height: f32,
}

impl Boxes {
    /// For an edge with the unit tangent `t`.
    pub fn across(t: [f32; 2]) -> Self {
        let (wide, narrow) = (t[0].abs().max(t[1].abs()), t[0].abs().min(t[1].abs()).max(LEAST_BOX_PX));
        Self { outer: 0.5 * (wide + narrow), inner: 0.5 * (wide - narrow), height: 1.0 / (wide * narrow) }
    }

    /// Shifts and factors of the second difference.
    fn terms(&self) -> [(f32, f32); 4] {
        [(self.outer, self.height), (self.inner, -self.height), (-self.inner, -self.height), (-self.outer, self.height)]
    }

    /// `E` and its slope for no blur at all.
    #[inline]
    pub fn without_blur(&self, off: f32) -> (f32, f32) {
        let off = off.clamp(-self.outer, self.outer);
        let (mut value, mut slope) = (0.0, 0.0);
        for (shift, sign) in self.terms() {
            let x = off + shift;
            value += sign * 0.5 * x * x.abs();
            slope += sign * x.abs();
        }
        (value, slope)
    }
}

/// erf(x) to 3·10⁻⁷ (Abramowitz & Stegun 1964, 7.1.28) and its derivative, without a branch or a call.
#[inline]
pub(super) fn erf_and_slope(x: f32) -> (f32, f32) {
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
