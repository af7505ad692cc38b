//! A cell that takes the poses that guided capture proposes: an arm, a camera and a board whose places are known.

use nalgebra::{Isometry3, Point3, SMatrix, Translation3, UnitQuaternion, Vector2, Vector3};
use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;

use crate::guided::choose::Robot;
use crate::guided::{Ending, Guide, GuidedOptions, Known, Next, Step};
use crate::{self as plan, ArmBody, Carried, Obstacle, Pace, Surroundings};
use handeye_arm::testing as arms;
use handeye_arm::{Arm, ArmKind, JointValues};
use handeye_estimate::corrected_arm::CorrectedArm;
use handeye_estimate::diagnose::findings::FindingOptions;
use handeye_estimate::diagnose::{Calibration, calibrate_with};
use handeye_estimate::handeye::joint::{Noise, ViewModel};
use handeye_estimate::handeye::{HandEye, Mode};
use handeye_estimate::placement::{ArmOfViews, Placement};
use handeye_estimate::{CameraKnowledge, DEFAULT_MODEL, Method, Observations, ObservedView, Options};
use handeye_geometry::camera::{Distortion, Intrinsics};
use handeye_geometry::frames::{Base, Mount, Pose, Tip};
use handeye_geometry::progress::CancelToken;
use handeye_geometry::se3;
use handeye_geometry::testing::BOARD;
use handeye_simulate::links::{Field, Links, noise_twist, robot_error};
use handeye_simulate::session::{REALISTIC, bent, camera, seen};

/// The arm of the cell.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum CellArm {
    /// UR5e, six joints, closed form.
    Ur5e,
    /// Franka Panda, seven joints.
    Panda,
    /// UFACTORY xArm 6, six joints, no closed form.
    Xarm6,
}

impl CellArm {
    /// All of them.
    pub const ALL: [Self; 3] = [Self::Ur5e, Self::Panda, Self::Xarm6];

    fn chain(self) -> Arm {
        let from_file = |file: arms::ArmFile| file.arm().expect("a file of this project");
        match self {
            Self::Ur5e => ArmKind::Ur5e.arm(),
            Self::Panda => from_file(arms::PANDA),
            Self::Xarm6 => from_file(arms::XARM6),
        }
    }

    /// Joint values over a board in front of the arm.
    fn home(self) -> Vec<f64> {
        match self {
            // Its base looks along -x.
            Self::Ur5e => vec![std::f64::consts::PI, -1.6, 1.9, -1.9, -1.57, 0.0],
            Self::Panda => vec![0.0, -0.7, 0.0, -2.27, 0.0, 1.57, 0.785],
            Self::Xarm6 => vec![0.0, -0.52, -1.05, 0.0, 1.57, 0.0],
        }
    }
}

/// Setup of a cell.
#[derive(Debug, Clone, Copy)]
pub struct CellSetup {
    /// Its arm.
    pub arm: CellArm,
    /// Where the camera is mounted.
    pub mode: Mode,
    /// Errors of corners and robot.
    pub noise: Noise,
    /// Whether the lens is to be estimated.
    pub free_lens: bool,
    /// Focal length \[px\] of a first view that is straight on, with the board close to the edge of the image; `None` for that
    /// of the other studies, and a first view that is tilted a little.
    pub straight: Option<f64>,
    /// What differs from the stated values.
    pub hidden: HiddenErrors,
    /// Seed of places and noise.
    pub seed: u64,
}

impl CellSetup {
    /// A good robot and a good camera whose lens is known, a first view that is tilted a little, and everything as stated.
    pub fn new(arm: CellArm, mode: Mode, seed: u64) -> Self {
        Self { arm, mode, noise: REALISTIC, free_lens: false, straight: None, hidden: HiddenErrors::NOTHING, seed }
    }
}

/// Errors that the guide does not know, and that its estimate has to find.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct HiddenErrors {
    /// Deflection of the middle of the board against its edges along x and along y, metres.
    pub bend_m: [f64; 2],
    /// True focal length over that of the lens which is stated to be known.
    pub focal: f64,
    /// Standard deviations of the displacement of every joint but the last about and along each axis, radians and metres; with them
    /// the views have joint values.
    pub links: Option<(f64, f64)>,
}

