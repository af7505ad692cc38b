//! Sessions of a robot with a camera and a target: poses and corners, no images.

use std::ops::Range;

use nalgebra::{Isometry3, Point3, SMatrix, UnitQuaternion, Vector2, Vector3, Vector6};
use rand::{Rng, RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;

use super::arm::{Before, LinkErrors, Servo, Ur5};
use super::lens::{is_in_image, pixel};
use super::links::{Field, Links, evenly, normal, robot_error, screw};
use handeye_geometry::camera::{Distortion, Intrinsics};
use handeye_geometry::frames::{Anchor, Base, Camera, Mount, Pose, Target, Tip};
use handeye_geometry::observations::{CameraKnowledge, Mode, Noise, Observations, ObservedView};
use handeye_geometry::targets::bent::BoardPoints;
use handeye_geometry::targets::observation::{Corner, View};
use handeye_geometry::targets::{Grid, TargetSpec};
use handeye_geometry::testing::BOARD;

/// Noise of a good robot and a good camera.
pub const REALISTIC: Noise =
    Noise { corner_px: 0.1, robot_m: 1e-4, robot_rad: 0.02 * std::f64::consts::PI / 180.0, ..Noise::EXACT };

/// A target that is small in the image.
pub const SMALL_TARGET: TargetSpec = TargetSpec::Chessboard(Grid { columns: 4, rows: 3, square_m: 0.015 });

/// The middle of where the tip is in both set-ups of [`links`], metres in the base.
const WORKPLACE: Vector3<f64> = Vector3::new(0.42, 0.06, 0.45);

/// The camera of the published tables.
pub fn camera() -> Intrinsics {
    Intrinsics::pinhole(640, 480, 581.0)
}

/// Camera and target in reach of an arm on a table.
pub fn links(mode: Mode) -> Links {
    let pi = std::f64::consts::PI;
    match mode {
        // Board on the table, face up; camera next to the flange, looking along it.
        Mode::EyeInHand => {
            Links::at(mode, [[0.05, 0.01, 0.06], [0.1, -0.05, 1.4]], [[0.42, 0.06, 0.02], [pi - 0.04, 0.03, 0.05]])
        }
        // Camera above the arm, looking down; board held by the flange, face up.
        Mode::EyeToHand => {
            Links::at(mode, [[0.45, 0.05, 0.95], [pi - 0.1, 0.05, 0.1]], [[-0.06, -0.04, 0.03], [0.05, -0.1, 0.3]])
        }
    }
}

/// Range of the target's poses in front of the camera in random views.
#[derive(Debug, Clone)]
pub struct Cone {
    /// Largest tilt, degrees.
    pub tilt_deg: f64,
    /// Largest turn about the normal either way, degrees.
    pub roll_deg: f64,
    /// Distances of the target's middle, metres.
    pub distance_m: Range<f64>,
    /// Largest distance of the middle from the optical axis along x and y, metres.
    pub beside_m: f64,
    /// Whether the distance is drawn before the place off the axis: some figures of the documentation were drawn so.
    pub distance_first: bool,
}

impl Cone {
    /// The range of the published Monte-Carlo tables.
    pub const PUBLISHED: Self =
        Self { tilt_deg: 35.0, roll_deg: 60.0, distance_m: 0.4..0.6, beside_m: 0.03, distance_first: false };

    /// `camera_from_target` of a view of a target.
    pub fn draw(&self, target: &TargetSpec, rng: &mut impl Rng) -> Isometry3<f64> {
        let tilt = self.tilt_deg.to_radians() * rng.random::<f64>().sqrt();
        let azimuth = rng.random_range(0.0..std::f64::consts::TAU);
        let angles = [tilt, azimuth, evenly(rng, self.roll_deg).to_radians()];
        let first_m = if self.distance_first { Some(rng.random_range(self.distance_m.clone())) } else { None };
        let (x, y) = (evenly(rng, self.beside_m), evenly(rng, self.beside_m));
        let distance_m = first_m.unwrap_or_else(|| rng.random_range(self.distance_m.clone()));
        target_at(target, Vector3::new(x, y, distance_m), angles)
    }
}

/// `camera_from_target` with the middle of the target at `place` \[m\] in the camera's frame, tilted about an axis at `azimuth`
/// in the image after a turn by `roll` about its normal \[rad\].
fn target_at(target: &TargetSpec, place: Vector3<f64>, [tilt, azimuth, roll]: [f64; 3]) -> Isometry3<f64> {
    let turn = UnitQuaternion::from_scaled_axis(Vector3::new(azimuth.cos(), azimuth.sin(), 0.0) * tilt)
        * UnitQuaternion::from_scaled_axis(Vector3::z() * roll);
    Isometry3::from_parts(place.into(), turn) * Isometry3::from(-target.centre().coords)
}

/// How views are taken, and their faults.
#[derive(Debug, Clone)]
pub struct Setup {
    /// Mounts of camera and target.
    pub links: Links,
    /// The target as it is stated.
    pub target: TargetSpec,
    /// The true lens.
    pub camera: Intrinsics,
    /// Number of views.
    pub views: usize,
    /// Range of the target's poses in front of the camera.
    pub cone: Cone,
    /// Noise of corners and robot. Errors that depend on the place are drawn with its levels.
    pub noise: Noise,
    /// Whether intrinsics are estimated.
    pub estimated: bool,
    /// Whether joint angles are known.
    pub joints: bool,
    /// Errors of the arm that depend on its configuration.
    pub arm_error: ArmError,
    /// Errors of corners that neighbours share: bends of the grid in the image, pixels.
    pub shared_px: f64,
    /// Views are taken level by level, each along a round, as a person or a plan does; otherwise in no order.
    pub by_level: bool,
    /// Seed of the random numbers.
    pub seed: u64,
    /// Fault of the data.
    pub fault: Fault,
}

/// Errors of an arm that depend on its configuration.
#[derive(Debug, Clone, Copy, Default)]
pub enum ArmError {
    /// None in addition to the noise.
    #[default]
    None,
    /// A twist of the tip that grows with its place in the base, per metre from the middle of the places.
    Affine(SMatrix<f64, 6, 3>),
    /// Errors of every link.
    Links(LinkErrors),
    /// Errors between the angles and the links of an arm of servo motors; it depends on where the arm came from, too.
    Servo(Servo),
}

/// A fault of the data.
#[derive(Debug, Clone, Default)]
pub struct Fault {
    /// The target moves before this view by a twist in its frame.
    pub board_moved: Option<(usize, Vector6<f64>)>,
    /// The camera moves on its mount before this view.
    pub camera_moved: Option<(usize, Vector6<f64>)>,
    /// Offset of a joint's zero, radians.
    pub joint: Option<(usize, f64)>,
    /// True size of the target over the stated one, minus one.
    pub scale: f64,
    /// Deflection of the target's middle along x and along y, metres.
    pub warp_m: f64,
    /// Views taken in motion: the tip was elsewhere by a twist, and the corners are blurred.
    pub moving: Vec<(usize, Vector6<f64>)>,
    /// Error of the focal length given, minus one.
    pub focal: f64,
}

impl Setup {
    /// A good robot and a good camera, which is given, with nothing wrong.
    pub fn new(mode: Mode, views: usize, seed: u64) -> Self {
        Self {
            links: links(mode),
            target: BOARD,
            camera: camera(),
            views,
            cone: Cone::PUBLISHED,
            noise: REALISTIC,
            estimated: false,
            joints: false,
            arm_error: ArmError::None,
            shared_px: 0.0,
            by_level: false,
            seed,
            fault: Fault::default(),
        }
    }

    /// The same with a fault.
    #[must_use]
    pub fn with(self, fault: Fault) -> Self {
        Self { fault, ..self }
    }
}

/// A session and the truth about it.
#[derive(Debug, Clone)]
pub struct Session {
    /// Where the camera is.
    pub mode: Mode,
    /// The target as it is stated.
    pub target: TargetSpec,
    /// Its points, metres in its frame.
    pub points: Vec<Point3<f64>>,
    /// The same for an estimator, which may bend them.
    pub board: BoardPoints,
    /// What robot and camera report.
    pub views: Vec<View>,
    /// The true camera.
    pub intrinsics: Intrinsics,
    /// The true camera on its mount, at first.
    pub mount_from_camera: Pose<Mount, Camera>,
    /// The true place of the target, at first.
    pub anchor_from_target: Pose<Anchor, Target>,
    /// The true pose of the target in every view.
    pub true_camera_from_target: Vec<Pose<Camera, Target>>,
}

impl Session {
    /// The views as observed, with the camera given or to be estimated without distortion.
    pub fn observations(&self, free_intrinsics: bool) -> Observations {
        let camera = if free_intrinsics {
            CameraKnowledge::Estimate { model: Distortion::None, start: None }
        } else {
            CameraKnowledge::Fixed(self.intrinsics)
        };
        Observations {
            mode: Some(self.mode),
            target: self.target,
            image_size: (self.intrinsics.width, self.intrinsics.height),
            camera,
            views: self.views.iter().map(ObservedView::from).collect(),
        }
    }

    /// Displaces corners by waves across the image, which no lens model follows, of an amplitude and a length in pixels.
    pub fn add_waves(&mut self, amplitude_px: f64, length_px: f64) {
        let turns = std::f64::consts::TAU / length_px;
        for corner in self.views.iter_mut().flat_map(|view| &mut view.corners) {
            let wave = Vector2::new((corner.px.y * turns + 1.0).sin(), (corner.px.x * turns).sin());
            corner.px += wave * amplitude_px;
        }
    }

    /// Displaces the points of the target in its plane, metres, and its corners with them.
    ///
    /// # Panics
    /// When a point gets behind the camera.
    pub fn add_print_errors(&mut self, errors_m: &[Vector2<f64>]) {
        for (view, pose) in self.views.iter_mut().zip(&self.true_camera_from_target) {
            for corner in &mut view.corners {
                let point = self.points[corner.index];
                let [drawn, printed] = [point, point + errors_m[corner.index].push(0.0)]
                    .map(|point| pixel(&self.intrinsics, &(pose.isometry() * point)).expect("in front of the camera"));
                corner.px += printed - drawn;
            }
        }
    }
}

/// Random views of the setup's geometry.
///
/// # Panics
/// When hardly any view of it is in reach of the arm and in sight of the camera.
pub fn session(setup: &Setup) -> Session {
    let mut camera = CameraAtWork::new(setup);
    let (mut taken, mut planned) = (Vec::with_capacity(setup.views), Vec::new());
    let mut tries = 0;
    while taken.len() < setup.views {
        tries += 1;
        assert!(tries < 100 * setup.views + 1000, "no such view is in reach");
        let next = setup.cone.draw(&setup.target, &mut camera.rng);
        if let Some(view) = camera.take(taken.len(), &next) {
            taken.push(view);
            planned.push(next);
        }
    }
    if !setup.by_level {
        return camera.session(taken);
    }
    let level = |view: &Isometry3<f64>| (view.translation.z / 0.07) as i32;
    let around = |view: &Isometry3<f64>| {
        let normal = view * Vector3::z();
        normal.y.atan2(normal.x)
    };
    planned.sort_by(|a, b| level(a).cmp(&level(b)).then(around(a).total_cmp(&around(b))));
    session_of(setup, &planned)
}

/// Views with the given poses of the target in the camera; those out of sight are left out.
pub fn session_of(setup: &Setup, planned: &[Isometry3<f64>]) -> Session {
    let mut camera = CameraAtWork::new(setup);
    let taken = planned.iter().enumerate().filter_map(|(i, next)| camera.take(i, next)).collect();
    camera.session(taken)
}

/// Input of an estimator for a session: corners and poses, and the camera as in the setup.
pub fn observed(setup: &Setup) -> Observations {
    with_camera(setup, &session(setup))
}

/// The same of [`session_of`].
pub fn observed_of(setup: &Setup, planned: &[Isometry3<f64>]) -> Observations {
    with_camera(setup, &session_of(setup, planned))
}

fn with_camera(setup: &Setup, session: &Session) -> Observations {
    let mut observations = session.observations(setup.estimated);
    if let CameraKnowledge::Fixed(given) = &mut observations.camera {
        given.fx *= 1.0 + setup.fault.focal;
        given.fy *= 1.0 + setup.fault.focal;
    }
    observations
}

/// Views whose links are far from every axis, with the geometry of [`Cone::PUBLISHED`].
pub fn trial(mode: Mode, views: usize, noise: &Noise, camera: Intrinsics, seed: u64) -> Session {
    session(&oblique(mode, views, noise, camera, seed))
}

/// Views of [`SMALL_TARGET`] with ±60° of roll, from 0.5 m to the farthest, tilted by up to an angle.
pub fn small_target_trial(
    mode: Mode,
    views: usize,
    noise: &Noise,
    SmallTarget { farthest_m, tilt_deg }: SmallTarget,
    seed: u64,
) -> Session {
    let setup = oblique(mode, views, noise, camera(), seed);
    let cone = Cone { tilt_deg, distance_m: 0.5..farthest_m, beside_m: 0.1, ..setup.cone };
    session(&Setup { target: SMALL_TARGET, cone, ..setup })
}

/// Views of [`SMALL_TARGET`]: from 0.5 m to the farthest, tilted by up to an angle.
#[derive(Debug, Clone, Copy)]
pub struct SmallTarget {
    /// Largest distance, metres.
    pub farthest_m: f64,
    /// Largest tilt, degrees.
    pub tilt_deg: f64,
}

fn oblique(mode: Mode, views: usize, noise: &Noise, camera: Intrinsics, seed: u64) -> Setup {
    let links = Links {
        mode,
        mount_from_camera: Pose::from_isometry(screw(&Vector6::new(0.05, 0.01, 0.06, 0.1, -0.2, 1.4))),
        anchor_from_target: Pose::from_isometry(screw(&Vector6::new(0.5, 0.1, 0.2, 0.4, 0.2, -0.3))),
    };
    let cone = Cone { distance_first: true, ..Cone::PUBLISHED };
    Setup { links, camera, cone, noise: *noise, ..Setup::new(mode, views, seed) }
}

/// Takes the views of a setup in turn.
struct CameraAtWork<'a> {
    setup: &'a Setup,
    rng: ChaCha8Rng,
    /// Previous joints, and how far the links are behind them.
    before: Before,
    /// The target as it is.
    points: Vec<Point3<f64>>,
}

