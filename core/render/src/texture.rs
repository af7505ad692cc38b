//! Patterns on surfaces, averaged over what a pixel covers so that they do not flicker.

use std::sync::LazyLock;

use super::board::floor;

/// Width of a plank.
const PLANK_M: f64 = 0.14;
/// Size of the baked wood: texels along and across the grain, and their lengths.
const WOOD_TEXELS: [usize; 2] = [256, 1024];
const WOOD_TEXEL_M: [f64; 2] = [0.006, 4.0 * PLANK_M / 1024.0];
const WOOD_LEVELS: usize = 7;
/// Factors on the colour from 0 to this are stored as bytes.
const WOOD_RANGE: f32 = 1.5;

/// Samples of the finest level of [`GRAIN`], a power of two.
const GRAIN_SAMPLES: usize = 2048;
const GRAIN_LEVELS: usize = 8;

/// Part of the interval `x ± half` that lies in stripes of width `width` before every integer.
fn stripes(x: f64, half: f64, width: f64) -> f64 {
    let half = half.max(1e-9);
    let (low, high) = (x - half, x + half);
    let below = floor(low);
    if high - below < 1.0 - width {
        return 0.0;
    }
    let up_to = |x: f64, whole: f64| whole * width + (x - whole - (1.0 - width)).max(0.0);
    (up_to(high, floor(high)) - up_to(low, below)) / (2.0 * half)
}

/// 1 for detail much larger than a pixel, 0 for detail that a pixel would alias; `half` is in units of the detail.
fn fading(half: f64) -> f32 {
    (1.6 - 3.2 * half).clamp(0.0, 1.0) as f32
}

/// A fixed random number in ±1 for each point of a lattice.
fn lattice(i: i64, j: i64) -> f32 {
    let mut h = (i as u32).wrapping_mul(0x9E37_79B1) ^ (j as u32).wrapping_mul(0x85EB_CA77);
    h = (h ^ (h >> 15)).wrapping_mul(0x2C1B_3C6D);
    h ^= h >> 13;
    h as i32 as f32 / 2_147_483_648.0
}

/// Random numbers in ±1 along a line, and their means over 2, 4, 8… neighbours.
static GRAIN: LazyLock<Vec<Vec<f32>>> = LazyLock::new(|| {
    let mut levels = vec![(0..GRAIN_SAMPLES as i64).map(|i| lattice(i, 11)).collect::<Vec<f32>>()];
    for level in 1..GRAIN_LEVELS {
        let halved = levels[level - 1].chunks_exact(2).map(|pair| 0.5 * (pair[0] + pair[1])).collect();
        levels.push(halved);
    }
    levels
});

/// Smooth random numbers along a line, in ±1 with detail of length 1, averaged over `x ± half`.
pub(super) fn grain(x: f64, half: f64) -> f32 {
    let (fine, blend) = detail_level(2.0 * half, GRAIN_LEVELS);
    let sample = |level: usize| {
        let samples = &GRAIN[level];
        let x = x / (1u32 << level) as f64 - 0.5;
        let whole = floor(x);
        let f = (x - whole) as f32;
        let i = whole as i64 as usize & (samples.len() - 1);
        let (a, b) = (samples[i], samples[(i + 1) & (samples.len() - 1)]);
        a + (b - a) * f * f * (3.0 - 2.0 * f)
    };
    if blend == 0.0 { sample(fine) } else { sample(fine) * (1.0 - blend) + sample(fine + 1) * blend }
}

/// The finer of the two levels between which `texels` per pixel lie, and the weight of the coarser.
fn detail_level(texels: f64, levels: usize) -> (usize, f32) {
    // log2 by the bits of the float: exact at powers of two, linear between.
    let log2 = texels.max(1.0).to_bits() as f64 / (1u64 << 52) as f64 - 1023.0;
    let level = log2.min((levels - 1) as f64 - 1e-6);
    (level as usize, (level - (level as usize) as f64) as f32)
}

