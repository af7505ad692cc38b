//! Images in which there is no board, or not all of one.

use handeye_geometry::targets::Grid;
use handeye_geometry::targets::observation::Corner;
use image::{GrayImage, Luma};
use nalgebra::Vector2;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, Normal};

use crate::render::{Look, view};

/// An image by the size and a seed.
pub struct Scene {
    pub name: &'static str,
    pub image: fn((u32, u32), u64) -> GrayImage,
}

/// What is searched for in all of them.
pub const GRID: Grid = Grid { columns: 10, rows: 7, square_m: 1.0 };

pub const SCENES: [Scene; 8] = [
    Scene { name: "wall, noise 2", image: |size, seed| wall(size, 2.0, seed) },
    Scene { name: "wall, noise 10", image: |size, seed| wall(size, 10.0, seed) },
    Scene { name: "noise from black to white", image: static_noise },
    Scene { name: "texture", image: texture },
    Scene { name: "clutter of rectangles", image: clutter },
    Scene { name: "brick wall", image: bricks },
    Scene { name: "a board of 10×6", image: |size, seed| board(size, 6, 0.0, seed) },
    Scene { name: "a board cut by the border", image: |size, seed| board(size, 7, 0.42, seed) },
];

fn with_noise(image: &mut GrayImage, deviation: f64, rng: &mut ChaCha8Rng) {
    let noise = Normal::new(0.0, deviation).expect("a deviation");
    for pixel in image.pixels_mut() {
        pixel.0[0] = (f64::from(pixel.0[0]) + noise.sample(rng)).round().clamp(0.0, 255.0) as u8;
    }
}

/// Light that falls off, and noise.
fn wall((width, height): (u32, u32), noise: f64, seed: u64) -> GrayImage {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut image = GrayImage::from_fn(width, height, |u, v| Luma([(100 + 60 * u / width + 30 * v / height) as u8]));
    with_noise(&mut image, noise, &mut rng);
    image
}

fn static_noise((width, height): (u32, u32), seed: u64) -> GrayImage {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    GrayImage::from_fn(width, height, |_, _| Luma([rng.random()]))
}

/// Random levels on lattices of 1024 to 2 px, interpolated smoothly, each half as strong as the one before it: contrast
/// that falls with the frequency as in natural images.
fn texture((width, height): (u32, u32), seed: u64) -> GrayImage {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut sum = vec![0f32; (width * height) as usize];
    for octave in 0..10 {
        let step = 1024u32 >> octave;
        let amplitude = 400.0 * 0.6f32.powi(octave);
        let columns = width / step + 2;
        let levels: Vec<f32> = (0..columns * (height / step + 2)).map(|_| rng.random::<f32>() - 0.5).collect();
        for (i, out) in sum.iter_mut().enumerate() {
            let (u, v) = (i as u32 % width, i as u32 / width);
            let at = |dx, dy| levels[((v / step + dy) * columns + u / step + dx) as usize];
            let smooth = |x: f32| x * x * (3.0 - 2.0 * x);
            let (fx, fy) = (smooth((u % step) as f32 / step as f32), smooth((v % step) as f32 / step as f32));
            let (upper, lower) = (at(0, 0) * (1.0 - fx) + at(1, 0) * fx, at(0, 1) * (1.0 - fx) + at(1, 1) * fx);
            *out += amplitude * (upper * (1.0 - fy) + lower * fy);
        }
    }
    let mut image = GrayImage::from_fn(width, height, |u, v| {
        Luma([(128.0 + sum[(v * width + u) as usize]).round().clamp(0.0, 255.0) as u8])
    });
    with_noise(&mut image, 2.0, &mut rng);
    image
}