impl HiddenErrors {
    /// Everything is as stated.
    pub const NOTHING: Self = Self { bend_m: [0.0; 2], focal: 1.0, links: None };
}

/// Places of everything in a cell, and what its arm must not touch.
#[derive(Debug, Clone)]
pub struct Places {
    /// The arm, with nothing on its tip.
    pub arm: plan::Arm,
    /// Its joint values at the first view, radians; metres for a prismatic joint.
    pub joints: JointValues,
    /// The surroundings, without camera and board.
    pub around: Surroundings,
    /// Poses of camera and board.
    pub links: Links,
    /// The lens.
    pub intrinsics: Intrinsics,
}

/// Distance from the first pose at which pose-dependent errors of the robot are as large as the noise, metres: about
/// the RMS spread of the tip in a guided session.
const FIELD_SPREAD_M: f64 = 0.15;

/// A cell in which guided sessions are run, with its truth.
#[derive(Debug, Clone)]
pub struct GuidedCell {
    setup: CellSetup,
    rng: ChaCha8Rng,
    intrinsics: Intrinsics,
    /// The true places of camera and board.
    pub links: Links,
    /// The arm at its present place.
    pub robot: Robot,
    /// The observations so far.
    pub observations: Observations,
    /// Points of the true board.
    points: Vec<Point3<f64>>,
    /// Pose-dependent errors of the robot.
    field: Option<Field>,
    /// The true chain, where it differs from the controller's.
    true_chain: Option<Arm>,
    /// Joint values of the views, where they have them, radians.
    joints_rad: Vec<Option<Vec<f64>>>,
}

/// Result of a guided session.
#[derive(Debug, Clone)]
pub struct GuidedRun {
    /// Why it ended.
    pub ending: Ending,
    /// The calibration at the end.
    pub calibration: Option<Calibration>,
    /// Moves that showed no board.
    pub failed: usize,
    /// For each number of views with an answer: views, stated 95 % error and true error, metres.
    pub history: Vec<(usize, f64, f64)>,
    /// Every pose that was proposed.
    pub steps: Vec<Step>,
    /// When the views were taken, seconds.
    pub times_s: Vec<f64>,
}

/// Where the tip of a tool is in the frame of the tip, metres.
const TOOL_M: [f64; 3] = [0.0, 0.0, 0.1];
/// Free space that the arm keeps, metres.
const CLEARANCE_M: f64 = 0.02;
/// Limits with which its joints are driven.
const PACE: Pace = Pace { speed: 1.0, acceleration: 2.0, jerk: f64::INFINITY };
/// Table on which the arm is mounted.
const TABLE: [f64; 3] = [4.0, 4.0, 0.1];

impl GuidedCell {
    /// Draws the places of camera and board, with the board in view of an arm that touches nothing.
    ///
    /// # Panics
    /// When there are no such places: a mistake in the setup.
    pub fn new(setup: CellSetup) -> Self {
        let mut rng = ChaCha8Rng::seed_from_u64(setup.seed);
        let cell = |places| Self::within_reach(setup, places);
        let mut cell = (0..1000).find_map(|_| cell(drawn(setup, &mut rng)?)).expect("most places are good");
        let Noise { field_m, field_rad, .. } = setup.noise;
        if field_m > 0.0 || field_rad > 0.0 {
            let mut part =
                |size: f64| SMatrix::<f64, 3, 3>::from_fn(|_, _| noise_twist(&mut rng, size, 0.0).x / FIELD_SPREAD_M);
            let mut slopes = SMatrix::<f64, 6, 3>::zeros();
            slopes.fixed_rows_mut::<3>(0).copy_from(&part(field_m));
            slopes.fixed_rows_mut::<3>(3).copy_from(&part(field_rad));
            cell.field = Some(Field { origin_m: cell.base_from_tip().translation(), slopes });
        }
        cell
    }

    /// A cell with given places, for which `arm`, `straight` and pose-dependent errors of the setup are ignored; `None` where
    /// the arm touches something at the first view, or the board is not wholly in it.
    pub fn placed(setup: CellSetup, places: Places) -> Option<Self> {
        let cell = Self::within_reach(setup, places)?;
        cell.clone().view(&cell.base_from_tip()).map(|_| cell)
    }

