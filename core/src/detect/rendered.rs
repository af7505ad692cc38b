//! Chessboards rendered with exact coverage of every pixel, for tests that need the truth.

use image::{GrayImage, Luma};
use nalgebra::{Isometry3, Matrix3, Vector2, Vector3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, Normal};

use crate::geometry::camera::Intrinsics;
use crate::geometry::planar_pose::simulated::looking_at;
use crate::targets::Grid;

/// An image of a chessboard by a pinhole camera.
pub(crate) struct Scene {
    pub camera: Intrinsics,
    pub grid: Grid,
    pub camera_from_target: Isometry3<f64>,
    /// Standard deviation of the lens blur in pixels, on top of the pixel's own area.
    pub blur_px: f64,
    /// Standard deviation of the noise in grey levels.
    pub noise: f64,
    pub dark: f64,
    pub light: f64,
    /// Whether the square between the first four corners is dark.
    pub first_dark: bool,
}

impl Scene {
    pub fn new(camera: Intrinsics, grid: Grid, camera_from_target: Isometry3<f64>) -> Self {
        Self { camera, grid, camera_from_target, blur_px: 0.7, noise: 0.0, dark: 45.0, light: 205.0, first_dark: true }
    }

    /// Where the corners are.
    pub fn truth(&self) -> Vec<Vector2<f64>> {
        (0..self.grid.len())
            .map(|i| self.camera.project(&(self.camera_from_target * self.grid.point(i))).expect("in front"))
            .collect()
    }

    pub fn render(&self, seed: u64) -> GrayImage {
        let (width, height) = (self.camera.width as usize, self.camera.height as usize);
        let board_from_image = self.board_from_image();
        let mut levels = vec![0.0; width * height];
        for v in 0..height {
            for u in 0..width {
                let dark = self.dark_part(&board_from_image, u as f64, v as f64);
                levels[v * width + u] = self.light + (self.dark - self.light) * dark;
            }
        }
        blur(&mut levels, width, height, self.blur_px);
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let noise = Normal::new(0.0, self.noise).expect("a deviation");
        GrayImage::from_fn(self.camera.width, self.camera.height, |u, v| {
            let level = levels[v as usize * width + u as usize] + noise.sample(&mut rng);
            Luma([level.round().clamp(0.0, 255.0) as u8])
        })
    }

    /// Homography to squares: an inner corner (c, r) is at (c, r).
    fn board_from_image(&self) -> Matrix3<f64> {
        let r = self.camera_from_target.rotation.to_rotation_matrix().into_inner();
        let s = self.grid.square_m;
        let columns = [r.column(0) * s, r.column(1) * s, self.camera_from_target.translation.vector];
        (self.camera.matrix() * Matrix3::from_columns(&columns)).try_inverse().expect("the board is not edge-on")
    }

    /// Part of the pixel's area that is dark, by cutting it along the lines between squares.
    fn dark_part(&self, h: &Matrix3<f64>, u: f64, v: f64) -> f64 {
        let corner = |du: f64, dv: f64| Vector2::new(u + du, v + dv);
        let pixel = [corner(-0.5, -0.5), corner(0.5, -0.5), corner(0.5, 0.5), corner(-0.5, 0.5)];
        let [first, rest @ ..] = pixel.map(|p| board(h, &p).map(f64::floor));
        if rest.iter().all(|b| *b == first) {
            return if self.is_dark(&first) { 1.0 } else { 0.0 };
        }
        self.dark_area(h, &pixel)
    }

    fn dark_area(&self, h: &Matrix3<f64>, polygon: &[Vector2<f64>]) -> f64 {
        for axis in 0..2 {
            let values: Vec<f64> = polygon.iter().map(|p| board(h, p)[axis]).collect();
            let low = values.iter().copied().fold(f64::INFINITY, f64::min);
            let high = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
            let line = (low + 1e-12).ceil();
            let outermost = [self.grid.columns, self.grid.rows][axis] as f64;
            if line < high - 1e-12 && line >= -1.0 && line <= outermost {
                // On the line, h.row(axis) * p = line * h.row(2) * p.
                let cut = h.row(axis) - h.row(2) * line;
                let side = |p: &Vector2<f64>| cut[0] * p.x + cut[1] * p.y + cut[2];
                return self.dark_area(h, &clip(polygon, &side)) + self.dark_area(h, &clip(polygon, &|p| -side(p)));
            }
        }
        let area = area(polygon);
        let centre = polygon.iter().sum::<Vector2<f64>>() / polygon.len() as f64;
        if area > 0.0 && self.is_dark(&board(h, &centre)) { area } else { 0.0 }
    }

    /// One square all around the inner corners, then light paper.
    fn is_dark(&self, b: &Vector2<f64>) -> bool {
        let (c, r) = (b.x.floor() as i64, b.y.floor() as i64);
        let on_board = c >= -1 && r >= -1 && c < self.grid.columns as i64 && r < self.grid.rows as i64;
        on_board && ((c + r).rem_euclid(2) == 0) == self.first_dark
    }
}

fn board(h: &Matrix3<f64>, p: &Vector2<f64>) -> Vector2<f64> {
    let b = h * Vector3::new(p.x, p.y, 1.0);
    Vector2::new(b.x / b.z, b.y / b.z)
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

pub(crate) fn blur(levels: &mut [f64], width: usize, height: usize, sigma: f64) {
    if sigma <= 0.0 {
        return;
    }
    let reach = (5.0 * sigma).ceil() as i64;
    let mut kernel: Vec<f64> = (-reach..=reach).map(|i| (-0.5 * (i as f64 / sigma).powi(2)).exp()).collect();
    let sum: f64 = kernel.iter().sum();
    for k in &mut kernel {
        *k /= sum;
    }
    for (count, stride, lines, line_stride) in [(width, 1, height, width), (height, width, width, 1)] {
        for line in 0..lines {
            let at = |i: i64| line * line_stride + i.clamp(0, count as i64 - 1) as usize * stride;
            let blurred: Vec<f64> = (0..count as i64)
                .map(|i| kernel.iter().zip(-reach..).map(|(k, offset)| k * levels[at(i + offset)]).sum())
                .collect();
            for (i, value) in blurred.into_iter().enumerate() {
                levels[at(i as i64)] = value;
            }
        }
    }
}

/// The scene of the published figures: 640×480, f = 581 px, 10×7 corners of 15 mm at 0.4 to 0.6 m, tilted up to 40°.
pub(super) fn random_scene(rng: &mut ChaCha8Rng, max_tilt: f64, max_roll: f64) -> Scene {
    let camera = Intrinsics::pinhole(640, 480, 581.0);
    let grid = Grid { columns: 10, rows: 7, square_m: 0.015 };
    let angles = [
        rng.random_range(0.0..max_tilt),
        rng.random_range(0.0..std::f64::consts::TAU),
        rng.random_range(-max_roll..max_roll),
    ];
    let offset = Vector2::new(rng.random_range(-60.0..60.0), rng.random_range(-40.0..40.0));
    let pose = looking_at(&grid, &camera, rng.random_range(0.40..0.60), angles, offset);
    Scene::new(camera, grid, pose)
}
