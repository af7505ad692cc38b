//! Images of a board, seen straight on, whose edges are blurred by a Gaussian.

use image::{GrayImage, Luma};
use nalgebra::{Rotation2, Vector2};
use rand::SeedableRng as _;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution as _, Normal};

use handeye_geometry::targets::observation::Corner;
use handeye_geometry::testing::GRID;

/// A board seen straight on.
#[derive(Debug, Clone, Copy)]
pub struct Board {
    /// Width and height of the image \[px\].
    pub size: (u32, u32),
    /// The first corner.
    pub origin: Vector2<f64>,
    /// Edge of a square \[px\].
    pub square_px: f64,
    /// Turn about the first corner \[rad\].
    pub turn_rad: f64,
    /// 1σ of the blur \[px\].
    pub sigma_px: f64,
    /// A motion along the rows of pixels during the exposure, 1σ of a Gaussian.
    pub motion_px: f64,
}

impl Default for Board {
    fn default() -> Self {
        Self::new()
    }
}

impl Board {
    /// Almost straight, and sharp.
    pub fn new() -> Self {
        Self {
            size: (320, 240),
            origin: Vector2::new(60.3, 55.7),
            square_px: 20.0,
            turn_rad: 0.05,
            sigma_px: 0.8,
            motion_px: 0.0,
        }
    }

    /// Its inner corners.
    pub fn corners(&self) -> Vec<Corner> {
        let turn = Rotation2::new(self.turn_rad);
        (0..GRID.len())
            .map(|index| {
                let on_board = Vector2::new((index % GRID.columns) as f64, (index / GRID.columns) as f64);
                Corner::new(index, self.origin + turn * on_board * self.square_px)
            })
            .collect()
    }

    /// Grey levels: 60 and 190 on the board, 190 around it. The blur is exact for the infinite board.
    pub fn levels(&self) -> Vec<f64> {
        let back = Rotation2::new(-self.turn_rad);
        // Motion blurs each family of edges by its part across them.
        let across = |part: f64| (self.sigma_px.powi(2) + (part * self.motion_px).powi(2)).sqrt() / self.square_px;
        let (sigma_x, sigma_y) = (across(self.turn_rad.cos()), across(self.turn_rad.sin()));
        let mut levels = Vec::with_capacity(self.size.0 as usize * self.size.1 as usize);
        for v in 0..self.size.1 {
            for u in 0..self.size.0 {
                let p = back * (Vector2::new(f64::from(u), f64::from(v)) - self.origin) / self.square_px;
                let x = wave(p.x, sigma_x, GRID.columns);
                let y = wave(p.y, sigma_y, GRID.rows);
                // Outside of the board both are 0.
                levels.push(if x.abs() * y.abs() > 0.0 { 125.0 - 65.0 * x * y } else { 190.0 });
            }
        }
        levels
    }
}

/// A square wave that changes sign at 0 … `corners` − 1, blurred; 0 beyond one square outside of them.
fn wave(x: f64, sigma: f64, corners: usize) -> f64 {
    if x <= -1.0 || x >= corners as f64 {
        return 0.0;
    }
    let nearest = x.floor() as i32;
    let sign = |i: i32| if i.rem_euclid(2) == 0 { 1.0 } else { -1.0 };
    // The change of the sharp wave by blurring: only steps within a few squares do.
    let blurred = |i: i32| {
        let t = x - f64::from(i);
        sign(i) * (libm::erf(t / (sigma * std::f64::consts::SQRT_2)) - if t < 0.0 { -1.0 } else { 1.0 })
    };
    sign(nearest) + (nearest - 2..=nearest + 3).map(blurred).sum::<f64>()
}

/// Adds noise and rounds.
pub fn image(size: (u32, u32), levels: &[f64], noise: f64, seed: u64) -> GrayImage {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let noise = Normal::new(0.0, noise).expect("a deviation");
    GrayImage::from_fn(size.0, size.1, |u, v| {
        let level = levels[(v * size.0 + u) as usize] + noise.sample(&mut rng);
        Luma([level.round().clamp(0.0, 255.0) as u8])
    })
}
