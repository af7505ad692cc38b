//! A cell: where camera, target and tool are on and around an arm, the views that are taken in it, and the points that are
//! touched.

use handeye_arm::Arm;
use handeye_estimate::handeye::Mode;
use handeye_geometry::camera::Intrinsics;
use handeye_geometry::targets::observation::Corner;
use handeye_geometry::targets::{Grid, TargetSpec};
use handeye_simulate::lens;
use handeye_simulate::links::{noise_twist, normal, shift_and_turn};
use handeye_simulate::session::{Cone, bent, camera};
use nalgebra::{
    Isometry3, Matrix3, Matrix3x6, Matrix6, Point3, Translation3, UnitQuaternion, Vector2, Vector3, Vector6,
};
use rand::RngExt as _;
use rand_chacha::ChaCha8Rng;

use crate::chain::{Chain, Model, between, nearest, newton};
use crate::real::Real;

pub const TARGET: TargetSpec = TargetSpec::Chessboard(Grid { columns: 9, rows: 6, square_m: 0.025 });
const CORNER_PX: f64 = 0.1;
const TOOL_M: f64 = 0.12;
/// Draws at most until as many views or touches are within reach.
pub const TRIES: usize = 2000;
/// Joints of an arm that reaches poses in general.
const JOINTS_OF_A_POSE: usize = 6;
/// Largest angle between the wanted direction of the tool and the nearest one of an arm with fewer.
const NEAR_RAD: f64 = 30.0 * std::f64::consts::PI / 180.0;
/// What a radian of that counts, next to a metre: the tip of the tool arrives.
const TURN_M: f64 = 1e-4;
/// How far its joints are from its start in a view, radians, the standard deviation.
const JOINTS_RAD: f64 = 0.35;
/// Rotations about one point from which a tool is found.
const TURNS: usize = 12;
const CONE: Cone =
    Cone { tilt_deg: 40.0, roll_deg: 150.0, distance_m: 0.3..0.5, beside_m: 0.04, distance_first: false };

/// What is wrong in addition to the arm.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Wrong {
    #[default]
    Nothing,
    /// The middle of the board is 2 mm off its edges.
    Bent,
    /// Its squares are 1.3 % larger or smaller than stated.
    Square,
    /// The principal point of the lens given is half a pixel off.
    Lens,
    /// The arm moves on to the nearest remaining view at 50 mm/s or 10°/s, whichever is slower, and its joints are read 80 ms after
    /// the image.
    Late,
}

impl Wrong {
    pub const ALL: [(&str, Self); 4] =
        [("bent", Self::Bent), ("square", Self::Square), ("lens-off", Self::Lens), ("late", Self::Late)];

    fn board(self, rng: &mut ChaCha8Rng) -> Vec<Point3<f64>> {
        let sign = if rng.random::<bool>() { 1.0 } else { -1.0 };
        match self {
            Self::Bent => bent(&TARGET.points(), [0.002 * sign, 0.0], 1.0),
            Self::Square => bent(&TARGET.points(), [0.0; 2], 1.0 + 0.013 * sign),
            _ => TARGET.points(),
        }
    }

    /// The given lens.
    fn lens(self, rng: &mut ChaCha8Rng) -> Intrinsics {
        let mut lens = camera();
        if self == Self::Lens {
            let azimuth = rng.random_range(0.0..std::f64::consts::TAU);
            lens.cx += 0.5 * azimuth.cos();
            lens.cy += 0.5 * azimuth.sin();
        }
        lens
    }
}

/// How far the tip moves until its joints are read, metres.
const LATE_M: f64 = 0.05 * 0.08;
/// And radians.
const LATE_RAD: f64 = 10.0 * std::f64::consts::PI / 180.0 * 0.08;

