//! Simulated sessions: chains of robot, camera and board whose links are known, and what is seen along them.

use std::ops::Range;

use nalgebra::{Isometry3, Point3, UnitQuaternion, Vector2, Vector3, Vector6};
use rand::{Rng, RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution as _, StandardNormal};

use crate::estimate::handeye::Mode;
use crate::estimate::handeye::joint::chain::correction_transform;
use crate::estimate::handeye::joint::field::{HALF, Places};
use crate::estimate::handeye::joint::{Free, JointProblem, JointSolution, JointStart, Noise, RobotField};
use crate::estimate::{CameraKnowledge, Observations, ObservedView};
use crate::geometry::camera::{Distortion, Intrinsics};
use crate::geometry::frames::{Anchor, Base, Camera, Mount, Pose, Target, Tip};
use crate::geometry::se3;
use crate::targets::bent::{BoardPoints, BoardShape};
use crate::targets::observation::{Corner, View};
use crate::targets::{Grid, TargetSpec};

/// The inner corners of the board of the reference cell.
pub const GRID: Grid = Grid { columns: 10, rows: 7, square_m: 0.015 };

/// The board of the reference cell.
pub const BOARD: TargetSpec = TargetSpec::Chessboard(GRID);

/// Noise of a good robot and a good camera.
pub const REALISTIC: Noise =
    Noise { corner_px: 0.1, robot_m: 1e-4, robot_rad: 0.02 * std::f64::consts::PI / 180.0, ..Noise::EXACT };

/// Views of a known chain.
pub struct Trial {
    /// Where the camera is.
    pub mode: Mode,
    /// The points of the target, metres in its frame.
    pub points: Vec<Point3<f64>>,
    /// The same as a board that may be bent.
    pub board: BoardPoints,
    /// What robot and camera report.
    pub views: Vec<View>,
    /// The true camera.
    pub intrinsics: Intrinsics,
    /// The true camera on its mount.
    pub mount_from_camera: Pose<Mount, Camera>,
    /// The true place of the target.
    pub anchor_from_target: Pose<Anchor, Target>,
    /// The true pose of the target in every view.
    pub true_camera_from_target: Vec<Pose<Camera, Target>>,
}

/// A normal number of deviation 1.
pub fn normal(rng: &mut impl Rng) -> f64 {
    StandardNormal.sample(rng)
}

/// Three metres, then three radians of noise with these deviations.
pub fn noise_twist(rng: &mut impl Rng, metres: f64, radians: f64) -> Vector6<f64> {
    Vector6::from_fn(|i, _| normal(rng) * if i < 3 { metres } else { radians })
}

/// The error of a robot: a translation, and a rotation vector about the place moved to.
pub fn robot_error(rng: &mut impl Rng, noise: &Noise) -> Isometry3<f64> {
    let twist = noise_twist(rng, noise.robot_m, noise.robot_rad);
    let turn = UnitQuaternion::from_scaled_axis(twist.fixed_rows::<3>(3).into_owned());
    Isometry3::from_parts(twist.fixed_rows::<3>(0).into_owned().into(), turn)
}

/// Gives reported tip poses errors that depend on where they are, by a field drawn with the levels of `noise`.
///
/// The true pose is the one given times that field at the reported place, as the model has it.
pub fn add_field(rng: &mut impl Rng, noise: &Noise, views: &mut [View]) {
    let Some(places) = Places::of(views.iter().map(|view| &view.base_from_tip)) else { return };
    let mut field = RobotField::none(places);
    for (k, slope) in field.slopes_mut().iter_mut().enumerate() {
        *slope = normal(rng) * if k < HALF { noise.field_m } else { noise.field_rad };
    }
    for view in views {
        // A few rounds find where the field brings the reported pose to the one given.
        let given = view.base_from_tip;
        for _ in 0..3 {
            let error = correction_transform(&field.correction(&view.base_from_tip));
            view.base_from_tip = Pose::from_isometry(given.isometry() * error.inverse());
        }
    }
}

/// A target that is small in the image.
pub const SMALL_TARGET: TargetSpec = TargetSpec::Chessboard(Grid { columns: 4, rows: 3, square_m: 0.015 });

/// How [`SMALL_TARGET`] is looked at: from 0.5 m to the farthest, tilted by up to an angle.
#[derive(Debug, Clone, Copy)]
pub struct SmallTarget {
    /// Largest distance, metres.
    pub farthest_m: f64,
    /// Largest tilt, degrees.
    pub tilt_deg: f64,
}

/// `camera_from_target` with the middle of [`BOARD`] at `place` \[m\] in the camera's frame, tilted about an axis at
/// `azimuth` in the image after a turn by `roll` about its normal \[rad\].
pub fn board_at(place: Vector3<f64>, angles: [f64; 3]) -> Isometry3<f64> {
    target_at(&BOARD, place, angles)
}

fn target_at(target: &TargetSpec, place: Vector3<f64>, [tilt, azimuth, roll]: [f64; 3]) -> Isometry3<f64> {
    let turn = UnitQuaternion::from_scaled_axis(Vector3::new(azimuth.cos(), azimuth.sin(), 0.0) * tilt)
        * UnitQuaternion::from_scaled_axis(Vector3::z() * roll);
    Isometry3::from_parts(place.into(), turn) * Isometry3::from(-target.centre().coords)
}

