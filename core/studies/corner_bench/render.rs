//! Chessboards as a camera sees them, with the exact area of every pixel and known corners.
//!
//! Pixels are cut along the lines between squares in the undistorted image; the lens blur is a Gaussian on top.

use handeye_core::image::{GrayImage, Luma};
use nalgebra::{Isometry3, Matrix3, Point3, Rotation3, Translation3, Unit, UnitQuaternion, Vector2, Vector3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, Normal};

/// What is varied.
#[derive(Debug, Clone, Copy)]
pub struct Look {
    pub size: (u32, u32),
    pub focal_px: f64,
    /// Radial distortion: `r (1 + k r²)` in units of the focal length.
    pub radial: f64,
    pub columns: usize,
    pub rows: usize,
    /// Middle size of a square \[px\].
    pub square_px: f64,
    pub max_tilt: f64,
    pub blur_px: f64,
    pub noise: f64,
    pub dark: f64,
    pub light: f64,
    /// Change of the light across the width of the image, as a part of it.
    pub fall: f64,
}

impl Look {
    /// The scene of the published figures: 640×480, f = 581 px, 10×7 corners, 17 px squares.
    pub fn published(blur_px: f64, noise: f64) -> Self {
        Self {
            size: (640, 480),
            focal_px: 581.0,
            radial: 0.0,
            columns: 10,
            rows: 7,
            square_px: 17.4,
            max_tilt: 0.7,
            blur_px,
            noise,
            dark: 45.0,
            light: 205.0,
            fall: 0.0,
        }
    }
}

pub struct Image {
    pub image: GrayImage,
    pub truth: Vec<Vector2<f64>>,
}

/// A view of the board from a random side; squares vary by a fifth either way.
pub fn view(look: &Look, seed: u64) -> Image {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let distance = look.focal_px / look.square_px * rng.random_range(0.8..1.2);
    let azimuth = rng.random_range(0.0..std::f64::consts::TAU);
    let axis = Unit::new_normalize(Vector3::new(f64::cos(azimuth), f64::sin(azimuth), 0.0));
    let tilt = Rotation3::from_axis_angle(&axis, rng.random_range(0.0..look.max_tilt));
    let pi = std::f64::consts::PI;
    let turn = Rotation3::from_axis_angle(&Vector3::z_axis(), rng.random_range(-pi..pi));
    let offset = Vector2::new(rng.random_range(-0.08..0.08), rng.random_range(-0.08..0.08));
    let at = Vector3::new(offset.x, offset.y, 1.0) * distance;
    let centre = Vector3::new((look.columns as f64 - 1.0) / 2.0, (look.rows as f64 - 1.0) / 2.0, 0.0);
    let camera_from_board =
        Isometry3::from_parts(Translation3::from(at), UnitQuaternion::from_rotation_matrix(&(turn * tilt)))
            * Translation3::from(-centre);
    let truth = (0..look.columns * look.rows)
        .map(|i| {
            project(look, &(camera_from_board * Point3::new((i % look.columns) as f64, (i / look.columns) as f64, 0.0)))
        })
        .collect();
    Image { image: render(look, &camera_from_board, &mut rng), truth }
}

fn project(look: &Look, p: &Point3<f64>) -> Vector2<f64> {
    let flat = Vector2::new(p.x / p.z, p.y / p.z);
    flat * (1.0 + look.radial * flat.norm_squared()) * look.focal_px + middle(look)
}

fn middle(look: &Look) -> Vector2<f64> {
    Vector2::new(f64::from(look.size.0) - 1.0, f64::from(look.size.1) - 1.0) / 2.0
}

/// The undistorted place of a pixel, by fixed-point iteration.
fn undistorted(look: &Look, px: Vector2<f64>) -> Vector2<f64> {
    let seen = (px - middle(look)) / look.focal_px;
    let mut flat = seen;
    if look.radial != 0.0 {
        for _ in 0..30 {
            flat = seen / (1.0 + look.radial * flat.norm_squared());
        }
    }
    flat
}