/// An arm, what its controller believes, and where things are on and around it.
pub struct Cell {
    pub real: Real,
    pub believed: Chain,
    pub arm: Arm,
    pub mode: Mode,
    start: Vec<f64>,
    repeats: [f64; 2],
    /// `tip_from_camera`, or `base_from_camera`.
    pub camera: Isometry3<f64>,
    /// `base_from_target`, or `tip_from_target`.
    target: Isometry3<f64>,
    pub tool: Isometry3<f64>,
    wrong: Wrong,
    /// The true points of the board.
    board: Vec<Point3<f64>>,
    /// The given lens.
    pub lens: Intrinsics,
}

pub struct Taken {
    pub joints: Vec<f64>,
    /// As given to the calibration.
    pub reported: Vec<f64>,
    pub corners: Vec<Corner>,
    /// The true pose of the tip from which the camera saw the target.
    tip: Isometry3<f64>,
}

impl Cell {
    pub fn new(name: &str, model: Model, real: Real, repeats: [f64; 2], mode: Mode) -> Self {
        let Model { believed, start, arm, .. } = model;
        let turned_over = UnitQuaternion::from_scaled_axis(Vector3::x() * std::f64::consts::PI);
        let centred = Translation3::from(-TARGET.centre().coords);
        // Before the camera: a target's z axis points away from the viewer.
        let before = Isometry3::translation(0.0, 0.0, if believed.links.len() < JOINTS_OF_A_POSE { 0.25 } else { 0.4 })
            * centred;
        let tip = believed.forward(&start);
        let universal = name.starts_with("ur");
        let reach = -(believed.links[2].place.x + believed.links[3].place.x);
        let (camera, target) = match mode {
            Mode::EyeInHand => {
                let camera = Isometry3::from_parts(
                    Translation3::new(0.03, -0.06, 0.05),
                    UnitQuaternion::from_scaled_axis(Vector3::new(0.05, -0.08, 0.4)),
                );
                // At its start an arm of Universal Robots stretches along −x.
                let on_table = Translation3::new(-0.6 * reach, -0.15 * reach, 0.05);
                let table = Isometry3::from_parts(on_table, turned_over) * centred;
                (camera, if universal { table } else { tip * camera * before })
            }
            Mode::EyeToHand => {
                let target = Isometry3::from_parts(Translation3::new(0.01, 0.02, 0.06), turned_over) * centred;
                let beside = Translation3::new(-0.65 * reach, -0.1 * reach, -0.1);
                let below = Isometry3::from_parts(beside, UnitQuaternion::identity());
                (if universal { below } else { tip * target * before.inverse() }, target)
            }
        };
        let tool = Isometry3::translation(0.0, 0.0, TOOL_M);
        let (wrong, board, lens) = (Wrong::Nothing, TARGET.points(), handeye_simulate::session::camera());
        Self { real, believed, arm, mode, start, repeats, camera, target, tool, wrong, board, lens }
    }

    /// The same with something else wrong.
    pub fn with(self, wrong: Wrong, rng: &mut ChaCha8Rng) -> Self {
        Self { wrong, board: wrong.board(rng), lens: wrong.lens(rng), ..self }
    }

    /// Whether it does not reach poses in general: then the tip of the tool arrives, along its direction as nearly as it can.
    pub fn has_few_joints(&self) -> bool {
        self.believed.links.len() < JOINTS_OF_A_POSE
    }

    /// Joint values that put the tip at a pose as the controller believes, within the ranges of the arm.
    pub fn believed_joints(&self, goal: &Isometry3<f64>, near: &[f64]) -> Option<Vec<f64>> {
        let joints = newton(|q| self.believed.forward(q), near, |tip| between(tip, goal))?;
        self.is_in_range(&joints).then_some(joints)
    }

    /// The same for a tool: with few joints its tip alone arrives.
    pub fn believed_touch(&self, goal: &Isometry3<f64>, tool: &Vector3<f64>, near: &[f64]) -> Option<Vec<f64>> {
        if !self.has_few_joints() {
            return self.believed_joints(goal, near);
        }
        let joints = touching(|q| self.believed.forward(q), goal, tool, near)?;
        self.is_in_range(&joints).then_some(joints)
    }

