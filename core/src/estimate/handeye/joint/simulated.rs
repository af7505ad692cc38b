//! Simulated chains with known truth, for tests.

use nalgebra::{Isometry3, Point3, UnitQuaternion, Vector2, Vector3, Vector6};
use rand::{Rng, RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution as _, StandardNormal};

use super::chain::correction_transform;
use super::{Free, JointProblem, JointSolution, JointStart, Noise};
use crate::estimate::handeye::Mode;
use crate::geometry::camera::Intrinsics;
use crate::geometry::frames::{Anchor, Base, Camera, Mount, Pose, Target, Tip};
use crate::geometry::se3;
use crate::targets::bent::{BoardPoints, BoardShape};
use crate::targets::observation::{Corner, View};
use crate::targets::{Grid, TargetSpec};

pub(crate) const BOARD: TargetSpec = TargetSpec::Chessboard(Grid { columns: 10, rows: 7, square_m: 0.015 });

/// Views of a known chain.
pub(crate) struct Trial {
    pub mode: Mode,
    pub points: Vec<Point3<f64>>,
    pub board: BoardPoints,
    pub views: Vec<View>,
    pub intrinsics: Intrinsics,
    pub mount_from_camera: Pose<Mount, Camera>,
    pub anchor_from_target: Pose<Anchor, Target>,
    pub true_camera_from_target: Vec<Pose<Camera, Target>>,
}

fn normal(rng: &mut impl Rng) -> f64 {
    StandardNormal.sample(rng)
}

fn noise_twist(rng: &mut impl Rng, metres: f64, radians: f64) -> Vector6<f64> {
    Vector6::from_fn(|i, _| normal(rng) * if i < 3 { metres } else { radians })
}

/// Views on a 35° cone with ±60° of roll at 0.4 to 0.6 m: the geometry of the published Monte-Carlo tables.
pub(crate) fn trial(mode: Mode, views: usize, noise: &Noise, intrinsics: Intrinsics, seed: u64) -> Trial {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let points = BOARD.points();
    let centre = BOARD.centre();
    let mount_from_camera = Pose::from_isometry(se3::exp(&Vector6::new(0.05, 0.01, 0.06, 0.1, -0.2, 1.4)));
    let anchor_from_target: Pose<Anchor, Target> =
        Pose::from_isometry(se3::exp(&Vector6::new(0.5, 0.1, 0.2, 0.4, 0.2, -0.3)));
    let mut out = Vec::new();
    let mut true_camera_from_target = Vec::new();
    while out.len() < views {
        let tilt = 35f64.to_radians() * rng.random::<f64>().sqrt();
        let azimuth = rng.random_range(0.0..std::f64::consts::TAU);
        let roll = rng.random_range(-60f64..60.0).to_radians();
        let distance = rng.random_range(0.4..0.6);
        let jitter = Vector3::new(rng.random_range(-0.03..0.03), rng.random_range(-0.03..0.03), distance);
        let turn = UnitQuaternion::from_scaled_axis(Vector3::new(azimuth.cos(), azimuth.sin(), 0.0) * tilt)
            * UnitQuaternion::from_scaled_axis(Vector3::z() * roll);
        let camera_from_target =
            Isometry3::from_parts(jitter.into(), turn) * Isometry3::translation(-centre.x, -centre.y, -centre.z);
        let camera_from_target: Pose<Camera, Target> = Pose::from_isometry(camera_from_target);
        let true_anchor_from_mount = anchor_from_target * camera_from_target.inverse() * mount_from_camera.inverse();
        let true_base_from_tip: Pose<Base, Tip> = match mode {
            Mode::EyeInHand => true_anchor_from_mount.relabel(),
            Mode::EyeToHand => true_anchor_from_mount.inverse().relabel(),
        };
        let error = correction_transform(&noise_twist(&mut rng, noise.robot_m, noise.robot_rad));
        let base_from_tip = Pose::from_isometry(true_base_from_tip.isometry() * error.inverse());
        let corners: Option<Vec<Corner>> = points
            .iter()
            .enumerate()
            .map(|(index, p)| {
                let px = intrinsics.project(&(camera_from_target.isometry() * p)).ok()?;
                let seen =
                    Vector2::new(px.x + normal(&mut rng) * noise.corner_px, px.y + normal(&mut rng) * noise.corner_px);
                intrinsics.contains(&seen).then_some(Corner::new(index, seen))
            })
            .collect();
        if let Some(corners) = corners {
            true_camera_from_target.push(camera_from_target);
            out.push(View::new(format!("{}", out.len()), base_from_tip, corners));
        }
    }
    let board = BoardPoints::new(&points);
    Trial {
        mode,
        points,
        board,
        views: out,
        intrinsics,
        mount_from_camera,
        anchor_from_target,
        true_camera_from_target,
    }
}

impl Trial {
    pub fn problem(&self, free_intrinsics: bool, noise: Option<Noise>) -> JointProblem<'_> {
        let free = Free { intrinsics: free_intrinsics, ..Free::default() };
        JointProblem { free, noise, ..JointProblem::new(self.mode, &self.board, &self.views) }
    }

    /// A start as far off as a poor closed form: millimetres and tenths of a degree.
    pub fn start(&self) -> JointStart {
        let off = Vector6::new(0.004, -0.003, 0.005, 0.01, -0.008, 0.006);
        JointStart {
            mount_from_camera: self.mount_from_camera.perturbed(&off),
            anchor_from_target: self.anchor_from_target.perturbed(&(-off)),
            intrinsics: self.intrinsics,
            shape: BoardShape::default(),
            noise: None,
        }
    }

    pub fn hand_eye_error(&self, solution: &JointSolution) -> Vector6<f64> {
        let estimated = solution.hand_eye.mount_from_camera();
        se3::log((self.mount_from_camera.inverse() * estimated).isometry())
    }
}

pub(crate) fn camera() -> Intrinsics {
    Intrinsics::pinhole(640, 480, 581.0)
}

/// Noise of a good robot and a good camera.
pub(crate) const REALISTIC: Noise =
    Noise { corner_px: 0.1, view_px: 0.0, robot_m: 1e-4, robot_rad: 0.02 * std::f64::consts::PI / 180.0 };
