//! Images of a moving board through a lens, for tests: blurred, noisy, partly covered, with depths.

use image::{GrayImage, Luma};
use nalgebra::{Isometry3, Point3, UnitQuaternion, Vector2, Vector3};
use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution as _, StandardNormal};

use super::sessions::{BOARD, GRID};
use crate::depth::DepthImage;
use crate::estimate::handeye::HandEye;
use crate::estimate::handeye::joint::SmallSample;
use crate::geometry::camera::{Distortion, Intrinsics};
use crate::geometry::frames::{Base, Camera, Pose, Target, Tip};
use crate::targets::bent::BoardShape;
#[cfg(feature = "opencv")]
use crate::track::{Image, Tracker, Update};
use crate::track::{MotionModel, Setup};
use crate::verify::Predictor;

/// Seconds between images.
pub const PERIOD_S: f64 = 1.0 / 30.0;
pub const FAR_M: f32 = 3.5;
const PAPER: f64 = 205.0;
const INK: f64 = 45.0;
const AROUND: f64 = 120.0;

/// A rectangle of one grey in the image.
#[derive(Debug, Clone, Copy)]
pub struct Cover {
    pub low: Vector2<f64>,
    pub high: Vector2<f64>,
}

/// A camera and how its images are.
pub struct Stage {
    pub camera: Intrinsics,
    pub blur_px: f64,
    /// 1σ \[grey levels\].
    pub noise: f64,
    pub covers: Vec<Cover>,
    /// 1σ of depths \[m\].
    pub depth_noise_m: f64,
    /// Ray of every pixel at depth 1.
    rays: Vec<Vector2<f64>>,
    /// Normal numbers to draw from: an image needs 300 000.
    normals: Vec<f32>,
}

pub fn lens() -> Intrinsics {
    let distortion = Distortion::BrownConrady([-0.12, 0.05, 0.0006, -0.0004, 0.0]);
    Intrinsics { fx: 581.3, fy: 580.1, cx: 322.4, cy: 238.1, distortion, ..Intrinsics::pinhole(640, 480, 581.0) }
}

impl Stage {
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

/// The tip half a metre above the table, camera down, a little askew.
pub fn base_from_tip() -> Pose<Base, Tip> {
    let rotation = UnitQuaternion::from_euler_angles(std::f64::consts::PI - 0.06, 0.04, 0.3);
    Pose::from_isometry(Isometry3::from_parts(Vector3::new(0.45, 0.05, 0.55).into(), rotation))
}

pub fn tip_from_camera() -> Pose<Tip, Camera> {
    let rotation = UnitQuaternion::from_euler_angles(0.02, -0.03, 0.7);
    Pose::from_isometry(Isometry3::from_parts(Vector3::new(0.03, -0.05, 0.06).into(), rotation))
}

pub fn calibrated() -> Predictor {
    Predictor {
        shape: BoardShape::default(),
        hand_eye: HandEye::EyeInHand { tip_from_camera: tip_from_camera(), base_from_target: Pose::identity() },
        intrinsics: lens(),
        print_errors_m: Vec::new(),
        joint_offsets_rad: Vec::new(),
        field: None,
        hand_eye_covariance: None,
        small_sample: SmallSample::KNOWN,
        uncertainty: None,
    }
}

pub fn setup() -> Setup {
    Setup { target: BOARD, calibrated: calibrated(), motion: MotionModel::default() }
}

pub fn centre() -> Point3<f64> {
    BOARD.centre()
}

/// A board whose centre is at `centre` (relative to the middle of the camera's view) and which is tilted by `tilt`.
pub fn board_at(shift: Vector3<f64>, tilt: Vector3<f64>) -> Pose<Base, Target> {
    let rotation = UnitQuaternion::from_scaled_axis(Vector3::new(0.25, -0.2, 0.1) + tilt);
    let at = Vector3::new(0.0, 0.0, 0.45) + shift;
    let camera_from_target =
        Isometry3::from_parts(at.into(), rotation) * nalgebra::Translation3::from(-centre().coords);
    base_from_tip() * tip_from_camera() * Pose::from_isometry(camera_from_target)
}

/// A tracker, the stage it watches and the time.
#[cfg(feature = "opencv")]
pub struct Watch {
    pub stage: Stage,
    pub tracker: Tracker,
    pub time_s: f64,
    pub seed: u64,
    pub base_from_tip: Pose<Base, Tip>,
}

#[cfg(feature = "opencv")]
impl Watch {
    pub fn new() -> Self {
        Self::with(setup())
    }

    pub fn with(setup: Setup) -> Self {
        let tracker = Tracker::new(setup).expect("a good set-up");
        Self { stage: Stage::new(), tracker, time_s: 0.0, seed: 1, base_from_tip: base_from_tip() }
    }

    pub fn camera_from_target(&self, base_from_target: &Pose<Base, Target>) -> Isometry3<f64> {
        let base_from_camera = self.tracker.setup().calibrated.base_from_camera(&self.base_from_tip);
        *(base_from_camera.inverse() * *base_from_target).isometry()
    }

    /// The next image, with the board there or with none.
    pub fn see(&mut self, board: Option<&Pose<Base, Target>>) -> Update {
        let board = board.map(|b| self.camera_from_target(b));
        let grey = self.stage.image(board.as_ref(), self.seed);
        self.show(&grey, None)
    }

    pub fn show(&mut self, grey: &GrayImage, depth: Option<&DepthImage>) -> Update {
        self.time_s += PERIOD_S;
        self.seed += 1;
        let (time_s, base_from_tip) = (self.time_s, self.base_from_tip);
        let image = Image { time_s, grey, depth, far_plane_m: FAR_M, base_from_tip };
        self.tracker.see(&image).expect("a good image")
    }
}

/// Distance of the centres \[m\] and angle between the axes \[rad\].
pub fn error(estimate: &Pose<Base, Target>, truth: &Pose<Base, Target>) -> (f64, f64) {
    let at = |pose: &Pose<Base, Target>| pose.isometry() * centre();
    ((at(estimate) - at(truth)).norm(), estimate.rotation().angle_to(&truth.rotation()))
}

pub fn rms(values: &[f64]) -> f64 {
    (values.iter().map(|v| v * v).sum::<f64>() / values.len() as f64).sqrt()
}
