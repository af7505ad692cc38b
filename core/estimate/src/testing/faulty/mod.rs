//! Simulated sessions with known faults: poses and corners, no images.

mod arm;

use std::fmt;

use nalgebra::{Isometry3, SMatrix, Translation3, UnitQuaternion, Vector2, Vector3, Vector6};
use rand::SeedableRng as _;
use rand_chacha::ChaCha8Rng;

use super::sessions::{BOARD, Cone, GRID, base_from_tip, camera, noise_twist, normal, seen};
use crate::handeye::Mode;
use crate::handeye::joint::camera_from_target;
use crate::{CameraKnowledge, Observations, ObservedView};
use handeye_geometry::camera::Distortion;
use handeye_geometry::frames::{Anchor, Base, Camera, Mount, Pose, Target, Tip};
use handeye_geometry::se3;
use handeye_geometry::targets::bent::{BoardPoints, BoardShape};

pub use arm::{LinkErrors, Servo};

/// How views are taken, and what is wrong.
#[derive(Clone)]
pub struct Setup {
    /// Where the camera is.
    pub mode: Mode,
    /// Number of views.
    pub views: usize,
    /// Largest tilt of the board, degrees.
    pub tilt_deg: f64,
    /// Largest turn of the board about its normal either way, degrees.
    pub roll_deg: f64,
    /// Noise of a corner per axis, pixels.
    pub corner_px: f64,
    /// Noise of the robot per axis, metres.
    pub robot_m: f64,
    /// And of its rotation, radians.
    pub robot_rad: f64,
    /// Whether intrinsics are estimated.
    pub estimated: bool,
    /// Whether joint angles are known.
    pub joints: bool,
    /// Errors of the arm that depend on where it stands.
    pub arm_error: ArmError,
    /// Errors of corners that neighbours share: bends of the grid in the image, pixels.
    pub shared_px: f64,
    /// Views are taken level by level, each along a round, as a person or a plan does; otherwise in no order.
    pub by_level: bool,
    /// Of the random numbers.
    pub seed: u64,
    /// What is wrong.
    pub fault: Fault,
}

/// Errors of an arm that depend on where it stands.
#[derive(Clone, Copy, Default)]
pub enum ArmError {
    /// None besides the noise.
    #[default]
    None,
    /// A twist of the tip that grows with its place in the base, per metre from [`WORKPLACE`].
    Affine(SMatrix<f64, 6, 3>),
    /// What is wrong with every link.
    Links(LinkErrors),
    /// What lies between the angles and the links of an arm of servo motors; it depends on where the arm came from, too.
    Servo(Servo),
}

/// The middle of where the tip is in both set-ups, metres in the base.
const WORKPLACE: Vector3<f64> = Vector3::new(0.42, 0.06, 0.45);

/// What is wrong.
#[derive(Clone, Default)]
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
            mode,
            views,
            tilt_deg: Cone::PUBLISHED.tilt_deg,
            roll_deg: Cone::PUBLISHED.roll_deg,
            corner_px: 0.1,
            robot_m: 1e-4,
            robot_rad: 0.02f64.to_radians(),
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

    /// The shape of the target.
    fn shape(&self) -> BoardShape {
        BoardShape { warp_m: [self.fault.warp_m; 2], scale: 1.0 + self.fault.scale }
    }
}

/// What a report of a study needs to tell sessions apart.
impl fmt::Display for Setup {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let arm = match self.arm_error {
            ArmError::None => "arm true",
            ArmError::Affine(_) => "arm affine",
            ArmError::Links(_) => "arm links",
            ArmError::Servo(_) => "arm of servos",
        };
        let lens = if self.estimated { "lens estimated" } else { "lens given" };
        let order = if self.by_level { "by level" } else { "in no order" };
        write!(
            f,
            "{:?}, {} views {order}, {arm}, {lens}, corners {} + {} px, ",
            self.mode, self.views, self.corner_px, self.shared_px
        )?;
        write!(f, "warp {:.1} mm", self.fault.warp_m * 1e3)
    }
}

fn pose<Dst, Src>(place: [f64; 3], rotation: [f64; 3]) -> Pose<Dst, Src> {
    let rotation = UnitQuaternion::from_scaled_axis(Vector3::from(rotation));
    Pose::from_isometry(Isometry3::from_parts(Translation3::from(place), rotation))
}

/// The camera on its mount and the target on its anchor.
pub fn links(mode: Mode) -> (Pose<Mount, Camera>, Pose<Anchor, Target>) {
    let pi = std::f64::consts::PI;
    match mode {
        // Board on the table, face up; camera beside the flange, looking along it.
        Mode::EyeInHand => {
            (pose([0.05, 0.01, 0.06], [0.1, -0.05, 1.4]), pose([0.42, 0.06, 0.02], [pi - 0.04, 0.03, 0.05]))
        }
        // Camera above the arm, looking down; board held by the flange, face up.
        Mode::EyeToHand => {
            (pose([0.45, 0.05, 0.95], [pi - 0.1, 0.05, 0.1]), pose([-0.06, -0.04, 0.03], [0.05, -0.1, 0.3]))
        }
    }
}