/// Four hundred rectangles of all sizes, directions and levels, one over the other.
fn clutter((width, height): (u32, u32), seed: u64) -> GrayImage {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut image = GrayImage::from_pixel(width, height, Luma([128]));
    for _ in 0..400 {
        let middle = Vector2::new(rng.random_range(0.0..f64::from(width)), rng.random_range(0.0..f64::from(height)));
        let mut side = || f64::from(width) * 0.15 * rng.random_range(0.1f64..1.0).powi(2);
        let (long, wide) = (side(), side());
        let (sin, cos) = rng.random_range(0.0..std::f64::consts::TAU).sin_cos();
        let level = Luma([rng.random()]);
        let reach = long.hypot(wide);
        let range = |c: f64, end: u32| (c - reach).max(0.0) as u32..((c + reach).max(0.0) as u32).min(end);
        for v in range(middle.y, height) {
            for u in range(middle.x, width) {
                let d = Vector2::new(f64::from(u), f64::from(v)) - middle;
                if (cos * d.x + sin * d.y).abs() < long && (cos * d.y - sin * d.x).abs() < wide {
                    image.put_pixel(u, v, level);
                }
            }
        }
    }
    let mut image = halved_and_back(&image);
    with_noise(&mut image, 2.0, &mut rng);
    image
}

/// A little blur: the mean of 2×2 pixels.
fn halved_and_back(image: &GrayImage) -> GrayImage {
    let at = |u: u32, v: u32| u32::from(image.get_pixel(u.min(image.width() - 1), v.min(image.height() - 1)).0[0]);
    GrayImage::from_fn(image.width(), image.height(), |u, v| {
        Luma([((at(u, v) + at(u + 1, v) + at(u, v + 1) + at(u + 1, v + 1) + 2) / 4) as u8])
    })
}

/// Rows of bricks in two shades, every other row shifted by half a brick: a lattice of corners that is not a
/// chessboard.
fn bricks((width, height): (u32, u32), seed: u64) -> GrayImage {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let (long, tall) = (width / 24, width / 48);
    let shades: Vec<u8> = (0..10_000).map(|_| rng.random_range(60..200)).collect();
    let mut image = GrayImage::from_fn(width, height, |u, v| {
        let row = v / tall;
        let shifted = u + (row % 2) * long / 2;
        if v % tall < tall / 8 || shifted % long < tall / 8 {
            return Luma([210]);
        }
        Luma([shades[((row * 37 + shifted / long) as usize) % shades.len()]])
    });
    with_noise(&mut image, 2.0, &mut rng);
    image
}

/// A board, shifted by a fraction of the width.
fn board(size: (u32, u32), rows: usize, moved: f64, seed: u64) -> GrayImage {
    let scale = f64::from(size.0) / 640.0;
    let usual = Look::published(0.7, 2.0);
    let look = Look { size, focal_px: usual.focal_px * scale, square_px: usual.square_px * scale, rows, ..usual };
    view(&Look { moved: moved * f64::from(size.0) / look.focal_px, ..look }, seed).image
}

/// The image with its board painted over, including two squares around it, with the levels left and right of that.
pub fn painted_over(image: &GrayImage, corners: &[Corner], grid: &Grid) -> GrayImage {
    let at = |column: usize, row: usize| corners[row * grid.columns + column].px;
    let (last_column, last_row) = (grid.columns - 1, grid.rows - 1);
    // The outermost corners, moved outwards by two steps along both sides.
    let out = |c: usize, r: usize, dc: isize, dr: isize| {
        let inner = at(c.saturating_add_signed(-dc), r.saturating_add_signed(-dr));
        at(c, r) + (at(c, r) - inner) * 2.5
    };
    let hull =
        [out(0, 0, -1, -1), out(last_column, 0, 1, -1), out(last_column, last_row, 1, 1), out(0, last_row, -1, 1)];
    let mut painted = image.clone();
    for v in 0..image.height() {
        let y = f64::from(v);
        let crossings: Vec<f64> = (0..4)
            .map(|i| (hull[i], hull[(i + 1) % 4]))
            .filter(|(a, b)| (a.y <= y) != (b.y <= y))
            .map(|(a, b)| a.x + (b.x - a.x) * (y - a.y) / (b.y - a.y))
            .collect();
        let [one, other] = crossings[..] else { continue };
        let clamp = |x: f64| x.clamp(0.0, f64::from(image.width() - 1)) as u32;
        let (left, right) = (clamp(one.min(other)), clamp(one.max(other)));
        let (from, to) = (f64::from(image.get_pixel(left, v).0[0]), f64::from(image.get_pixel(right, v).0[0]));
        for u in left..=right {
            let part = f64::from(u - left) / f64::from((right - left).max(1));
            painted.put_pixel(u, v, Luma([(from + (to - from) * part) as u8]));
        }
    }
    painted
}
