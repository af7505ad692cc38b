//! Images and depths of a moving board through a lens: blurred, noisy, partly covered.

use image::{GrayImage, Luma};
use nalgebra::{Isometry3, Point3, Vector2};

use handeye_geometry::camera::{Distortion, Intrinsics};
use handeye_geometry::depth::DepthImage;
use handeye_geometry::testing::{BOARD, GRID};
use handeye_render::{BoardSurface, Imaging, RenderScene, Renderer};

use super::scene::lit;

/// The depth sensor's near and far plane \[m\].
const NEAR_M: f64 = 0.01;
/// See [`NEAR_M`].
pub const FAR_M: f32 = 3.5;
const PAPER: f32 = 205.0 / 255.0;
const INK: f32 = 45.0 / 255.0;
const AROUND: f32 = 120.0 / 255.0;
/// Squares of paper around the print in images, and in depths, where the board lies on something.
const MARGIN: f64 = 1.0;
const SUPPORT: f64 = 3.0;

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
    /// Objects in front of the board.
    pub covers: Vec<Cover>,
    /// 1σ of depths \[m\].
    pub depth_noise_m: f64,
    renderer: Renderer,
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
        let renderer = Renderer::new(camera, NEAR_M, f64::from(FAR_M));
        Self { camera, blur_px: 0.7, noise: 2.0, covers: Vec::new(), depth_noise_m: 0.0, renderer }
    }

    /// The image; with no board in it for `None`.
    pub fn image(&self, board: Option<&Isometry3<f64>>, seed: u64) -> GrayImage {
        let imaging = Imaging { blur_px: self.blur_px, noise_grey: self.noise, ..Imaging::default() };
        // Behind the camera it is in no image.
        let behind = Isometry3::translation(0.0, 0.0, -1.0);
        let rgb = self.renderer.render_rgb(&sheet(board.unwrap_or(&behind), MARGIN), &imaging, seed);
        GrayImage::from_fn(self.camera.width, self.camera.height, |u, v| {
            let p = Vector2::new(f64::from(u), f64::from(v));
            let is_covered = self.covers.iter().any(|c| p >= c.low && p <= c.high);
            Luma([if is_covered { 128 } else { rgb.get_pixel(u, v).0[0] }])
        })
    }

    /// Depths of the board and, around it, of the far plane.
    ///
    /// # Panics
    /// Never: there are as many depths as pixels.
    pub fn depth(&self, board: &Isometry3<f64>, seed: u64) -> DepthImage {
        let imaging = Imaging { depth_noise_m: self.depth_noise_m, ..Imaging::default() };
        let metres = self.renderer.render_depth(&sheet(board, SUPPORT), &imaging, seed);
        DepthImage::new(self.camera.width, self.camera.height, metres).expect("as many as pixels")
    }
}

/// The board with `margin` squares of paper around its print, in front of the camera.
fn sheet(camera_from_target: &Isometry3<f64>, margin: f64) -> RenderScene {
    let side = |corners: usize| (corners as f64 + 1.0 + 2.0 * margin) * GRID.square_m;
    let paper_m = [side(GRID.columns), side(GRID.rows)];
    let board = BoardSurface::new(*camera_from_target, GRID.columns, GRID.rows, GRID.square_m, paper_m);
    lit(BoardSurface { dark: INK, white: PAPER, ..board }, AROUND)
}

/// The middle of the board, in its frame.
pub fn centre() -> Point3<f64> {
    BOARD.centre()
}