    fn is_in_range(&self, joints: &[f64]) -> bool {
        self.arm.joints().iter().zip(joints).all(|(joint, value)| joint.range.contains(*value))
    }

    /// Where the tip is when it is sent to joint values: it does not return to exactly the same place.
    pub fn sent(&self, joints: &[f64], rng: &mut ChaCha8Rng) -> Isometry3<f64> {
        let [metres, radians] = self.repeats;
        self.real.tip(joints) * shift_and_turn(&noise_twist(rng, metres, radians))
    }

    pub fn camera_from_target(&self, tip: &Isometry3<f64>) -> Isometry3<f64> {
        match self.mode {
            Mode::EyeInHand => (tip * self.camera).inverse() * self.target,
            Mode::EyeToHand => self.camera.inverse() * tip * self.target,
        }
    }

    /// Where a camera with this mounting is, with the tip there.
    pub fn camera_at(&self, tip: &Isometry3<f64>, mounted: &Isometry3<f64>) -> Isometry3<f64> {
        match self.mode {
            Mode::EyeInHand => tip * mounted,
            Mode::EyeToHand => *mounted,
        }
    }

    fn tip_for(&self, camera_from_target: &Isometry3<f64>) -> Isometry3<f64> {
        match self.mode {
            Mode::EyeInHand => self.target * camera_from_target.inverse() * self.camera.inverse(),
            Mode::EyeToHand => self.camera * camera_from_target * self.target.inverse(),
        }
    }

    /// This many views; fewer if the arm does not reach them.
    pub fn take(&self, views: usize, rng: &mut ChaCha8Rng) -> Vec<Taken> {
        let mut taken = Vec::new();
        for _ in 0..TRIES {
            if taken.len() < views {
                taken.extend(self.view(rng));
            }
        }
        if self.wrong == Wrong::Late {
            self.read_late(&mut taken);
        }
        taken
    }

    /// Joints as read when the arm has moved on towards the next view.
    fn read_late(&self, taken: &mut [Taken]) {
        let apart =
            |a: &Taken, b: &Taken| -> f64 { a.joints.iter().zip(&b.joints).map(|(a, b)| (a - b).powi(2)).sum() };
        for k in 1..taken.len() {
            let nearest = (k..taken.len())
                .min_by(|a, b| apart(&taken[k - 1], &taken[*a]).total_cmp(&apart(&taken[k - 1], &taken[*b])));
            taken.swap(k, nearest.unwrap_or(k));
        }
        let joints: Vec<Vec<f64>> = taken.iter().map(|view| view.joints.clone()).collect();
        for (view, next) in taken.iter_mut().zip(joints.iter().cycle().skip(1)) {
            let way = next.iter().zip(&view.joints).map(|(to, from)| (to - from).sin().atan2((to - from).cos()));
            let place = |joints: &[f64]| self.believed.forward(joints).translation.vector;
            let turned = |joints: &[f64]| self.believed.forward(joints).rotation;
            let part = LATE_M / (place(next) - place(&view.joints)).norm().max(LATE_M);
            let part = part.min(LATE_RAD / turned(next).angle_to(&turned(&view.joints)).max(LATE_RAD));
            view.reported = view.joints.iter().zip(way).map(|(from, way)| from + part * way).collect();
        }
    }

    fn view(&self, rng: &mut ChaCha8Rng) -> Option<Taken> {
        if self.has_few_joints() {
            let joints: Vec<f64> = self.start.iter().map(|angle| angle + JOINTS_RAD * normal(rng)).collect();
            return if self.is_in_range(&joints) { self.view_at(joints, rng) } else { None };
        }
        let wanted = self.tip_for(&CONE.draw(&TARGET, rng));
        let near = self.near_start(rng);
        self.view_at(self.believed_joints(&wanted, &near)?, rng)
    }

