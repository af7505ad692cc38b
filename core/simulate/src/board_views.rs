//! Corners of a board that may be bent, with errors that neighbours may share.

use nalgebra::{Cholesky, DMatrix, DVector, Dyn, Vector2};
use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution as _, Normal};

use super::lens::pixel;
use super::session::bent;
use handeye_geometry::camera::Intrinsics;
use handeye_geometry::observations::{CameraKnowledge, Observations, ObservedView};
use handeye_geometry::targets::bent::BoardShape;
use handeye_geometry::targets::observation::Corner;
use handeye_geometry::targets::{Grid, TargetSpec};
use handeye_geometry::testing::looking_at;

/// A camera that looks at a board from all sides, without a robot.
#[derive(Debug, Clone, Copy)]
pub struct BoardViews {
    pub camera: Intrinsics,
    /// The board as drawn.
    pub grid: Grid,
    pub shape: BoardShape,
    /// Least and most tilt, radians.
    pub tilt: (f64, f64),
    /// Least and most distance, metres.
    pub distance_m: (f64, f64),
    /// Largest distance of the image of the board's middle from the principal point, pixels.
    pub offset_px: (f64, f64),
    /// Standard deviation of a corner per axis, pixels.
    pub noise_px: f64,
    /// Errors that neighbours share.
    pub shared: Option<SharedErrors>,
}

/// Errors of the corners of a view that are alike where corners are near each other: a random field over the board with the
/// correlation `exp(−d²/2)`, another one in every view. Blur, light and what the lens does beyond its model make such.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SharedErrors {
    /// Part of the variance.
    pub part: f64,
    /// Squares over which they are alike.
    pub reach: f64,
}

impl BoardViews {
    /// A flat board, tilted by 10° to 40° in directions all around, 0.5 to 0.8 m away, with independent errors.
    pub fn new(camera: Intrinsics, grid: Grid, noise_px: f64) -> Self {
        Self {
            camera,
            grid,
            shape: BoardShape::FLAT,
            tilt: (0.2, 0.7),
            distance_m: (0.5, 0.8),
            offset_px: (90.0, 60.0),
            noise_px,
            shared: None,
        }
    }

    /// The corners of `count` views.
    ///
    /// # Panics
    /// When a corner is behind the camera, or the noise is not a standard deviation.
    pub fn corners(&self, count: usize, seed: u64) -> Vec<Vec<Corner>> {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let noise = Normal::new(0.0, self.noise_px).expect("a deviation");
        let board = bent(&TargetSpec::Chessboard(self.grid).points(), self.shape.warp_m, self.shape.scale);
        let field = self.shared.map(|shared| (shared.part, self.root(shared.reach)));
        (0..count)
            .map(|i| {
                let angles = [rng.random_range(self.tilt.0..=self.tilt.1), i as f64 * 2.4, rng.random_range(-1.0..1.0)];
                let (across, down) = self.offset_px;
                let offset = Vector2::new(rng.random_range(-across..across), rng.random_range(-down..down));
                let distance_m = rng.random_range(self.distance_m.0..self.distance_m.1);
                let pose = looking_at(&self.grid, &self.camera, distance_m, angles, offset);
                let shared = field.as_ref().map(|(part, root)| {
                    let mut smooth = || root * DVector::from_fn(board.len(), |_, _| noise.sample(&mut rng));
                    (part, [smooth(), smooth()])
                });
                (0..board.len())
                    .map(|index| {
                        let px = pixel(&self.camera, &(pose * board[index])).expect("in front");
                        let own = Vector2::new(noise.sample(&mut rng), noise.sample(&mut rng));
                        let error = shared.as_ref().map_or(own, |(part, [x, y])| {
                            Vector2::new(x[index], y[index]) * part.sqrt() + own * (1.0 - *part).sqrt()
                        });
                        Corner::new(index, px + error)
                    })
                    .collect()
            })
            .collect()
    }

    /// The same as observations without a robot, the lens to be found.
    ///
    /// # Panics
    /// As [`BoardViews::corners`].
    pub fn observations(&self, count: usize, seed: u64) -> Observations {
        let views = self.corners(count, seed).into_iter().enumerate();
        Observations {
            mode: None,
            target: TargetSpec::Chessboard(self.grid),
            image_size: (self.camera.width, self.camera.height),
            camera: CameraKnowledge::NOTHING,
            views: views.map(|(i, corners)| ObservedView::new(format!("{i:04}"), None, Some(corners.into()))).collect(),
        }
    }

    /// The lower factor of the field's correlation.
    fn root(&self, reach: f64) -> DMatrix<f64> {
        let at = |index: usize| self.grid.point(index).coords / (self.grid.square_m * reach);
        let near = |i: usize, j: usize| {
            // What keeps the matrix positive where all is smooth.
            let rounding = if i == j { 1e-9 } else { 0.0 };
            (-0.5 * (at(i) - at(j)).norm_squared()).exp() + rounding
        };
        let field: Option<Cholesky<f64, Dyn>> = DMatrix::from_fn(self.grid.len(), self.grid.len(), near).cholesky();
        field.expect("a correlation").l()
    }
}
