//! The printed pattern and its exact integral over the footprint of a pixel.

/// Relative area below which a footprint counts as a line: the camera looks along the sheet, and the integral would
/// be a difference of rounding errors.
const FLAT: f64 = 1e-11;

/// A chessboard pattern in units of its squares: the first inner corner is (0, 0), the print covers
/// `[-1, columns] × [-1, rows]`, and the square `[0, 1] × [0, 1]` is dark. White beyond.
#[derive(Debug, Clone, Copy)]
pub(super) struct Pattern {
    columns: f64,
    rows: f64,
}

/// The parallelogram that a pixel covers on the pattern, in squares: `centre + ξ by_u + η by_v` for ξ, η in ±½.
#[derive(Debug, Clone, Copy)]
pub(super) struct Footprint {
    pub centre: [f64; 2],
    pub by_u: [f64; 2],
    pub by_v: [f64; 2],
}

impl Pattern {
    pub fn new(columns: usize, rows: usize) -> Self {
        Self { columns: columns as f64, rows: rows as f64 }
    }

    /// The part of the footprint that is dark, from 0 to 1; no sampling.
    pub fn dark_fraction(&self, footprint: &Footprint) -> f64 {
        let Footprint { centre: [s, r], by_u, by_v } = footprint;
        let half_s = 0.5 * (by_u[0].abs() + by_v[0].abs());
        let half_r = 0.5 * (by_u[1].abs() + by_v[1].abs());
        let (s_low, s_high) = (floor(s - half_s), floor(s + half_s));
        let (r_low, r_high) = (floor(r - half_r), floor(r + half_r));
        match (s_high - s_low, r_high - r_low) {
            (0.0, 0.0) => self.cell(s_low, r_low),
            (1.0, 0.0) => {
                let below = below_line(s_high - s, by_u[0], by_v[0]);
                below * self.cell(s_low, r_low) + (1.0 - below) * self.cell(s_high, r_low)
            }
            (0.0, 1.0) => {
                let below = below_line(r_high - r, by_u[1], by_v[1]);
                below * self.cell(s_low, r_low) + (1.0 - below) * self.cell(s_low, r_high)
            }
            _ => self.integral(footprint),
        }
    }

    /// 1 where a point is dark.
    pub fn at(&self, [s, r]: [f64; 2]) -> f64 {
        self.cell(floor(s), floor(r))
    }

    /// 1 where the square with this lower corner is dark.
    fn cell(&self, s: f64, r: f64) -> f64 {
        let inside = s >= -1.0 && s < self.columns && r >= -1.0 && r < self.rows;
        if inside && is_even(s + r) { 1.0 } else { 0.0 }
    }

    /// The general case by Green's theorem.
    ///
    /// Inside the print the pattern is `(1 + q(s) q(r)) / 2` with the square wave q = ±1. With w = 1 inside and 0
    /// outside, and q = 0 outside, it is `(w(s) w(r) + q(s) q(r)) / 2` everywhere, a sum of products. The integral
    /// of a product over a polygon is that of `Q(s) q(r) dr` around it, Q an antiderivative of q; along an edge
    /// the integrand is linear between grid lines, so the trapezoid rule on these pieces is exact.
    fn integral(&self, footprint: &Footprint) -> f64 {
        let Footprint { centre: [s, r], by_u, by_v } = footprint;
        let area = by_u[0] * by_v[1] - by_u[1] * by_v[0];
        let extent = (by_u[0].abs() + by_v[0].abs()) * (by_u[1].abs() + by_v[1].abs());
        let measurable = extent.is_finite() && area.abs() > FLAT * extent.max(1.0);
        if !measurable {
            return self.cell(floor(*s), floor(*r));
        }
        let vertex = |a: f64, b: f64| [s + 0.5 * (a * by_u[0] + b * by_v[0]), r + 0.5 * (a * by_u[1] + b * by_v[1])];
        let corners = [vertex(-1.0, -1.0), vertex(1.0, -1.0), vertex(1.0, 1.0), vertex(-1.0, 1.0)];
        let around: f64 = (0..4).map(|i| self.along_edge(&corners[i], &corners[(i + 1) % 4])).sum();
        (0.5 * around / area).clamp(0.0, 1.0)
    }

