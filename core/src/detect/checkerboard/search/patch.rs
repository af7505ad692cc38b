//! The pixels around a corner that count.

use nalgebra::{SVector, Vector2};

use super::pyramid::Level;

/// Parameters of the model of a corner: corner (2), gradient of the light (2), directions of the edges (2), blur, level,
/// contrast.
pub(super) const FREE: usize = 9;
/// Where the blur is among them.
pub(super) const BLUR: usize = 6;
/// Their values.
pub(super) type Parameters = SVector<f64, FREE>;

/// Pixels are worked on in groups of this size: loops of a length that the compiler turns into vector instructions.
pub(super) const LANES: usize = 32;
/// Pixels needed for the nine parameters.
const MIN_PIXELS: usize = 16;

/// Where a corner is thought to be, and what of its image counts.
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
    /// Pixels in the light squares further than this part of a step from both edges do not count: there something is
    /// printed.
    pub clear_part: f64,
    /// Whether the square between both steps is dark; needed with `clear_part`.
    pub dark: bool,
}

/// Pixels around a corner, relative to the window's centre, filled up to whole groups with pixels of no weight.
#[derive(Default)]
pub(super) struct Patch {
    pub groups: Vec<Group>,
    count: usize,
    /// Pixels that see both edges; they come first.
    meeting: usize,
}

#[derive(Clone, Copy)]
pub(super) struct Group {
    pub x: [f32; LANES],
    pub y: [f32; LANES],
    pub level: [f32; LANES],
    pub weight: [f32; LANES],
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
        let mut patch = Self { groups: Vec::with_capacity(40), ..Self::default() };
        for v in low.y as usize..=high.y as usize {
            let row = level.pixels.get(v * width..(v + 1) * width)?;
            let dy = v as f64 - window.centre.y;
            for (u, grey) in row.iter().enumerate().take(high.x as usize + 1).skip(low.x as usize) {
                let dx = u as f64 - window.centre.x;
                let a = (dx * along_y.y - dy * along_y.x) / area;
                let b = (along_x.x * dy - along_x.y * dx) / area;
                let off = (a.abs() * from_y, b.abs() * from_x);
                let counts = a.abs() <= window.part
                    && b.abs() <= window.part
                    && dx * dx + dy * dy <= window.reach_px * window.reach_px
                    && off.0.min(off.1) <= window.band_px
                    && (((a * b > 0.0) == window.dark) || a.abs().min(b.abs()) <= window.clear_part);
                if counts {
                    patch.push(dx as f32, dy as f32, f32::from(*grey));
                    if off.0.max(off.1) < window.meeting_px {
                        patch.last_sees_both();
                    }
                }
            }
        }
        (patch.count >= MIN_PIXELS).then_some(patch)
    }

    fn push(&mut self, dx: f32, dy: f32, level: f32) {
        let lane = self.count % LANES;
        if lane == 0 {
            self.groups.push(EMPTY);
        }
        if let Some(group) = self.groups.last_mut() {
            (group.x[lane], group.y[lane], group.level[lane], group.weight[lane]) = (dx, dy, level, 1.0);
            self.count += 1;
        }
    }

    /// Moves the last pixel to those that come first.
    fn last_sees_both(&mut self) {
        let (first, last) = (self.meeting, self.count - 1);
        let (kept, moved) = (self.pixel(first), self.pixel(last));
        self.put(first, moved);
        self.put(last, kept);
        self.meeting += 1;
    }

    fn pixel(&self, index: usize) -> [f32; 3] {
        let (group, lane) = (&self.groups[index / LANES], index % LANES);
        [group.x[lane], group.y[lane], group.level[lane]]
    }

    fn put(&mut self, index: usize, [x, y, level]: [f32; 3]) {
        let (group, lane) = (&mut self.groups[index / LANES], index % LANES);
        (group.x[lane], group.y[lane], group.level[lane]) = (x, y, level);
    }

    /// The groups with pixels that see both edges, among others, and those without.
    pub fn split(&self) -> (&[Group], &[Group]) {
        self.groups.split_at(self.meeting.div_ceil(LANES))
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