    /// `None` where the arm touches something at the first view.
    fn within_reach(setup: CellSetup, places: Places) -> Option<Self> {
        let Places { mut arm, joints, around, links, intrinsics: lens } = places;
        let (mount_from_camera, anchor_from_target) = (&links.mount_from_camera, &links.anchor_from_target);
        let (carried, beside) = match setup.mode {
            Mode::EyeInHand => {
                let board = plan::sheet(&BOARD, &Pose::from_isometry(*anchor_from_target.isometry()), 0.0);
                (Carried::camera(mount_from_camera.isometry()), board)
            }
            Mode::EyeToHand => {
                let camera = plan::housing(&Pose::from_isometry(*mount_from_camera.isometry()), 0.0);
                (Carried::board(&BOARD, &Pose::from_isometry(*anchor_from_target.isometry()), 0.0), camera)
            }
        };
        arm.carried = vec![carried];
        // The place of the other one of camera and board has to be found by the guide.
        let all = around.clone().and(Surroundings::of(vec![beside]));
        if !arm.is_free(&joints, &all, CLEARANCE_M) {
            return None;
        }
        // With all parameters that are estimated of a lens by default, which this one may not have.
        let free = match lens.distortion {
            Distortion::None => Intrinsics { distortion: DEFAULT_MODEL, ..lens },
            _ => lens,
        };
        let focal = setup.hidden.focal;
        let mut of_links = ChaCha8Rng::seed_from_u64(setup.seed ^ 0x117c5);
        let true_chain = setup.hidden.links.map(|(rad, m)| {
            let mut moved: Vec<Isometry3<f64>> =
                (0..arm.chain.joint_count()).map(|_| se3::exp(&noise_twist(&mut of_links, m, rad))).collect();
            // A tool behind the last joint would be found with the same arm, which hides the displacement of that along its
            // axis.
            moved[arm.chain.joint_count() - 1] = Isometry3::identity();
            arm.chain.displaced(&moved).expect("small")
        });
        let reported = Intrinsics { fx: lens.fx / focal, fy: lens.fy / focal, ..lens };
        let (intrinsics, knowledge) =
            if setup.free_lens { (free, CameraKnowledge::NOTHING) } else { (lens, CameraKnowledge::Fixed(reported)) };
        Some(Self {
            setup,
            rng: ChaCha8Rng::seed_from_u64(setup.seed ^ 0x5eed),
            intrinsics,
            links,
            robot: Robot { arm, around, clearance_m: CLEARANCE_M, joints, pace: PACE, sight: None },
            observations: Observations {
                mode: Some(setup.mode),
                target: BOARD,
                image_size: (intrinsics.width, intrinsics.height),
                camera: knowledge,
                views: Vec::new(),
            },
            points: bent(&BOARD.points(), setup.hidden.bend_m, 1.0),
            field: None,
            true_chain,
            joints_rad: Vec::new(),
        })
    }

    /// The tip pose by the controller.
    ///
    /// # Panics
    /// Never: the joints are those of the arm.
    pub fn base_from_tip(&self) -> Pose<Base, Tip> {
        self.robot.arm.tip(&self.robot.joints).expect("its own joints")
    }

    /// The true lens.
    pub fn camera(&self) -> &Intrinsics {
        &self.intrinsics
    }

    /// Drives the arm there and captures; returns whether the whole board was in the image.
    pub fn capture(&mut self, joints: &JointValues) -> bool {
        self.robot.joints = *joints;
        let at = self.base_from_tip();
        let Some(mut view) = self.view(&at) else { return false };
        if self.true_chain.is_some() {
            view.tip_from_joints = self.robot.arm.tip_from_joints(&at, joints);
        }
        self.observations.views.push(view);
        self.joints_rad.push(self.true_chain.as_ref().map(|_| joints.to_vec()));
        true
    }