    /// What is seen with the joints there; nothing if the board is not completely in the image.
    pub fn view_at(&self, joints: Vec<f64>, rng: &mut ChaCha8Rng) -> Option<Taken> {
        let tip = self.sent(&joints, rng);
        let pose = self.camera_from_target(&tip);
        let lens = camera();
        let corners = self.board.iter().enumerate().map(|(i, point)| {
            let px = lens::pixel(&lens, &(pose * point))?;
            let noise = Vector2::new(normal(rng), normal(rng)) * CORNER_PX;
            lens::is_in_image(&lens, &px).then(|| Corner::new(i, px + noise))
        });
        Some(Taken { reported: joints.clone(), joints, corners: corners.collect::<Option<_>>()?, tip })
    }

    /// Near where an arm is before its work: some start finds every pose.
    fn near_start(&self, rng: &mut ChaCha8Rng) -> Vec<f64> {
        let mut joints: Vec<f64> = self.start.iter().map(|angle| angle + 0.3 * normal(rng)).collect();
        if let Some(last) = joints.last_mut() {
            *last = rng.random_range(-std::f64::consts::PI..std::f64::consts::PI);
        }
        joints
    }

    /// The tip of the tool in the frame of the tip, from an arm that rotated about one point: `believed` returns where it takes its
    /// tip to be. The poses are rotated from that of a view, and reached from there, as an operator does.
    pub fn tool_by(
        &self,
        believed: impl Fn(&[f64]) -> Isometry3<f64>,
        taken: &[Taken],
        rng: &mut ChaCha8Rng,
    ) -> Option<Vector3<f64>> {
        let near = &taken[rng.random_range(0..taken.len())].joints;
        let middle = self.believed.forward(near);
        let point = middle * self.tool;
        let (mut normal_matrix, mut right) = (Matrix6::zeros(), Vector6::zeros());
        let mut count = 0;
        for _ in 0..TRIES {
            if count == TURNS {
                break;
            }
            let turn = UnitQuaternion::from_scaled_axis(Vector3::from_fn(|_, _| rng.random_range(-0.5..0.5)));
            let goal = Isometry3::from_parts(point.translation, middle.rotation * turn) * self.tool.inverse();
            let Some(joints) = self.believed_joints(&goal, near) else { continue };
            // The operator sees the point and corrects: the tip of the tool is there, whatever the controller believes.
            let wanted = point.translation.vector;
            // The reported joints are not exact.
            let [metres, radians] = self.repeats;
            let unreported = shift_and_turn(&noise_twist(rng, metres, radians));
            let jogged = newton(
                |q| self.real.tip(q) * unreported,
                &joints,
                |tip| {
                    let off = (tip * self.tool).translation.vector - wanted;
                    let turn = (tip.rotation.inverse() * goal.rotation).scaled_axis();
                    let off = tip.rotation.inverse() * -off;
                    Vector6::new(off.x, off.y, off.z, turn.x, turn.y, turn.z)
                },
            );
            let Some(joints) = jogged else { continue };
            let tip = believed(&joints);
            let mut row = Matrix3x6::zeros();
            row.fixed_columns_mut::<3>(0).copy_from(tip.rotation.to_rotation_matrix().matrix());
            row.fixed_columns_mut::<3>(3).copy_from(&-Matrix3::identity());
            normal_matrix += row.transpose() * row;
            right += row.transpose() * -tip.translation.vector;
            count += 1;
        }
        if count < TURNS {
            return None;
        }
        Some((normal_matrix.try_inverse()? * right).fixed_rows::<3>(0).into_owned())
    }