/// Wood at some level of detail.
#[derive(Clone, Copy)]
pub(super) struct WoodAt {
    fine: &'static Map,
    coarse: &'static Map,
    blend: f32,
}

impl WoodAt {
    /// `half` is half of what a pixel covers along and across the grain.
    pub fn new(half: [f64; 2]) -> Self {
        let texels = (2.0 * half[0] / WOOD_TEXEL_M[0]).max(2.0 * half[1] / WOOD_TEXEL_M[1]);
        let (level, blend) = detail_level(texels, WOOD_LEVELS);
        Self { fine: &WOOD[level], coarse: &WOOD[level + 1], blend }
    }

    /// Factor on the colour of planks along x.
    pub fn tone(&self, x: f64, y: f64) -> f32 {
        let at = [x * (1.0 / WOOD_TEXEL_M[0]), y * (1.0 / WOOD_TEXEL_M[1])];
        let tone = self.fine.sample(at);
        if self.blend == 0.0 { tone } else { tone * (1.0 - self.blend) + self.coarse.sample(at) * self.blend }
    }
}

/// Factor on the colour of square tiles with joints; `half` is half of what a pixel covers along x and y.
pub(super) fn tiles([x, y]: [f64; 2], half: [f64; 2], pitch_m: f64, joint_m: f64) -> f32 {
    let per_metre = 1.0 / pitch_m;
    let (x, y) = (x * per_metre, y * per_metre);
    let [x_half, y_half] = half.map(|h| h * per_metre);
    let joint = joint_m * per_metre;
    let open = (1.0 - stripes(x, x_half, joint)) * (1.0 - stripes(y, y_half, joint));
    let tone = fading(x_half.max(y_half)) * lattice(floor(x) as i64, floor(y) as i64);
    (0.7 + 0.3 * open as f32) * (1.0 + 0.03 * tone)
}

/// An image of one number per texel. It repeats mirrored, so that no seam shows.
struct Map {
    /// Texels of the finest level per texel, inverse.
    scale: f64,
    /// Texels along x; both sides are powers of two.
    width: usize,
    height: usize,
    texels: Vec<u8>,
}

impl Map {
    /// Between texels, at a place that is given in texels of level 0.
    fn sample(&self, at: [f64; 2]) -> f32 {
        let (x, y) = (at[0] * self.scale - 0.5, at[1] * self.scale - 0.5);
        let (i, j) = (floor(x), floor(y));
        let (f, g) = ((x - i) as f32, (y - j) as f32);
        let columns = [mirrored(i as i64, self.width), mirrored(i as i64 + 1, self.width)];
        let rows = [mirrored(j as i64, self.height), mirrored(j as i64 + 1, self.height)];
        let texel = |c: usize, r: usize| f32::from(self.texels[rows[r] * self.width + columns[c]]);
        let low = texel(0, 0) + (texel(1, 0) - texel(0, 0)) * f;
        let high = texel(0, 1) + (texel(1, 1) - texel(0, 1)) * f;
        (low + (high - low) * g) * (WOOD_RANGE / 255.0)
    }

    fn halved(&self) -> Self {
        let (width, height) = (self.width / 2, self.height / 2);
        let texel = |x: usize, y: usize| u32::from(self.texels[y * self.width + x]);
        let mean = |x: usize, y: usize| {
            let sum = texel(x, y) + texel(x + 1, y) + texel(x, y + 1) + texel(x + 1, y + 1);
            ((sum + 2) / 4) as u8
        };
        let texels = (0..width * height).map(|i| mean(2 * (i % width), 2 * (i / width))).collect();
        Self { scale: 0.5 * self.scale, width, height, texels }
    }
}

/// Index into `size` texels that run forth and back without end.
fn mirrored(i: i64, size: usize) -> usize {
    let i = i as usize & (2 * size - 1);
    if i < size { i } else { 2 * size - 1 - i }
}

