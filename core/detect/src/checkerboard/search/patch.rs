//! The pixels around a corner that count.

use nalgebra::{SVector, Vector2};

use super::pyramid::Level;

/// Parameters of the model of a corner: corner (2), gradient of the light (2), directions of the edges (2), blur, level,
/// contrast.
pub(super) const FREE: usize = 9;
/// Index of the blur.
pub(super) const BLUR: usize = 6;
/// Their values.
pub(super) type Parameters = SVector<f64, FREE>;

/// Pixels are worked on in groups of this size: loops of a length that the compiler turns into vector instructions.
pub(super) const LANES: usize = 32;
/// Pixels needed for the nine parameters.
const MIN_PIXELS: usize = 16;

/// Assumed place of a corner, and the part of the image that is used.
#[derive(Debug, Clone, Copy)]
pub(super) struct Window {
    pub centre: Vector2<f64>,
    /// One step along x and along y of the board \[px\].
    pub along: [Vector2<f64>; 2],
    /// Curvature of the edges along x and y, positive towards the normal `(−y, x)` [1/px].
    pub bend: [f64; 2],
    /// Part of a step, along x and along y, up to which a pixel counts.
    pub part: f64,
    /// Pixels further from the corner do not count \[px\].
    pub reach_px: f64,
    /// Nor do those further than this from both edges [px]: there is nothing to see but the level.
    pub band_px: f64,
    /// Pixels closer than this to both edges \[px\] see both of them at once.
    pub meeting_px: f64,
}

/// Pixels around a corner, relative to the window's centre, filled up to whole groups with pixels of no weight.
pub(super) struct Patch {
    /// Those with pixels that see both edges, among others, come first.
    pub groups: Vec<Group>,
    /// Number of those.
    both: usize,
}

#[derive(Clone, Copy)]
pub(super) struct Group {
    pub x: [f32; LANES],
    pub y: [f32; LANES],
    pub level: [f32; LANES],
    pub weight: [f32; LANES],
}

const EMPTY: Group = Group { x: [0.0; LANES], y: [0.0; LANES], level: [0.0; LANES], weight: [0.0; LANES] };

/// Pixels as they are collected.
#[derive(Default)]
struct Pixels {
    groups: Vec<Group>,
    count: usize,
}

impl Pixels {
    #[inline]
    fn push(&mut self, [x, y, level]: [f32; 3]) {
        let lane = self.count % LANES;
        if lane == 0 {
            self.groups.push(EMPTY);
        }
        if let Some(group) = self.groups.last_mut() {
            (group.x[lane], group.y[lane], group.level[lane], group.weight[lane]) = (x, y, level, 1.0);
            self.count += 1;
        }
    }
}

/// The part of a row of the image in which a condition holds; empty where the ends are in the wrong order.
#[derive(Debug, Clone, Copy)]
struct Span {
    from: f64,
    to: f64,
}

impl Span {
    /// Where `|across.0 · x + across.1 · y| ≤ limit`.
    fn within(across: (f64, f64), y: f64, limit: f64) -> Self {
        let (middle, half) = (-across.1 * y / across.0, limit / across.0.abs());
        if middle.is_finite() && half.is_finite() {
            return Self { from: middle - half, to: middle + half };
        }
        // The row runs along the edge: all of it or nothing.
        let end = if (across.1 * y).abs() <= limit { f64::INFINITY } else { f64::NEG_INFINITY };
        Self { from: -end, to: end }
    }

    fn and(self, other: Self) -> Self {
        Self { from: self.from.max(other.from), to: self.to.min(other.to) }
    }

    /// The pixels in it, of those before `end`, when pixel 0 is at `−origin`.
    fn pixels(self, origin: f64, end: usize) -> std::ops::Range<usize> {
        let (from, beyond) = ((self.from + origin).max(0.0), (self.to + origin + 1.0).min(end as f64));
        // Casts round down; the ends of an empty span are infinite.
        if from < beyond { from as usize + usize::from(from.fract() > 0.0)..beyond as usize } else { 0..0 }
    }
}

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
        // Distances from both edges [px] are these times the place, and parts of a step the same over what a step is long.
        let (length_x, length_y) = (along_x.norm(), along_y.norm());
        let from_y = (along_y.y / length_y, -along_y.x / length_y);
        let from_x = (-along_x.y / length_x, along_x.x / length_x);
        let (part_a, part_b) = (window.part * area.abs() / length_y, window.part * area.abs() / length_x);
        let (mut both, mut rest) = (Pixels::default(), Pixels::default());
        for v in low.y as usize..=high.y as usize {
            let row = level.pixels.get(v * width..(v + 1) * width)?;
            let y = v as f64 - window.centre.y;
            let chord = (window.reach_px * window.reach_px - y * y).max(0.0).sqrt();
            let all = Span::within(from_y, y, part_a)
                .and(Span::within(from_x, y, part_b))
                .and(Span { from: -chord, to: chord });
            let near = |distance: f64| [from_y, from_x].map(|from| Span::within(from, y, distance).and(all));
            let pixels = |span: Span| span.pixels(window.centre.x, width);
            let [one, other] = near(window.band_px).map(pixels);
            let [close, close_too] = near(window.meeting_px);
            let meeting = pixels(close.and(close_too));
            // What is near one edge and, before and after that, what is near the other.
            let before = other.start..other.end.min(one.start.max(other.start));
            let after = other.start.max(one.end)..other.end;
            let parts = if one.is_empty() { [other, 0..0, 0..0] } else { [one, before, after] };
            for u in parts.into_iter().flatten() {
                let x = u as f64 - window.centre.x;
                let pixel = [x as f32, y as f32, f32::from(row[u])];
                if meeting.contains(&u) { both.push(pixel) } else { rest.push(pixel) }
            }
        }
        let count = both.count + rest.count;
        let mut groups = both.groups;
        let both = groups.len();
        groups.append(&mut rest.groups);
        (count >= MIN_PIXELS).then_some(Self { groups, both })
    }

    /// The groups with pixels that see both edges, among others, and those without.
    pub fn split(&self) -> (&[Group], &[Group]) {
        self.groups.split_at(self.both)
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