impl<'a> CameraAtWork<'a> {
    fn new(setup: &'a Setup) -> Self {
        let Fault { warp_m, scale, .. } = setup.fault;
        let points = bent(&setup.target.points(), [warp_m; 2], 1.0 + scale);
        Self { setup, rng: ChaCha8Rng::seed_from_u64(setup.seed), before: None, points }
    }

    /// One view: the robot reports the planned pose, and its true pose differs by noise and faults; `None` where the arm does not
    /// get there, or the target is not wholly in sight.
    fn take(&mut self, index: usize, planned: &Isometry3<f64>) -> Option<(View, Pose<Camera, Target>)> {
        let Setup { links, fault, noise, .. } = self.setup;
        let reported = links.base_from_tip(&Pose::from_isometry(*planned));
        let (off, tip_from_joints) = self.arm_off(&reported)?;
        let mut tip = reported.isometry() * off * robot_error(&mut self.rng, noise);
        let moving = fault.moving.iter().find(|(view, _)| *view == index);
        if let Some((_, twist)) = moving {
            tip *= screw(twist);
        }
        let after = |step: &Option<(usize, Vector6<f64>)>| match step {
            Some((from, twist)) if index >= *from => screw(twist),
            _ => Isometry3::identity(),
        };
        let links = Links {
            mount_from_camera: Pose::from_isometry(links.mount_from_camera.isometry() * after(&fault.camera_moved)),
            anchor_from_target: Pose::from_isometry(links.anchor_from_target.isometry() * after(&fault.board_moved)),
            ..*links
        };
        let camera_from_target = links.camera_from_target(&Pose::from_isometry(tip));
        let noise_px = if moving.is_some() { 3.0 * noise.corner_px } else { noise.corner_px };
        let corners = self.corners(&camera_from_target, noise_px)?;
        let view = View { tip_from_joints, ..View::new(format!("{index:03}"), reported, corners) };
        Some((view, camera_from_target))
    }

