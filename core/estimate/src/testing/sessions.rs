//! Simulated sessions: chains of robot, camera and board whose links are known, and what is seen along them.

use std::ops::Range;

use nalgebra::{Isometry3, Point3, UnitQuaternion, Vector2, Vector3, Vector6};
use rand::{Rng, RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution as _, StandardNormal};

use crate::handeye::Mode;
use crate::handeye::joint::chain::correction_transform;
use crate::handeye::joint::field::{HALF, Places};
use crate::handeye::joint::{Free, JointProblem, JointSolution, JointStart, Noise, RobotField};
use crate::{CameraKnowledge, Observations, ObservedView};
use handeye_geometry::camera::{Distortion, Intrinsics};
use handeye_geometry::frames::{Anchor, Base, Camera, Mount, Pose, Target, Tip};
use handeye_geometry::se3;
use handeye_geometry::targets::bent::{BoardPoints, BoardShape};
use handeye_geometry::targets::observation::{Corner, View};
use handeye_geometry::targets::{Grid, TargetSpec};

pub use handeye_geometry::testing::{BOARD, GRID};

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

/// The tip pose that a robot reports which is really at another. The true pose is the reported one times the robot's error,
/// as the model has it.
pub fn reported(rng: &mut impl Rng, base_from_tip: &Pose<Base, Tip>, noise: &Noise) -> Pose<Base, Tip> {
    let error = correction_transform(&noise_twist(rng, noise.robot_m, noise.robot_rad));
    Pose::from_isometry(base_from_tip.isometry() * error.inverse())
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

/// Displaces corners by waves across the image, which no lens model follows, of an amplitude and a length in pixels.
pub fn add_waves(views: &mut [View], amplitude_px: f64, length_px: f64) {
    let turns = std::f64::consts::TAU / length_px;
    for corner in views.iter_mut().flat_map(|view| &mut view.corners) {
        let wave = Vector2::new((corner.px.y * turns + 1.0).sin(), (corner.px.x * turns).sin());
        corner.px += wave * amplitude_px;
    }
}

/// Displaces the points of a session's target in its plane, metres, and its corners with them.
pub fn add_print_errors(session: &mut Trial, errors_m: &[Vector2<f64>]) {
    let (camera, points) = (&session.intrinsics, &session.points);
    for (view, pose) in session.views.iter_mut().zip(&session.true_camera_from_target) {
        for corner in &mut view.corners {
            let point = points[corner.index];
            let [drawn, printed] = [point, point + errors_m[corner.index].push(0.0)]
                .map(|point| camera.project(&(pose.isometry() * point)).expect("in front of the camera"));
            corner.px += printed - drawn;
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

/// How a target lies before the camera in views that are drawn at random.
#[derive(Debug, Clone)]
pub struct Cone {
    /// Largest tilt, degrees.
    pub tilt_deg: f64,
    /// Largest turn about the normal either way, degrees.
    pub roll_deg: f64,
    /// Distances of the target's middle, metres.
    pub distance_m: Range<f64>,
    /// How far that is beside the optical axis along x and y at the most, metres.
    pub beside_m: f64,
}

impl Cone {
    /// That of the published Monte-Carlo tables.
    pub const PUBLISHED: Self = Self { tilt_deg: 35.0, roll_deg: 60.0, distance_m: 0.4..0.6, beside_m: 0.03 };

    /// `camera_from_target` of a view of [`BOARD`].
    pub fn draw(&self, rng: &mut impl Rng) -> Isometry3<f64> {
        let (angles, [x, y]) = (self.angles(rng), self.beside(rng));
        board_at(Vector3::new(x, y, rng.random_range(self.distance_m.clone())), angles)
    }

    /// Tilt, azimuth and roll, radians.
    fn angles(&self, rng: &mut impl Rng) -> [f64; 3] {
        let tilt = self.tilt_deg.to_radians() * rng.random::<f64>().sqrt();
        let azimuth = rng.random_range(0.0..std::f64::consts::TAU);
        [tilt, azimuth, rng.random_range(-self.roll_deg..self.roll_deg).to_radians()]
    }

    fn beside(&self, rng: &mut impl Rng) -> [f64; 2] {
        std::array::from_fn(|_| rng.random_range(-self.beside_m..self.beside_m))
    }
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

/// The corners of a view with noise per axis, and with further errors by their index; `None` where one is out of sight.
pub fn seen(
    rng: &mut impl Rng,
    intrinsics: &Intrinsics,
    camera_from_target: &Isometry3<f64>,
    points: &[Point3<f64>],
    noise_px: f64,
    further_px: impl Fn(usize) -> Vector2<f64>,
) -> Option<Vec<Corner>> {
    let corner = |(index, point): (usize, &Point3<f64>)| {
        let px = intrinsics.project(&(camera_from_target * point)).ok()?;
        let px = noisy(rng, &px, noise_px) + further_px(index);
        intrinsics.contains(&px).then_some(Corner::new(index, px))
    };
    points.iter().enumerate().map(corner).collect()
}

/// Views with the geometry of [`Cone::PUBLISHED`].
pub fn trial(mode: Mode, views: usize, noise: &Noise, intrinsics: Intrinsics, seed: u64) -> Trial {
    trial_of(BOARD, &Cone::PUBLISHED, mode, views, noise, intrinsics, seed)
}

/// Views of [`SMALL_TARGET`] with ±60° of roll.
pub fn small_target_trial(mode: Mode, views: usize, noise: &Noise, how: SmallTarget, seed: u64) -> Trial {
    let cone = Cone { tilt_deg: how.tilt_deg, distance_m: 0.5..how.farthest_m, beside_m: 0.1, ..Cone::PUBLISHED };
    trial_of(SMALL_TARGET, &cone, mode, views, noise, camera(), seed)
}

fn trial_of(
    target: TargetSpec,
    cone: &Cone,
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
        let angles = cone.angles(&mut rng);
        // The distance before the place beside the axis: the figures of the documentation were drawn so.
        let distance_m = rng.random_range(cone.distance_m.clone());
        let [x, y] = cone.beside(&mut rng);
        let camera_from_target: Pose<Camera, Target> =
            Pose::from_isometry(target_at(&target, Vector3::new(x, y, distance_m), angles));
        let true_tip = base_from_tip(mode, &mount_from_camera, &anchor_from_target, &camera_from_target);
        let reported = reported(&mut rng, &true_tip, noise);
        let no_more = |_| Vector2::zeros();
        let corners = seen(&mut rng, &intrinsics, camera_from_target.isometry(), &points, noise.corner_px, no_more);
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
