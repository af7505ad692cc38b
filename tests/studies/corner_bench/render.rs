//! Varied views of chessboards, with the exact area of every pixel and known corners.

use handeye_geometry::camera::{Distortion, Intrinsics};
use handeye_geometry::targets::Grid;
use handeye_geometry::testing::looking_at;
use handeye_simulate::Scene;
use image::GrayImage;
use nalgebra::Vector2;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// What is varied.
#[derive(Debug, Clone, Copy)]
pub struct Look {
    pub size: (u32, u32),
    pub focal_px: f64,
    /// Radial distortion: `r (1 + k r²)` in units of the focal length.
    pub radial: f64,
    pub columns: usize,
    pub rows: usize,
    /// Mean size of a square \[px\].
    pub square_px: f64,
    pub max_tilt: f64,
    pub blur_px: f64,
    pub noise: f64,
    pub dark: f64,
    pub light: f64,
    /// Change of the light across the width of the image, as a fraction of it.
    pub fall: f64,
    /// Shift of the board to the right, in units of the focal length.
    pub moved: f64,
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
            moved: 0.0,
        }
    }

    /// The board.
    pub fn grid(&self) -> Grid {
        Grid { columns: self.columns, rows: self.rows, square_m: 1.0 }
    }
}

pub struct Image {
    pub image: GrayImage,
    pub truth: Vec<Vector2<f64>>,
}

/// A view of the board from a random side; the size of squares varies by ±20 %.
pub fn view(look: &Look, seed: u64) -> Image {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let distance = look.focal_px / look.square_px * rng.random_range(0.8..1.2);
    let azimuth = rng.random_range(0.0..std::f64::consts::TAU);
    let tilt = rng.random_range(0.0..look.max_tilt);
    let pi = std::f64::consts::PI;
    let turn = rng.random_range(-pi..pi);
    let offset = Vector2::new(rng.random_range(-0.08..0.08) + look.moved, rng.random_range(-0.08..0.08));
    let distortion = match look.radial {
        0.0 => Distortion::None,
        k => Distortion::BrownConrady([k, 0.0, 0.0, 0.0, 0.0]),
    };
    let camera = Intrinsics { distortion, ..Intrinsics::pinhole(look.size.0, look.size.1, look.focal_px) };
    let grid = look.grid();
    let pose = looking_at(&grid, &camera, distance, [tilt, azimuth, turn], offset * look.focal_px);
    let mut scene = Scene::new(camera, grid, pose);
    (scene.blur_px, scene.noise) = (look.blur_px, look.noise);
    (scene.dark, scene.light, scene.fall) = (look.dark, look.light, look.fall);
    Image { image: scene.render_with(&mut rng), truth: scene.truth() }
}