/// Random views of the setup's geometry.
///
/// # Panics
/// When hardly any view of it is in reach of the arm and in sight of the camera.
pub fn session(setup: &Setup) -> Observations {
    let mut rng = ChaCha8Rng::seed_from_u64(setup.seed);
    let cone = Cone { tilt_deg: setup.tilt_deg, roll_deg: setup.roll_deg, ..Cone::PUBLISHED };
    let (mut views, mut planned) = (Vec::with_capacity(setup.views), Vec::new());
    let (mut tries, mut last) = (0, None);
    while views.len() < setup.views {
        tries += 1;
        assert!(tries < 100 * setup.views + 1000, "no such view is in reach");
        let next = cone.draw(&mut rng);
        if let Some(view) = observed(setup, &mut rng, &mut last, views.len(), &next) {
            views.push(view);
            planned.push(next);
        }
    }
    if !setup.by_level {
        return observations(setup, views);
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
pub fn session_of(setup: &Setup, planned: &[Isometry3<f64>]) -> Observations {
    let (mut rng, mut last) = (ChaCha8Rng::seed_from_u64(setup.seed), None);
    let views = planned.iter().enumerate().filter_map(|(i, p)| observed(setup, &mut rng, &mut last, i, p)).collect();
    observations(setup, views)
}

fn observations(setup: &Setup, views: Vec<ObservedView>) -> Observations {
    let camera = if setup.estimated {
        CameraKnowledge::Estimate { model: Distortion::None, start: None }
    } else {
        let mut given = camera();
        given.fx *= 1.0 + setup.fault.focal;
        given.fy *= 1.0 + setup.fault.focal;
        CameraKnowledge::Fixed(given)
    };
    Observations { mode: Some(setup.mode), target: BOARD, image_size: (640, 480), camera, views }
}

/// One view: the robot reports the pose planned, and is somewhere else by its noise and the faults. `last` is where the joints were
/// before, and how far behind them the links.
fn observed(
    setup: &Setup,
    rng: &mut ChaCha8Rng,
    last: &mut Option<([f64; 6], [f64; 6])>,
    index: usize,
    planned: &Isometry3<f64>,
) -> Option<ObservedView> {
    let (mount_from_camera, anchor_from_target) = links(setup.mode);
    let planned = Pose::from_isometry(*planned);
    let reported = base_from_tip(setup.mode, &mount_from_camera, &anchor_from_target, &planned);
    let fault = &setup.fault;
    let arm = arm::as_stated();
    let mut twists = Vec::new();
    let mut off = Isometry3::identity();
    if setup.joints || fault.joint.is_some() {
        let joints = arm::joints_at(&arm, reported.isometry())?;
        twists = arm.tip_by_joint(&joints).ok()?;
        if let Some((joint, offset)) = fault.joint {
            let mut really = joints;
            really[joint] += offset;
            off = reported.isometry().inverse() * arm::base_from_tip(&arm, &really);
        }
    }
    match &setup.arm_error {
        ArmError::None => {}
        ArmError::Affine(per_metre) => off *= se3::exp(&(per_metre * (reported.translation() - WORKPLACE))),
        ArmError::Links(errors) => {
            let joints = arm::joints_at(&arm, reported.isometry())?;
            off = off * reported.isometry().inverse() * arm::base_from_tip(&arm::with_errors(errors), &joints);
        }
        ArmError::Servo(servo) => {
            let joints = arm::joints_at(&arm, reported.isometry())?;
            let really = servo.really(&joints, last);
            off = off * reported.isometry().inverse() * arm::base_from_tip(&arm, &really);
        }
    }
    let noise = noise_twist(rng, setup.robot_m, setup.robot_rad);
    let mut tip: Pose<Base, Tip> = Pose::from_isometry(reported.isometry() * off).perturbed(&noise);
    let moving = fault.moving.iter().find(|(view, _)| *view == index).map(|(_, twist)| twist);
    if let Some(twist) = moving {
        tip = tip.perturbed(twist);
    }
    let after = |step: &Option<(usize, Vector6<f64>)>| match step {
        Some((from, twist)) if index >= *from => *twist,
        _ => Vector6::zeros(),
    };
    let camera_from_target = camera_from_target(
        setup.mode,
        &tip,
        &mount_from_camera.perturbed(&after(&fault.camera_moved)),
        &anchor_from_target.perturbed(&after(&fault.board_moved)),
    );
    let noise_px = if moving.is_some() { 3.0 * setup.corner_px } else { setup.corner_px };
    let mut shared = SMatrix::<f64, 2, 6>::zeros();
    if setup.shared_px > 0.0 {
        shared = SMatrix::from_fn(|_, _| normal(rng) * setup.shared_px);
    }
    let bend = |i: usize| -> Vector2<f64> {
        let point = GRID.point(i);
        let (u, v) = (2.0 * point.x / (9.0 * GRID.square_m) - 1.0, 2.0 * point.y / (6.0 * GRID.square_m) - 1.0);
        shared * Vector6::new(1.0, u, v, u * v, u * u, v * v) / 2.0
    };
    let points = BoardPoints::new(&BOARD.points()).points(&setup.shape());
    let corners = seen(rng, &camera(), camera_from_target.isometry(), &points, noise_px, bend)?;
    Some(ObservedView {
        tip_by_joint: if setup.joints { twists } else { Vec::new() },
        ..ObservedView::new(format!("{index:03}"), Some(reported), Some(corners.into()))
    })
}

/// Changes every robot pose.
#[must_use]
pub fn changed(mut observations: Observations, change: impl Fn(Isometry3<f64>) -> Isometry3<f64>) -> Observations {
    for view in &mut observations.views {
        view.base_from_tip = view.base_from_tip.map(|p| Pose::from_isometry(change(*p.isometry())));
    }
    observations
}