    /// The same from points that the camera saw, where its frame is `mounted`: an operator moves the tip of the tool to each of them.
    pub fn tool_by_touching(
        &self,
        believed: impl Fn(&[f64]) -> Isometry3<f64>,
        mounted: &Isometry3<f64>,
        taken: &[Taken],
        rng: &mut ChaCha8Rng,
    ) -> Option<Vector3<f64>> {
        let mut found = Vec::new();
        for _ in 0..TRIES {
            if found.len() == TURNS {
                break;
            }
            let view = &taken[rng.random_range(0..taken.len())];
            let (in_camera, truth) = self.point(view, rng);
            let near = Isometry3::from_parts(truth.coords.into(), self.down(taken, rng)) * self.tool.inverse();
            let tool = self.tool.translation.vector;
            let Some(joints) = self.believed_touch(&near, &tool, &view.joints) else { continue };
            let [metres, radians] = self.repeats;
            let unreported = shift_and_turn(&noise_twist(rng, metres, radians));
            let jogged = touching(|q| self.real.tip(q) * unreported, &near, &tool, &joints);
            let Some(joints) = jogged else { continue };
            let seen = self.camera_at(&believed(&view.joints), mounted) * in_camera;
            found.push((believed(&joints).inverse() * seen).coords);
        }
        (found.len() == TURNS).then(|| found.iter().sum::<Vector3<f64>>() / TURNS as f64)
    }

    /// A point that the camera saw: in its frame, and in the base.
    pub fn point(&self, view: &Taken, rng: &mut ChaCha8Rng) -> (Point3<f64>, Point3<f64>) {
        let corner: Point3<f64> = self.board[rng.random_range(0..self.board.len())];
        let in_camera: Point3<f64> = self.camera_from_target(&view.tip) * corner;
        (in_camera, self.camera_at(&view.tip, &self.camera) * in_camera)
    }

    /// How the tool is oriented when it touches: against the board's normal, or along the mean axis that the tip had in the views;
    /// tilted by up to 15°, with any rotation about itself.
    pub fn down(&self, taken: &[Taken], rng: &mut ChaCha8Rng) -> UnitQuaternion<f64> {
        let axis = match self.mode {
            Mode::EyeInHand => self.target.rotation * Vector3::z(),
            Mode::EyeToHand => {
                taken.iter().map(|view| self.believed.forward(&view.joints).rotation * Vector3::z()).sum()
            }
        };
        let along = UnitQuaternion::rotation_between(&Vector3::z(), &axis)
            .unwrap_or_else(|| UnitQuaternion::from_scaled_axis(Vector3::x() * std::f64::consts::PI));
        let tilt = 15.0_f64.to_radians() * rng.random::<f64>().sqrt();
        let azimuth = rng.random_range(-3.1..3.1_f64);
        let tilt = Vector3::new(azimuth.cos(), azimuth.sin(), 0.0) * tilt;
        let turn = Vector3::z() * rng.random_range(-3.1..3.1);
        along * UnitQuaternion::from_scaled_axis(tilt) * UnitQuaternion::from_scaled_axis(turn)
    }

    /// Distance from a point in the base to the tip of the tool of an arm that is sent to joint values.
    pub fn off(&self, joints: &[f64], point: &Point3<f64>, rng: &mut ChaCha8Rng) -> f64 {
        ((self.sent(joints, rng) * self.tool).translation.vector - point.coords).norm()
    }
}

/// Joint values of a chain with few joints that take the tip of a tool where a pose of its tip has it, its z axis as nearly as
/// possible along that of the pose.
fn touching(
    forward: impl Fn(&[f64]) -> Isometry3<f64>,
    goal: &Isometry3<f64>,
    tool: &Vector3<f64>,
    near: &[f64],
) -> Option<Vec<f64>> {
    let direction = |pose: &Isometry3<f64>| pose.rotation * Vector3::z();
    let off = |tip: &Isometry3<f64>| {
        let shift = tip * Point3::from(*tool) - goal * Point3::from(*tool);
        let turn = (direction(tip) - direction(goal)) * TURN_M;
        Vector6::new(shift.x, shift.y, shift.z, turn.x, turn.y, turn.z)
    };
    let joints = nearest(&forward, near, off)?;
    let tip = forward(&joints);
    let arrives = off(&tip).fixed_rows::<3>(0).norm() < 1e-6;
    (arrives && direction(&tip).angle(&direction(goal)) < NEAR_RAD).then_some(joints)
}