    /// The true tip pose with these joint values.
    fn true_tip(&self, joints: &[f64]) -> Pose<Base, Tip> {
        let Some(chain) = &self.true_chain else { return self.robot.arm.tip(joints).expect("its own joints") };
        plan::Arm { chain: chain.clone(), ..self.robot.arm.clone() }.tip(joints).expect("its own joints")
    }

    /// Captures at a tip pose that the robot reports, however it got there; returns whether the whole board was in the
    /// image.
    ///
    /// # Panics
    /// With link errors: the true tip pose then depends on the joints.
    pub fn capture_at(&mut self, base_from_tip: &Pose<Base, Tip>) -> bool {
        assert!(self.true_chain.is_none(), "the joints have to be known");
        let Some(view) = self.view(base_from_tip) else { return false };
        self.observations.views.push(view);
        self.joints_rad.push(None);
        true
    }

    /// The view that would be captured at a tip pose that the robot reports.
    fn view(&mut self, base_from_tip: &Pose<Base, Tip>) -> Option<ObservedView> {
        let error = robot_error(&mut self.rng, &self.setup.noise);
        let by_place = self.field.map_or_else(Isometry3::identity, |field| field.error(base_from_tip));
        let by_links = if self.true_chain.is_some() { self.true_tip(&self.robot.joints) } else { *base_from_tip };
        let true_tip = Pose::from_isometry(by_links.isometry() * by_place * error);
        let camera_from_target = self.links.camera_from_target(&true_tip);
        let no_more = |_| Vector2::zeros();
        let corners = seen(
            &mut self.rng,
            &self.intrinsics,
            camera_from_target.isometry(),
            &self.points,
            self.setup.noise.corner_px,
            no_more,
        )?;
        let name = format!("view {}", self.observations.views.len());
        Some(ObservedView::new(name, Some(*base_from_tip), Some(corners.into())))
    }

    /// Error of a point by a calibration, metres: where the camera saw the board, which is where the expected error is
    /// stated.
    pub fn true_error_m(&self, calibration: &Calibration) -> Option<f64> {
        let estimated = calibration.hand_eye?.mount_from_camera();
        let point = calibration.joint.as_ref()?.reference_point;
        let off = (self.mount_from_tip() * self.links.mount_from_camera).inverse() * estimated;
        Some((off.isometry() * point - point).norm())
    }

    /// Pose-dependent error of the robot in the middle of the session's places: a camera on the tip cannot be
    /// distinguished from one that is off by as much, and measures with the same arm.
    fn mount_from_tip(&self) -> Pose<Mount, Mount> {
        let tips = self.observations.views.iter().filter_map(|view| view.base_from_tip);
        let count = self.observations.views.len() as f64;
        let middle = tips.map(|tip| tip.translation()).sum::<Vector3<f64>>() / count;
        let at_middle = Pose::from_isometry(Translation3::from(middle).into());
        match (&self.field, self.setup.mode) {
            (Some(field), Mode::EyeInHand) => Pose::from_isometry(field.error(&at_middle)),
            _ => Pose::identity(),
        }
    }

    /// The model with the true values.
    pub fn truth(&self) -> ViewModel {
        let Self { setup, intrinsics, links, .. } = self;
        let hand_eye = HandEye::new(setup.mode, links.mount_from_camera, links.anchor_from_target);
        ViewModel::known(hand_eye, *intrinsics, setup.free_lens, setup.noise, &BOARD)
    }

    /// The input of a guide, with an answer from the views so far.
    pub fn known<'a>(&'a self, calibration: Option<&'a Calibration>, elapsed_s: f64) -> Known<'a> {
        Known { observations: &self.observations, calibration, robot: Some(&self.robot), elapsed_s }
    }

    /// The calibration from the views so far.
    pub fn calibrate(&self) -> Option<Calibration> {
        let of_views = self.true_chain.as_ref().map(|_| self.arm_of_views());
        let wanted = FindingOptions::default().with_arm(of_views.as_ref());
        calibrate_with(&self.observations, Method::Joint, Options::default(), &wanted, &CancelToken::default()).ok()
    }

