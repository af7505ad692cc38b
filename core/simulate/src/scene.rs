//! Images of targets through a camera with known corners.

use image::{GrayImage, Luma};
use nalgebra::{Isometry3, Unit, Vector2, Vector3};
use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution as _, Normal};

#[cfg(feature = "print")]
use super::drawn::Drawn;
use handeye_geometry::camera::Intrinsics;
use handeye_geometry::targets::{Grid, TargetSpec};
use handeye_geometry::testing::looking_at;
use handeye_render::{BoardSurface, Light, LightSource, RenderScene, Renderer};

/// An image to be taken of a target.
///
/// A chessboard by [`Scene::new`] has the exact area of every pixel, on paper that has no end in the image. Any target by
/// `Scene::drawn` (feature `print`) is the drawing that is printed, sampled ten by ten in pixels that an outline crosses, on its
/// paper on a table.
pub struct Scene {
    /// The camera, with its lens.
    pub camera: Intrinsics,
    /// The target.
    pub target: TargetSpec,
    /// Pose of the target.
    pub camera_from_target: Isometry3<f64>,
    /// Standard deviation of the lens blur in pixels, on top of the pixel's own area.
    pub blur_px: f64,
    /// Standard deviation of the noise in grey levels.
    pub noise: f64,
    /// Grey level of the ink.
    pub dark: f64,
    /// Grey level of the paper.
    pub light: f64,
    /// Change of the light across the width of the image, as a part of it.
    pub fall: f64,
    /// Left, top, right and bottom of something in front of the target \[px\].
    pub covered: Option<[u32; 4]>,
    /// Whether the square between the first four corners of a chessboard is dark.
    pub first_dark: bool,
    #[cfg(feature = "print")]
    drawn: Option<Drawn>,
}

/// Nothing is nearer or farther, and no paper ends within this, metres: chessboards are of 15 mm or of 1 m.
const NEAR_M: f64 = 1e-3;
const FAR_M: f64 = 1e6;
const PAPER_M: f64 = 1e5;
/// Grey level of what is around the paper and in front of it.
const TABLE: f64 = 120.0;

impl Scene {
    /// A chessboard, exact to rounding.
    pub fn new(camera: Intrinsics, grid: Grid, camera_from_target: Isometry3<f64>) -> Self {
        Self {
            camera,
            target: TargetSpec::Chessboard(grid),
            camera_from_target,
            blur_px: 0.7,
            noise: 0.0,
            dark: 45.0,
            light: 205.0,
            fall: 0.0,
            covered: None,
            first_dark: true,
            #[cfg(feature = "print")]
            drawn: None,
        }
    }

    /// A target of any kind as it is printed, with noise of one grey level. Feature `print`.
    ///
    /// # Panics
    /// When the target cannot be drawn.
    #[cfg(feature = "print")]
    pub fn drawn(target: TargetSpec, camera: Intrinsics, camera_from_target: Isometry3<f64>) -> Self {
        let any = Grid { columns: 2, rows: 2, square_m: 1.0 };
        Self { target, noise: 1.0, drawn: Some(Drawn::of(&target)), ..Self::new(camera, any, camera_from_target) }
    }

    /// The scene of the published figures: 640×480, f = 581 px, 10×7 corners of 15 mm at 0.4 to 0.6 m, tilted up to 40°.
    pub fn random(rng: &mut ChaCha8Rng, max_tilt: f64, max_roll: f64) -> Self {
        let camera = Intrinsics::pinhole(640, 480, 581.0);
        let grid = Grid { columns: 10, rows: 7, square_m: 0.015 };
        let angles = [
            rng.random_range(0.0..max_tilt),
            rng.random_range(0.0..std::f64::consts::TAU),
            rng.random_range(-max_roll..max_roll),
        ];
        let offset = Vector2::new(rng.random_range(-60.0..60.0), rng.random_range(-40.0..40.0));
        let pose = looking_at(&grid, &camera, rng.random_range(0.40..0.60), angles, offset);
        Self::new(camera, grid, pose)
    }

    /// The chessboard.
    ///
    /// # Panics
    /// For a target of another kind.
    pub fn grid(&self) -> Grid {
        match self.target {
            TargetSpec::Chessboard(grid) => grid,
            other => panic!("{other} is not a chessboard"),
        }
    }

    /// True positions of all points, visible or not.
    ///
    /// # Panics
    /// When one is behind the camera.
    pub fn truth(&self) -> Vec<Vector2<f64>> {
        let points = self.target.points().into_iter();
        points.map(|p| self.camera.project(&(self.camera_from_target * p)).expect("in front")).collect()
    }

    /// The image with its own noise.
    pub fn render(&self, seed: u64) -> GrayImage {
        self.render_with(&mut ChaCha8Rng::seed_from_u64(seed))
    }

    /// The light in every pixel before the lens blurs it.
    fn levels(&self) -> Vec<f64> {
        #[cfg(feature = "print")]
        if let Some(drawn) = &self.drawn {
            return drawn.levels(self, TABLE);
        }
        let light = Renderer::new(self.camera, NEAR_M, FAR_M).render_light(&self.print());
        light.chunks_exact(3).map(|rgb| 255.0 * f64::from(rgb[0])).collect()
    }

    fn print(&self) -> RenderScene {
        let grid = self.grid();
        let [dark, light] = [self.dark, self.light].map(|level| (level / 255.0) as f32);
        let board = BoardSurface::new(self.camera_from_target, grid.columns, grid.rows, grid.square_m, [PAPER_M; 2]);
        let board = if self.first_dark {
            BoardSurface { dark, white: light, ..board }
        } else {
            // Ink and paper changed over, and cut out along the print.
            let side = |corners: usize| (corners + 1) as f64 * grid.square_m;
            BoardSurface { dark: light, white: dark, paper_m: [side(grid.columns), side(grid.rows)], ..board }
        };
        lit(board, light)
    }

    /// The image with the noise that comes next.
    ///
    /// # Panics
    /// When the noise is not a deviation.
    pub fn render_with(&self, rng: &mut ChaCha8Rng) -> GrayImage {
        let (width, height) = (self.camera.width as usize, self.camera.height as usize);
        let mut levels = self.levels();
        if self.fall != 0.0 {
            for (i, level) in levels.iter_mut().enumerate() {
                *level *= 1.0 + self.fall * ((i % width) as f64 / width as f64 - 0.5);
            }
        }
        if let Some([left, top, right, bottom]) = self.covered {
            for v in top..bottom {
                levels[v as usize * width..][left as usize..right as usize].fill(TABLE);
            }
        }
        blur(&mut levels, width, height, self.blur_px);
        let noise = Normal::new(0.0, self.noise).expect("a deviation");
        GrayImage::from_fn(self.camera.width, self.camera.height, |u, v| {
            let level = levels[v as usize * width + u as usize] + noise.sample(rng);
            Luma([level.round().clamp(0.0, 255.0) as u8])
        })
    }
}

/// A chessboard before the camera and what is around it, each as bright as it is coloured.
pub(super) fn lit(board: BoardSurface, around: f32) -> RenderScene {
    // From where the lamp is, the board is seen straight on.
    let towards_lamp = Unit::new_normalize(board.world_from_target.rotation * -Vector3::z());
    let light = Light { source: LightSource::Directional(towards_lamp), ambient: 1.0, diffuse: 0.0 };
    RenderScene { world_from_camera: Isometry3::identity(), board, solids: Vec::new(), light, background: [around; 3] }
}

fn blur(levels: &mut [f64], width: usize, height: usize, sigma: f64) {
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