/// The tip pose from which the camera sees the target so.
pub fn base_from_tip(
    mode: Mode,
    mount_from_camera: &Pose<Mount, Camera>,
    anchor_from_target: &Pose<Anchor, Target>,
    camera_from_target: &Pose<Camera, Target>,
) -> Pose<Base, Tip> {
    let anchor_from_mount = *anchor_from_target * camera_from_target.inverse() * mount_from_camera.inverse();
    match mode {
        Mode::EyeInHand => anchor_from_mount.relabel(),
        Mode::EyeToHand => anchor_from_mount.inverse().relabel(),
    }
}

/// The pixel with noise of `noise_px` per axis.
pub fn noisy(rng: &mut impl Rng, px: &Vector2<f64>, noise_px: f64) -> Vector2<f64> {
    Vector2::new(px.x + normal(rng) * noise_px, px.y + normal(rng) * noise_px)
}

/// Views on a 35° cone with ±60° of roll at 0.4 to 0.6 m: the geometry of the published Monte-Carlo tables.
pub fn trial(mode: Mode, views: usize, noise: &Noise, intrinsics: Intrinsics, seed: u64) -> Trial {
    trial_of(BOARD, (35.0, 0.4..0.6, 0.03), mode, views, noise, intrinsics, seed)
}

/// Views of [`SMALL_TARGET`] with ±60° of roll.
pub fn small_target_trial(mode: Mode, views: usize, noise: &Noise, how: SmallTarget, seed: u64) -> Trial {
    trial_of(SMALL_TARGET, (how.tilt_deg, 0.5..how.farthest_m, 0.1), mode, views, noise, camera(), seed)
}

/// Views of a target on a cone of so many degrees, at distances \[m\], and so far \[m\] beside the axis.
fn trial_of(
    target: TargetSpec,
    (cone_deg, distances, beside): (f64, Range<f64>, f64),
    mode: Mode,
    views: usize,
    noise: &Noise,
    intrinsics: Intrinsics,
    seed: u64,
) -> Trial {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let points = target.points();
    let mount_from_camera = Pose::from_isometry(se3::exp(&Vector6::new(0.05, 0.01, 0.06, 0.1, -0.2, 1.4)));
    let anchor_from_target: Pose<Anchor, Target> =
        Pose::from_isometry(se3::exp(&Vector6::new(0.5, 0.1, 0.2, 0.4, 0.2, -0.3)));
    let mut out = Vec::new();
    let mut true_camera_from_target = Vec::new();
    while out.len() < views {
        let tilt = cone_deg.to_radians() * rng.random::<f64>().sqrt();
        let azimuth = rng.random_range(0.0..std::f64::consts::TAU);
        let roll = rng.random_range(-60f64..60.0).to_radians();
        let distance = rng.random_range(distances.clone());
        let place = Vector3::new(rng.random_range(-beside..beside), rng.random_range(-beside..beside), distance);
        let camera_from_target: Pose<Camera, Target> =
            Pose::from_isometry(target_at(&target, place, [tilt, azimuth, roll]));
        let true_tip = base_from_tip(mode, &mount_from_camera, &anchor_from_target, &camera_from_target);
        let error = robot_error(&mut rng, noise);
        let reported = Pose::from_isometry(true_tip.isometry() * error.inverse());
        let corners: Option<Vec<Corner>> = points
            .iter()
            .enumerate()
            .map(|(index, p)| {
                let px = intrinsics.project(&(camera_from_target.isometry() * p)).ok()?;
                let seen = noisy(&mut rng, &px, noise.corner_px);
                intrinsics.contains(&seen).then_some(Corner::new(index, seen))
            })
            .collect();
        if let Some(corners) = corners {
            true_camera_from_target.push(camera_from_target);
            out.push(View::new(format!("{}", out.len()), reported, corners));
        }
    }
    if noise.field_m > 0.0 || noise.field_rad > 0.0 {
        add_field(&mut rng, noise, &mut out);
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
    /// The views as observed, with the camera given or to be estimated without distortion.
    pub fn observations(&self, free_intrinsics: bool) -> Observations {
        let camera = if free_intrinsics {
            CameraKnowledge::Estimate { model: Distortion::None, start: None }
        } else {
            CameraKnowledge::Fixed(self.intrinsics)
        };
        Observations {
            mode: Some(self.mode),
            target: BOARD,
            image_size: (self.intrinsics.width, self.intrinsics.height),
            camera,
            views: self.views.iter().map(ObservedView::from).collect(),
        }
    }

    /// The joint estimate's problem.
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

    /// Twist from the true link of the camera to the estimated one.
    pub fn hand_eye_error(&self, solution: &JointSolution) -> Vector6<f64> {
        let estimated = solution.hand_eye.mount_from_camera();
        se3::log((self.mount_from_camera.inverse() * estimated).isometry())
    }
}

/// The camera of the published tables.
pub fn camera() -> Intrinsics {
    Intrinsics::pinhole(640, 480, 581.0)
}