    /// The arm by its controller.
    fn arm_of_views(&self) -> ArmOfViews {
        let plan::Arm { chain, world_from_arm, connection_from_tip, .. } = &self.robot.arm;
        let mounted =
            chain.clone().mounted(world_from_arm * chain.base_from_first, chain.flange_from_tip * connection_from_tip);
        let misses = vec![(0.0, 0.0); self.observations.views.len()];
        ArmOfViews {
            placement: Placement { arm: mounted, misses },
            tool_m: TOOL_M,
            joints_rad: self.joints_rad.clone(),
        }
    }

    /// Distances of a tool from points of the board that the camera saw, one a view, when it is sent there by corrected commands,
    /// metres, against the board, or with a camera next to the robot along the mean axis of the tip; only those that the arm
    /// reaches.
    ///
    /// # Panics
    /// Where the calibration has no arm.
    pub fn touches_m(&self, calibration: &Calibration) -> Vec<f64> {
        let errors = calibration.arm().expect("the joints are known");
        let corrected = CorrectedArm::new(self.arm_of_views().placement.arm, errors).expect("its own");
        let found = errors.hand_eye.mount_from_camera();
        let (camera, target) = (self.links.mount_from_camera.isometry(), self.links.anchor_from_target.isometry());
        let tool = Point3::from(TOOL_M);
        let axes = self.joints_rad.iter().flatten().map(|joints| self.true_tip(joints).rotation() * Vector3::z());
        let along = match self.setup.mode {
            Mode::EyeInHand => target.rotation,
            Mode::EyeToHand => UnitQuaternion::rotation_between(&Vector3::z(), &axes.sum::<Vector3<f64>>())
                .expect("not the other way round"),
        };
        let touch = |(k, joints): (usize, &Vec<f64>)| {
            let corner = self.points[7 * k % self.points.len()];
            let (true_tip, tip) = (*self.true_tip(joints).isometry(), *corrected.actual(joints).ok()?.isometry());
            let (in_camera, point, seen) = match self.setup.mode {
                Mode::EyeInHand => {
                    let in_camera = (true_tip * camera).inverse() * (target * corner);
                    (in_camera, target * corner, tip * found.isometry() * in_camera)
                }
                Mode::EyeToHand => {
                    let in_camera = camera.inverse() * (true_tip * target * corner);
                    (in_camera, camera * in_camera, found.isometry() * in_camera)
                }
            };
            assert!(in_camera.z > 0.0, "it is seen");
            let turn = along * UnitQuaternion::from_axis_angle(&Vector3::z_axis(), 2.4 * k as f64);
            let goal = Isometry3::from_parts((seen.coords - turn * tool.coords).into(), turn);
            let command = corrected.command(&Pose::from_isometry(goal), joints).ok()?;
            Some((self.true_tip(&command.joints_rad).isometry() * tool - point).norm())
        };
        self.joints_rad.iter().flatten().enumerate().filter_map(touch).collect()
    }

    /// A whole guided session from the first view on.
    pub fn run(&mut self, options: GuidedOptions) -> GuidedRun {
        let mut guide = Guide::new(options);
        let first = self.robot.joints;
        let (mut failed, mut history, mut calibration) = (0, Vec::new(), None);
        let mut time_s = guide.options().dwell_s;
        let mut times_s = vec![time_s];
        assert!(self.capture(&first), "the board is in view at the beginning");
        loop {
            let known = self.known(calibration.as_ref(), time_s);
            let plan = match guide.next(&known, &CancelToken::default()) {
                Next::End(ending) => {
                    let steps = guide.steps().to_vec();
                    return GuidedRun { ending, calibration, failed, history, steps, times_s };
                }
                Next::Go { plan, .. } => plan,
            };
            let proposal = &plan.proposals[0];
            let joints = proposal.joints.expect("the chain is known");
            time_s += proposal.travel_s + guide.options().dwell_s;
            if self.capture(&joints) {
                times_s.push(time_s);
                guide.captured();
                calibration = self.calibrate();
                if let Some(solved) = &calibration
                    && let (Some(stated), Some(truth)) = (solved.tip_error_95_m(), self.true_error_m(solved))
                {
                    history.push((self.observations.views.len(), stated, truth));
                }
            } else {
                failed += 1;
                guide.failed();
            }
        }
    }
}