static WOOD: LazyLock<Vec<Map>> = LazyLock::new(|| {
    let [width, height] = WOOD_TEXELS;
    let texels = (0..width * height)
        .map(|i| {
            let (x, y) = ((i % width) as f64 + 0.5, (i / width) as f64 + 0.5);
            let tone = bake_wood(x * WOOD_TEXEL_M[0], y * WOOD_TEXEL_M[1]);
            (tone * (255.0 / WOOD_RANGE)).round() as u8
        })
        .collect();
    let mut levels = vec![Map { scale: 1.0, width, height, texels }];
    for level in 1..WOOD_LEVELS {
        let halved = levels[level - 1].halved();
        levels.push(halved);
    }
    levels
});

fn bake_wood(x: f64, y: f64) -> f32 {
    let plank = floor(y / PLANK_M);
    let shift = 1000.0 * f64::from(lattice(plank as i64, 3));
    let bend = 0.009 * f64::from(grain(x * 2.6 + shift, 0.0)) + 0.002 * f64::from(grain(x * 9.0 - shift, 0.0));
    let rings = grain((y + bend) * 95.0 + shift, 0.0);
    let broad = grain((y + 2.0 * bend) * 22.0 - 0.5 * shift, 0.0);
    let pores = grain((y + bend) * 620.0 - shift, 0.0) * (0.75 + 0.25 * grain(x * 30.0 + y * 900.0, 0.0));
    let tone = 1.0 + 0.09 * rings + 0.06 * broad + 0.06 * pores + 0.05 * lattice(plank as i64, 5);
    tone * (1.0 - 0.4 * stripes(y / PLANK_M, 0.5 * WOOD_TEXEL_M[1] / PLANK_M, 0.008) as f32)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn wood(x: f64, y: f64, half: [f64; 2]) -> f32 {
        WoodAt::new(half).tone(x, y)
    }

    #[test]
    fn stripes_are_averaged_exactly() {
        // Stripes fill [0.9, 1), [1.9, 2)…
        for (x, half, expected) in
            [(0.5, 0.1, 0.0), (0.95, 0.01, 1.0), (0.9, 0.05, 0.5), (1.0, 0.2, 0.25), (7.3, 5.0, 0.1)]
        {
            assert!((stripes(x, half, 0.1) - expected).abs() < 1e-12, "{x} {half}");
        }
    }

    #[test]
    fn patterns_fade_to_their_mean_when_a_pixel_covers_much_of_them() {
        let spread = |value: &dyn Fn(f64) -> f32| {
            let values: Vec<f32> = (0..500).map(|i| value(f64::from(i) * 0.37)).collect();
            let mean = values.iter().sum::<f32>() / 500.0;
            (mean, (values.iter().map(|v| (v - mean).powi(2)).sum::<f32>() / 500.0).sqrt())
        };
        let (_, near) = spread(&|x| grain(x, 0.1));
        let (mean, far) = spread(&|x| grain(x, 60.0));
        assert!(near > 0.3 && far < 0.1 && mean.abs() < 0.1, "{near} {far} {mean}");
        let (_, near) = spread(&|x| wood(x, 1.7 * x, [1e-4, 1e-4]));
        let (mean, far) = spread(&|x| wood(x, 1.7 * x, [1.0, 1.0]));
        assert!(near > 0.04 && far < 0.04 && (mean - 1.0).abs() < 0.1, "{near} {far} {mean}");
    }

    #[test]
    fn patterns_do_not_jump() {
        for i in 0..20_000 {
            let x = f64::from(i - 10_000) * 1e-4;
            let step = wood(0.3, x + 1e-6, [1e-4, 1e-4]) - wood(0.3, x, [1e-4, 1e-4]);
            assert!(step.abs() < 5e-3, "{x}: {step}");
            assert!((wood(x + 1e-6, 0.2, [1e-4, 1e-4]) - wood(x, 0.2, [1e-4, 1e-4])).abs() < 5e-3, "{x}");
        }
    }
}