    /// `∫ (W(s) w(r) + Q(s) q(r)) dr` from one point straight to another.
    fn along_edge(&self, from: &[f64; 2], to: &[f64; 2]) -> f64 {
        let mut next_s = Crossings::new(from[0], to[0], self.columns);
        let mut next_r = Crossings::new(from[1], to[1], self.rows);
        let at = |axis: usize, tau: f64| from[axis] + tau * (to[axis] - from[axis]);
        let mut sum = 0.0;
        let mut tau = 0.0;
        let (mut waves, mut ramps) = (wave_area(from[0], self.columns), ramp(from[0], self.columns));
        while tau < 1.0 {
            let end = next_s.tau.min(next_r.tau).min(1.0);
            let s_end = at(0, end);
            let (waves_end, ramps_end) = (wave_area(s_end, self.columns), ramp(s_end, self.columns));
            let (sign, inside) = wave(at(1, 0.5 * (tau + end)), self.rows);
            sum += 0.5 * (end - tau) * (sign * (waves + waves_end) + inside * (ramps + ramps_end));
            (tau, waves, ramps) = (end, waves_end, ramps_end);
            next_s.pass(end);
            next_r.pass(end);
        }
        sum * (to[1] - from[1])
    }
}

/// Grid lines that a coordinate crosses on its way from one value to another.
struct Crossings {
    from: f64,
    slope: f64,
    line: f64,
    last: f64,
    /// Position of the next line on the way, 0 to 1; infinite when there is none left.
    tau: f64,
}

impl Crossings {
    /// Lines are the integers from -1 to `end`.
    fn new(from: f64, to: f64, end: f64) -> Self {
        let slope = to - from;
        let (line, last) =
            if slope > 0.0 { ((floor(from) + 1.0).max(-1.0), end) } else { ((from.ceil() - 1.0).min(end), -1.0) };
        let mut crossings = Self { from, slope, line, last, tau: f64::INFINITY };
        crossings.locate();
        crossings
    }

    fn locate(&mut self) {
        let left = (self.last - self.line) * self.slope >= 0.0;
        self.tau = if left && self.slope != 0.0 { (self.line - self.from) / self.slope } else { f64::INFINITY };
    }

    fn pass(&mut self, tau: f64) {
        if self.tau <= tau {
            self.line += self.slope.signum();
            self.locate();
        }
    }
}

/// Rounds down; unlike the method of that name it is not a library call on processors without SSE 4.1.
pub(super) fn floor(x: f64) -> f64 {
    let cut = x as i64 as f64;
    if cut > x { cut - 1.0 } else { cut }
}

fn is_even(x: f64) -> bool {
    x as i64 & 1 == 0
}

/// Part of a parallelogram on the lower side of a line at `offset` from its centre, where `a` and `b` are the
/// lengths of its two sides across the line: the distribution of a sum of two uniform variables.
fn below_line(offset: f64, a: f64, b: f64) -> f64 {
    let (long, short) = if a.abs() > b.abs() { (a.abs(), b.abs()) } else { (b.abs(), a.abs()) };
    let distance = offset.abs();
    let above = if distance <= 0.5 * (long - short) {
        0.5 - distance / long
    } else {
        let tail = (0.5 * (long + short) - distance).max(0.0);
        0.5 * tail * tail / (long * short)
    };
    if offset > 0.0 { 1.0 - above } else { above }
}

/// q and w at x.
fn wave(x: f64, end: f64) -> (f64, f64) {
    if x < -1.0 || x >= end {
        (0.0, 0.0)
    } else if is_even(floor(x)) {
        (1.0, 1.0)
    } else {
        (-1.0, 1.0)
    }
}

/// Antiderivative of q from -1.
fn wave_area(x: f64, end: f64) -> f64 {
    // A triangle wave: 0 at -1, -1 at 0, 0 at 1.
    let x = ramp(x, end);
    (x - 2.0 * floor(0.5 * x) - 1.0).abs() - 1.0
}

/// Antiderivative of w from -1.
fn ramp(x: f64, end: f64) -> f64 {
    x.clamp(-1.0, end) + 1.0
}

#[cfg(test)]
#[path = "board_tests.rs"]
mod tests;