/// Random places, with the board in view of an arm that gets there; `None` where it does not.
fn drawn(setup: CellSetup, rng: &mut ChaCha8Rng) -> Option<Places> {
    let mut about = |scale: f64| (rng.random::<f64>() * 2.0 - 1.0) * scale;
    let down = UnitQuaternion::from_axis_angle(&Vector3::x_axis(), std::f64::consts::PI);
    // The middle of the board over the table, a little tilted, its printed side up; z of a target points into it.
    let in_front = Vector3::new(0.42 + about(0.05), about(0.12), 0.06 + about(0.03));
    let yaw = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), about(3.0));
    let lying = Isometry3::from_parts(in_front.into(), yaw * down * tilt(about(0.15), about(0.15)))
        * Translation3::from(-BOARD.centre().coords);
    let beside = Isometry3::from_parts(
        Vector3::new(0.06 + about(0.02), about(0.03), 0.04 + about(0.02)).into(),
        UnitQuaternion::from_axis_angle(&Vector3::z_axis(), about(3.0)) * tilt(about(0.2), about(0.2)),
    );
    let distance_m = 0.38 + about(0.06);
    let seen_first = Isometry3::from_parts(
        Vector3::new(about(0.03), about(0.03), distance_m).into(),
        tilt(about(0.2), about(0.2)) * UnitQuaternion::from_axis_angle(&Vector3::z_axis(), about(0.5)),
    ) * Translation3::from(-BOARD.centre().coords);
    let lens = setup.straight.map_or_else(camera, |focal_px| Intrinsics::pinhole(640, 480, focal_px));
    let seen_first = match setup.straight {
        // Some 40 px from the edge of the image of 640 px; BOARD is 135 mm wide.
        Some(focal_px) => {
            Isometry3::translation(280.0 * distance_m / focal_px - 0.0675, 0.0, distance_m)
                * Translation3::from(-BOARD.centre().coords)
        }
        None => seen_first,
    };
    let (mount_from_camera, anchor_from_target, first_tip) = match setup.mode {
        Mode::EyeInHand => {
            let first_tip = lying * seen_first.inverse() * beside.inverse();
            (beside, lying, first_tip)
        }
        Mode::EyeToHand => {
            // The camera is on the far side and looks at the board that the arm holds up in front of it.
            let board_at = Vector3::new(0.45 + about(0.05), about(0.1), 0.45 + about(0.05));
            let facing = UnitQuaternion::from_axis_angle(&Vector3::y_axis(), -std::f64::consts::FRAC_PI_2);
            let camera_turn = facing * UnitQuaternion::from_axis_angle(&Vector3::z_axis(), about(0.3));
            let base_from_camera = Isometry3::from_parts((board_at + Vector3::x() * distance_m).into(), camera_turn);
            let on_tip = Isometry3::from_parts(
                Vector3::new(about(0.02), about(0.02), 0.05).into(),
                down * UnitQuaternion::from_axis_angle(&Vector3::z_axis(), about(3.0)),
            ) * Translation3::from(-BOARD.centre().coords);
            (base_from_camera, on_tip, base_from_camera * seen_first * on_tip.inverse())
        }
    };
    let chain = setup.arm.chain();
    let arm = plan::Arm {
        body: ArmBody::of(&chain),
        chain,
        world_from_arm: Isometry3::identity(),
        connection_from_tip: Isometry3::identity(),
        carried: Vec::new(),
    };
    let table = Obstacle::new("table", Isometry3::translation(0.0, 0.0, -TABLE[2] / 2.0 - 0.01), TABLE);
    let joints = arm.reach(&Pose::from_isometry(first_tip), &setup.arm.home())?;
    Some(Places {
        arm,
        joints,
        around: Surroundings::of(vec![table]),
        links: Links {
            mode: setup.mode,
            mount_from_camera: Pose::from_isometry(mount_from_camera),
            anchor_from_target: Pose::from_isometry(anchor_from_target),
        },
        intrinsics: lens,
    })
}

fn tilt(about_x: f64, about_y: f64) -> UnitQuaternion<f64> {
    UnitQuaternion::from_scaled_axis(Vector3::new(about_x, about_y, 0.0))
}
