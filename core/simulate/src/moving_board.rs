//! Images and depths of a moving board through a lens: blurred, noisy, partly covered.

use image::{GrayImage, Luma};
use nalgebra::{Isometry3, Point3, Vector2, Vector3};
use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution as _, StandardNormal};

use handeye_geometry::camera::{Distortion, Intrinsics};
use handeye_geometry::depth::DepthImage;
use handeye_geometry::testing::{BOARD, GRID};

/// The depth sensor's far plane \[m\].
pub const FAR_M: f32 = 3.5;
const PAPER: f64 = 205.0;
const INK: f64 = 45.0;
const AROUND: f64 = 120.0;

/// A rectangle of one grey in the image.
#[derive(Debug, Clone, Copy)]
pub struct Cover {
    /// Its corner with the smallest coordinates \[px\].
    pub low: Vector2<f64>,
    /// Its corner with the largest coordinates \[px\].
    pub high: Vector2<f64>,
}

/// A camera and how its images are.
pub struct Stage {
    /// The camera with its lens.
    pub camera: Intrinsics,
    /// 1σ of the blur, on top of the area of a pixel \[px\].
    pub blur_px: f64,
    /// 1σ \[grey levels\].
    pub noise: f64,
    /// What is in front of the board.
    pub covers: Vec<Cover>,
    /// 1σ of depths \[m\].
    pub depth_noise_m: f64,
    /// Ray of every pixel at depth 1.
    rays: Vec<Vector2<f64>>,
    /// Normal numbers to draw from: an image needs 300 000.
    normals: Vec<f32>,
}

/// A camera of 640 × 480 pixels with a lens that bends.
pub fn lens() -> Intrinsics {
    let distortion = Distortion::BrownConrady([-0.12, 0.05, 0.0006, -0.0004, 0.0]);
    Intrinsics { fx: 581.3, fy: 580.1, cx: 322.4, cy: 238.1, distortion, ..Intrinsics::pinhole(640, 480, 581.0) }
}

impl Default for Stage {
    fn default() -> Self {
        Self::new()
    }
}

impl Stage {
    /// Sharp and noisy as a usual camera, exact depths, nothing in front of the board.
    pub fn new() -> Self {
        let camera = lens();
        let rays = (0..camera.width * camera.height)
            .map(|i| {
                let px = Vector2::new(f64::from(i % camera.width), f64::from(i / camera.width));
                let ray = camera.unproject(&px).expect("inside the lens model");
                ray.xy() / ray.z
            })
            .collect();
        let mut rng = ChaCha8Rng::seed_from_u64(99);
        let normals = (0..400_009).map(|_| StandardNormal.sample(&mut rng)).collect();
        Self { camera, blur_px: 0.7, noise: 2.0, covers: Vec::new(), depth_noise_m: 0.0, rays, normals }
    }

    /// The image; with no board in it for `None`.
    pub fn image(&self, board: Option<&Isometry3<f64>>, seed: u64) -> GrayImage {
        let (width, height) = (self.camera.width, self.camera.height);
        let on_board: Vec<Option<Vector2<f64>>> =
            self.rays.iter().map(|ray| board.and_then(|board| meet(board, ray)).map(|(at, _)| at)).collect();
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let mut next = rng.random_range(0..self.normals.len());
        GrayImage::from_fn(width, height, |u, v| {
            let i = (v * width + u) as usize;
            // The board's coordinates a pixel further, for the width of the blur.
            let right = on_board[if u + 1 < width { i + 1 } else { i }];
            let below = on_board[if v + 1 < height { i + width as usize } else { i }];
            let mut level = AROUND;
            if let (Some(at), Some(right), Some(below)) = (on_board[i], right, below) {
                level = self.level(at, right - at, below - at);
            }
            let p = Vector2::new(f64::from(u), f64::from(v));
            if self.covers.iter().any(|c| p >= c.low && p <= c.high) {
                level = 128.0;
            }
            next = (next + 1) % self.normals.len();
            Luma([(level + self.noise * f64::from(self.normals[next])).round().clamp(0.0, 255.0) as u8])
        })
    }

    /// Grey at a place on the board, in squares from the first corner.
    fn level(&self, at: Vector2<f64>, by_u: Vector2<f64>, by_v: Vector2<f64>) -> f64 {
        // The pixel's own area is worth a blur of 0.29 px.
        let blur = self.blur_px.hypot(0.2887);
        let sigma = |axis: usize| blur * by_u[axis].hypot(by_v[axis]) * std::f64::consts::SQRT_2;
        let step = |x: f64, axis: usize| {
            let t = x / sigma(axis);
            if t.abs() > 4.0 { t.signum() } else { libm::erf(t) }
        };
        let wave = |axis: usize| {
            let edge = at[axis].round();
            let right = if edge.rem_euclid(2.0) == 0.0 { 1.0 } else { -1.0 };
            right * step(at[axis] - edge, axis)
        };
        let within = |axis: usize, count: usize, margin: f64| {
            0.25 * (1.0 + step(at[axis] + 1.0 + margin, axis)) * (1.0 + step(count as f64 + margin - at[axis], axis))
        };
        let inside = |margin| within(0, GRID.columns, margin) * within(1, GRID.rows, margin);
        let squares = PAPER + (INK - PAPER) * 0.5 * (1.0 + wave(0) * wave(1)) * inside(0.0);
        // A margin of one square of paper.
        AROUND + (squares - AROUND) * inside(1.0)
    }

    /// Depths of the board and, around it, of the far plane.
    pub fn depth(&self, board: &Isometry3<f64>, seed: u64) -> DepthImage {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let metres = self
            .rays
            .iter()
            .map(|ray| match meet(board, ray) {
                Some((at, z)) if at.x.abs() < 12.0 && at.y.abs() < 9.0 => {
                    let normal: f64 = StandardNormal.sample(&mut rng);
                    (z + self.depth_noise_m * normal) as f32
                }
                _ => FAR_M,
            })
            .collect();
        DepthImage::new(self.camera.width, self.camera.height, metres).expect("as many as pixels")
    }
}

/// Where a ray meets the board, in squares from the first corner, and at what depth.
fn meet(board: &Isometry3<f64>, ray: &Vector2<f64>) -> Option<(Vector2<f64>, f64)> {
    let ray = Vector3::new(ray.x, ray.y, 1.0);
    let normal = board.rotation * Vector3::z();
    let z = normal.dot(&board.translation.vector) / normal.dot(&ray);
    let at = board.rotation.inverse() * (ray * z - board.translation.vector) / GRID.square_m;
    (z > 0.0).then(|| at.xy()).filter(|at| at.x > -4.0 && at.y > -4.0 && at.x < 14.0 && at.y < 11.0).map(|at| (at, z))
}

/// The middle of the board, in its frame.
pub fn centre() -> Point3<f64> {
    BOARD.centre()
}