    /// Error of the arm at a reported pose in addition to its noise, and the poses of its joints relative to the tip where
    /// they are known.
    fn arm_off(&mut self, reported: &Pose<Base, Tip>) -> Option<(Isometry3<f64>, Vec<Isometry3<f64>>)> {
        let Setup { joints: known, fault, arm_error, .. } = self.setup;
        let mut off = Isometry3::identity();
        if let ArmError::Affine(slopes) = arm_error {
            off = screw(&(slopes * (reported.translation() - WORKPLACE)));
        }
        let is_of_links = matches!(arm_error, ArmError::Links(_) | ArmError::Servo(_));
        if !(*known || fault.joint.is_some() || is_of_links) {
            return Some((off, Vec::new()));
        }
        let arm = Ur5::as_stated();
        let joints = arm.joints_at(reported)?;
        let really_off = |arm: &Ur5, joints: &[f64; 6]| reported.isometry().inverse() * arm.base_from_tip(joints);
        if let Some((joint, offset)) = fault.joint {
            let mut really = joints;
            really[joint] += offset;
            off = really_off(&arm, &really) * off;
        }
        match arm_error {
            ArmError::None | ArmError::Affine(_) => {}
            ArmError::Links(errors) => off *= really_off(&Ur5::with_errors(errors), &joints),
            ArmError::Servo(servo) => {
                let really = servo.really(&joints, &mut self.before);
                off *= really_off(&arm, &really);
            }
        }
        Some((off, if *known { arm.tip_from_joints(&joints).to_vec() } else { Vec::new() }))
    }