fn render(look: &Look, camera_from_board: &Isometry3<f64>, rng: &mut ChaCha8Rng) -> GrayImage {
    let (width, height) = (look.size.0 as usize, look.size.1 as usize);
    let r = camera_from_board.rotation.to_rotation_matrix().into_inner();
    let columns = [r.column(0).into_owned(), r.column(1).into_owned(), camera_from_board.translation.vector];
    let board_from_flat = Matrix3::from_columns(&columns).try_inverse().expect("not seen edge-on");
    let lattice: Vec<Vector2<f64>> = (0..(width + 1) * (height + 1))
        .map(|i| undistorted(look, Vector2::new((i % (width + 1)) as f64 - 0.5, (i / (width + 1)) as f64 - 0.5)))
        .collect();
    let mut levels = vec![0.0; width * height];
    for v in 0..height {
        for u in 0..width {
            let corner = |du: usize, dv: usize| lattice[(v + dv) * (width + 1) + u + du];
            let pixel = [corner(0, 0), corner(1, 0), corner(1, 1), corner(0, 1)];
            let dark = dark_area(look, &board_from_flat, &pixel) / area(&pixel);
            let light = 1.0 + look.fall * (u as f64 / width as f64 - 0.5);
            levels[v * width + u] = (look.light + (look.dark - look.light) * dark) * light;
        }
    }
    blur(&mut levels, width, height, look.blur_px);
    let noise = Normal::new(0.0, look.noise).expect("a deviation");
    GrayImage::from_fn(look.size.0, look.size.1, |u, v| {
        Luma([(levels[v as usize * width + u as usize] + noise.sample(rng)).round().clamp(0.0, 255.0) as u8])
    })
}

fn on_board(h: &Matrix3<f64>, p: &Vector2<f64>) -> Vector2<f64> {
    let b = h * Vector3::new(p.x, p.y, 1.0);
    Vector2::new(b.x / b.z, b.y / b.z)
}

fn is_dark(look: &Look, b: &Vector2<f64>) -> bool {
    let (c, r) = (b.x.floor() as i64, b.y.floor() as i64);
    let inside = c >= -1 && r >= -1 && c < look.columns as i64 && r < look.rows as i64;
    inside && (c + r).rem_euclid(2) == 0
}

fn dark_area(look: &Look, h: &Matrix3<f64>, polygon: &[Vector2<f64>]) -> f64 {
    if polygon.len() < 3 {
        return 0.0;
    }
    for axis in 0..2 {
        let values = polygon.iter().map(|p| on_board(h, p)[axis]);
        let (low, high) = values.fold((f64::MAX, f64::MIN), |(low, high), v| (low.min(v), high.max(v)));
        let line = (low + 1e-9).ceil();
        let outermost = [look.columns, look.rows][axis] as f64;
        if line < high - 1e-9 && line >= -1.0 && line <= outermost {
            let cut = h.row(axis) - h.row(2) * line;
            let side = |p: &Vector2<f64>| cut[0] * p.x + cut[1] * p.y + cut[2];
            let (one, other) = (clip(polygon, &side), clip(polygon, &|p| -side(p)));
            return dark_area(look, h, &one) + dark_area(look, h, &other);
        }
    }
    let centre = polygon.iter().sum::<Vector2<f64>>() / polygon.len() as f64;
    if is_dark(look, &on_board(h, &centre)) { area(polygon) } else { 0.0 }
}

/// The part of a convex polygon where `side` is positive.
fn clip(polygon: &[Vector2<f64>], side: &dyn Fn(&Vector2<f64>) -> f64) -> Vec<Vector2<f64>> {
    let mut out = Vec::with_capacity(polygon.len() + 1);
    for (i, a) in polygon.iter().enumerate() {
        let b = &polygon[(i + 1) % polygon.len()];
        let (sa, sb) = (side(a), side(b));
        if sa >= 0.0 {
            out.push(*a);
        }
        if sa * sb < 0.0 {
            out.push(a + (b - a) * (sa / (sa - sb)));
        }
    }
    out
}

fn area(polygon: &[Vector2<f64>]) -> f64 {
    let n = polygon.len();
    0.5 * (0..n).map(|i| polygon[i].perp(&polygon[(i + 1) % n])).sum::<f64>().abs()
}

fn blur(levels: &mut [f64], width: usize, height: usize, sigma: f64) {
    if sigma <= 0.0 {
        return;
    }
    let reach = (5.0 * sigma).ceil() as i64;
    let weights: Vec<f64> = (-reach..=reach).map(|i| (-0.5 * (i as f64 / sigma).powi(2)).exp()).collect();
    let total: f64 = weights.iter().sum();
    for (count, stride, lines, line_stride) in [(width, 1, height, width), (height, width, width, 1)] {
        let mut line_levels = vec![0.0; count];
        for line in 0..lines {
            for (i, level) in line_levels.iter_mut().enumerate() {
                *level = levels[line * line_stride + i * stride];
            }
            for i in 0..count {
                let sum: f64 = weights
                    .iter()
                    .zip(-reach..)
                    .map(|(w, offset)| w * line_levels[(i as i64 + offset).clamp(0, count as i64 - 1) as usize])
                    .sum();
                levels[line * line_stride + i * stride] = sum / total;
            }
        }
    }
}