    fn corners(&mut self, camera_from_target: &Pose<Camera, Target>, noise_px: f64) -> Option<Vec<Corner>> {
        let (setup, rng) = (self.setup, &mut self.rng);
        let mut shared = SMatrix::<f64, 2, 6>::zeros();
        if setup.shared_px > 0.0 {
            shared = SMatrix::from_fn(|_, _| normal(rng) * setup.shared_px);
        }
        let (middle, half) = (setup.target.centre(), setup.target.extent() * 0.5);
        let drawn = setup.target.points();
        let bend = |i: usize| -> Vector2<f64> {
            let at = (drawn[i] - middle).xy().component_div(&half);
            let (u, v) = (at.x, at.y);
            shared * Vector6::new(1.0, u, v, u * v, u * u, v * v) / 2.0
        };
        seen(rng, &setup.camera, camera_from_target.isometry(), &self.points, noise_px, bend)
    }

    fn session(mut self, taken: Vec<(View, Pose<Camera, Target>)>) -> Session {
        let setup = self.setup;
        let (mut views, true_camera_from_target): (Vec<View>, _) = taken.into_iter().unzip();
        add_field(&mut self.rng, &setup.noise, &mut views);
        let points = setup.target.points();
        Session {
            mode: setup.links.mode,
            target: setup.target,
            board: BoardPoints::new(&points),
            points,
            views,
            intrinsics: setup.camera,
            mount_from_camera: setup.links.mount_from_camera,
            anchor_from_target: setup.links.anchor_from_target,
            true_camera_from_target,
        }
    }
}

/// Gives reported tip poses errors that depend on where they are, by a field drawn with the levels of `noise`, where it has any.
///
/// The true pose is the one given times that field at the reported place.
pub fn add_field(rng: &mut impl Rng, noise: &Noise, views: &mut [View]) {
    if noise.field_m == 0.0 && noise.field_rad == 0.0 {
        return;
    }
    let places: Vec<Vector3<f64>> = views.iter().map(|view| view.base_from_tip.translation()).collect();
    let middle = places.iter().sum::<Vector3<f64>>() / places.len() as f64;
    let spread_m =
        (places.iter().map(|place| (place - middle).norm_squared()).sum::<f64>() / places.len() as f64).sqrt();
    // The slopes of position along the three axes of the base, then those of orientation.
    let mut slopes = |level: f64| SMatrix::<f64, 3, 3>::from_fn(|_, _| normal(rng) * level / spread_m);
    let (position, orientation) = (slopes(noise.field_m), slopes(noise.field_rad));
    let mut both = SMatrix::<f64, 6, 3>::zeros();
    both.fixed_rows_mut::<3>(0).copy_from(&position);
    both.fixed_rows_mut::<3>(3).copy_from(&orientation);
    let field = Field { origin_m: middle, slopes: both };
    for view in views {
        // A few rounds find where the field brings the reported pose to the one given.
        let given = view.base_from_tip;
        for _ in 0..3 {
            let error = field.error(&view.base_from_tip);
            view.base_from_tip = Pose::from_isometry(given.isometry() * error.inverse());
        }
    }
}

/// The points of a sheet that is printed too large by a factor, and whose middle is displaced from its edges by `warp_m` along x
/// and along y, metres into the sheet: a parabola each way, over the points of its outline.
pub fn bent(points: &[Point3<f64>], warp_m: [f64; 2], scale: f64) -> Vec<Point3<f64>> {
    let range = |axis: usize| {
        let values = points.iter().map(|point| point[axis]);
        values.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), value| (low.min(value), high.max(value)))
    };
    let ranges = [range(0), range(1)];
    let depth = |point: &Point3<f64>, axis: usize| {
        let (low, high) = ranges[axis];
        let length = high - low;
        if length > 0.0 {
            4.0 * warp_m[axis] * (point[axis] - low) * (high - point[axis]) / length.powi(2)
        } else {
            0.0
        }
    };
    points.iter().map(|p| Point3::new(p.x, p.y, p.z + depth(p, 0) + depth(p, 1)) * scale).collect()
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
        let px = pixel(intrinsics, &(camera_from_target * point))?;
        let px = noisy(rng, &px, noise_px) + further_px(index);
        is_in_image(intrinsics, &px).then_some(Corner::new(index, px))
    };
    points.iter().enumerate().map(corner).collect()
}

/// Changes every robot pose.
#[must_use]
pub fn changed(mut observations: Observations, change: impl Fn(Isometry3<f64>) -> Isometry3<f64>) -> Observations {
    for view in &mut observations.views {
        view.base_from_tip = view.base_from_tip.map(|p| Pose::from_isometry(change(*p.isometry())));
    }
    observations
}
