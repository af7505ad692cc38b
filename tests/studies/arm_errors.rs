//! What the errors of an arm do to a touched point, and what is left of them once the command is corrected.
//!
//!     cargo run --release -p handeye_studies --example arm_errors -- [CSV] [VIEWS] [lens] [exact]
//!
//! The arms are those of the factory calibrations in the CSV (its columns: `arm, model, link, x_m, y_m, z_m, roll_rad, pitch_rad,
//! yaw_rad`): the arm moves by them, and its controller believes the numbers of the data sheet. Corners have 0.1 px of noise, the
//! arm repeats to 0.02 mm and 0.005°. A tool of 120 mm, whose tip was found by the same arm about one point, is sent down to points
//! that the camera saw; the distance between the two is printed, RMS over 40 points a session, one session an arm and a set-up. Beside it
//! stands what a point in space is off by the hand-eye transform alone, and what is stated of that; what no view can tell from the
//! transform (the arm's first joint, the zero of its last) is no error of it. With `exact` the arms are as their data sheets have them.
//! Nothing of the truth comes from the estimator: chains, lens and noise are written out here or in `handeye_simulate`.

use std::collections::BTreeMap;
use std::process::ExitCode;

use handeye_arm::{Arm, ArmKind};
use handeye_estimate::corrected_arm::CorrectedArm;
use handeye_estimate::diagnose::findings::FindingOptions;
use handeye_estimate::diagnose::{Calibration, calibrate_with};
use handeye_estimate::handeye::joint::ArmErrors;
use handeye_estimate::handeye::{HandEye, Mode};
use handeye_estimate::placement::{ArmOfViews, JointView, place_checked};
use handeye_estimate::{CameraKnowledge, Method, Observations, ObservedView, Options};
use handeye_geometry::frames::{Base, Pose, Tip};
use handeye_geometry::progress::CancelToken;
use handeye_geometry::statistics::median;
use handeye_geometry::targets::observation::Corner;
use handeye_geometry::targets::{Grid, TargetSpec};
use handeye_simulate::lens;
use handeye_simulate::links::{noise_twist, normal, shift_and_turn};
use handeye_simulate::session::{Cone, camera};
use nalgebra::{
    DMatrix, DVector, Isometry3, Matrix3x6, Matrix6, Point3, Translation3, UnitQuaternion, Vector2, Vector3, Vector6,
};
use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;

type Failure = Box<dyn std::error::Error + Send + Sync>;
type Joints = [f64; 6];

const TARGET: TargetSpec = TargetSpec::Chessboard(Grid { columns: 9, rows: 6, square_m: 0.025 });
const CORNER_PX: f64 = 0.1;
const REPEATS: (f64, f64) = (2e-5, 0.005 * std::f64::consts::PI / 180.0);
const TOOL_M: f64 = 0.12;
const TOUCHES: usize = 40;
/// Draws at the most until as many views or touches are within reach.
const TRIES: usize = 2000;
const CONE: Cone =
    Cone { tilt_deg: 40.0, roll_deg: 150.0, distance_m: 0.3..0.5, beside_m: 0.04, distance_first: false };

/// One link as `ur_description` has it: `Trans(xyz) Rz(yaw) Ry(pitch) Rx(roll)`, then the joint about z.
#[derive(Clone, Copy)]
struct Link {
    place: Vector3<f64>,
    turn: Vector3<f64>,
}

/// A chain of six links.
#[derive(Clone)]
struct Chain([Link; 6]);

impl Chain {
    fn forward(&self, joints: &Joints) -> Isometry3<f64> {
        self.0.iter().zip(joints).fold(Isometry3::identity(), |pose, (link, angle)| {
            let [roll, pitch, yaw] = [link.turn.x, link.turn.y, link.turn.z];
            let fixed = UnitQuaternion::from_euler_angles(roll, pitch, yaw);
            pose * Translation3::from(link.place) * fixed * UnitQuaternion::from_axis_angle(&Vector3::z_axis(), *angle)
        })
    }

    /// The numbers of the data sheet.
    fn nominal(model: &str) -> Option<Self> {
        let [z, fore, wrist_x, wrist_z, second, third] = match model {
            "ur3" => [151.9, -243.65, -213.25, 112.35, -85.35, 81.9],
            "ur5" => [89.159, -425.0, -392.25, 109.15, -94.65, 82.3],
            "ur10" => [127.3, -612.0, -572.3, 163.941, -115.7, 92.2],
            "ur3e" => [151.85, -243.55, -213.2, 131.05, -85.35, 92.1],
            "ur5e" => [162.5, -425.0, -392.2, 133.3, -99.7, 99.6],
            "ur10e" => [180.7, -612.7, -571.55, 174.15, -119.85, 116.55],
            _ => return None,
        };
        let (quarter, half) = (std::f64::consts::FRAC_PI_2, std::f64::consts::PI);
        let link = |place: [f64; 3], turn: [f64; 3]| Link { place: Vector3::from(place) * 1e-3, turn: turn.into() };
        Some(Self([
            link([0.0, 0.0, z], [0.0; 3]),
            link([0.0; 3], [quarter, 0.0, 0.0]),
            link([fore, 0.0, 0.0], [0.0; 3]),
            link([wrist_x, 0.0, wrist_z], [0.0; 3]),
            link([0.0, second, 0.0], [quarter, 0.0, 0.0]),
            link([0.0, third, 0.0], [quarter, half, half]),
        ]))
    }
}

fn built_in(model: &str) -> Option<Arm> {
    ArmKind::ALL.into_iter().find(|kind| kind.name() == model).map(ArmKind::arm)
}

/// An arm, what its controller believes, and where things are on and about it.
struct Cell {
    truth: Chain,
    believed: Chain,
    arm: Arm,
    mode: Mode,
    /// `tip_from_camera`, or `base_from_camera`.
    camera: Isometry3<f64>,
    /// `base_from_target`, or `tip_from_target`.
    target: Isometry3<f64>,
    tool: Isometry3<f64>,
}

struct Taken {
    joints: Joints,
    corners: Vec<Corner>,
}

impl Cell {
    /// Joint values that put the tip at a pose as the controller believes.
    fn believed_joints(&self, goal: &Isometry3<f64>, near: &Joints) -> Option<Joints> {
        newton(
            |q| self.believed.forward(q),
            near,
            |tip| {
                let off = tip.inverse() * goal;
                let turn = off.rotation.scaled_axis();
                Vector6::new(off.translation.x, off.translation.y, off.translation.z, turn.x, turn.y, turn.z)
            },
        )
    }

    fn really(&self, joints: &Joints) -> Isometry3<f64> {
        self.truth.forward(joints)
    }

    fn camera_from_target(&self, tip: &Isometry3<f64>) -> Isometry3<f64> {
        match self.mode {
            Mode::EyeInHand => (tip * self.camera).inverse() * self.target,
            Mode::EyeToHand => self.camera.inverse() * tip * self.target,
        }
    }

    fn tip_for(&self, camera_from_target: &Isometry3<f64>) -> Isometry3<f64> {
        match self.mode {
            Mode::EyeInHand => self.target * camera_from_target.inverse() * self.camera.inverse(),
            Mode::EyeToHand => self.camera * camera_from_target * self.target.inverse(),
        }
    }

    fn take(&self, rng: &mut ChaCha8Rng) -> Option<Taken> {
        let wanted = self.tip_for(&CONE.draw(&TARGET, rng));
        let near = start(rng);
        let joints = self.believed_joints(&wanted, &near)?;
        let tip = self.really(&joints) * shift_and_turn(&noise_twist(rng, REPEATS.0, REPEATS.1));
        let pose = self.camera_from_target(&tip);
        let lens = camera();
        let points = TARGET.points();
        let corners = points.iter().enumerate().map(|(i, point)| {
            let px = lens::pixel(&lens, &(pose * point))?;
            let noise = Vector2::new(normal(rng), normal(rng)) * CORNER_PX;
            lens::is_in_image(&lens, &px).then(|| Corner::new(i, px + noise))
        });
        Some(Taken { joints, corners: corners.collect::<Option<_>>()? })
    }
}

/// Where an arm before its work stands, a little off: some start finds every pose.
fn start(rng: &mut ChaCha8Rng) -> Joints {
    let usual = [0.0, -1.6, 1.9, -1.8, -1.57, 0.0];
    let mut joints = usual.map(|angle: f64| angle + 0.3 * normal(rng));
    joints[5] = rng.random_range(-std::f64::consts::PI..std::f64::consts::PI);
    joints
}

/// Newton's method on six joints; `None` where it does not arrive.
fn newton(
    forward: impl Fn(&Joints) -> Isometry3<f64>,
    near: &Joints,
    off: impl Fn(&Isometry3<f64>) -> Vector6<f64>,
) -> Option<Joints> {
    let mut joints = *near;
    for _ in 0..60 {
        let here = off(&forward(&joints));
        if here.norm() < 1e-11 {
            // Within the ranges of the arm.
            return Some(joints.map(|angle| angle.sin().atan2(angle.cos())));
        }
        let by_joints = Matrix6::from_columns(&std::array::from_fn::<_, 6, _>(|j| {
            let mut moved = joints;
            moved[j] += 1e-7;
            (here - off(&forward(&moved))) / 1e-7
        }));
        let step = (by_joints.transpose() * by_joints + Matrix6::identity() * 1e-8).try_inverse()?
            * by_joints.transpose()
            * here;
        let shorter = 0.4 / step.amax().max(0.4);
        joints.iter_mut().zip(step.iter()).for_each(|(q, s)| *q += s * shorter);
    }
    None
}

/// The tip of the tool in the frame of the tip, by an arm that turned about one point: `believed` says where it takes its tip to be.
fn tool_by(cell: &Cell, believed: impl Fn(&Joints) -> Isometry3<f64>, rng: &mut ChaCha8Rng) -> Option<Vector3<f64>> {
    let middle = cell.tip_for(&CONE.draw(&TARGET, rng));
    let point = middle * cell.tool;
    let (mut normal_matrix, mut right) = (Matrix6::zeros(), Vector6::zeros());
    let mut count = 0;
    for _ in 0..TRIES {
        if count == 12 {
            break;
        }
        let turn = UnitQuaternion::from_scaled_axis(Vector3::from_fn(|_, _| rng.random_range(-0.5..0.5)));
        let goal = Isometry3::from_parts(point.translation, middle.rotation * turn) * cell.tool.inverse();
        let Some(joints) = cell.believed_joints(&goal, &start(rng)) else { continue };
        // The person sees the point and corrects: the tip of the tool is there, whatever the controller believes.
        let wanted = point.translation.vector;
        let jogged = newton(
            |q| cell.really(q),
            &joints,
            |tip| {
                let off = (tip * cell.tool).translation.vector - wanted;
                let turn = (tip.rotation.inverse() * goal.rotation).scaled_axis();
                let off = tip.rotation.inverse() * -off;
                Vector6::new(off.x, off.y, off.z, turn.x, turn.y, turn.z)
            },
        );
        let Some(joints) = jogged else { continue };
        let tip = believed(&joints);
        let mut row = Matrix3x6::zeros();
        row.fixed_columns_mut::<3>(0).copy_from(tip.rotation.to_rotation_matrix().matrix());
        row.fixed_columns_mut::<3>(3).copy_from(&-nalgebra::Matrix3::identity());
        normal_matrix += row.transpose() * row;
        right += row.transpose() * -tip.translation.vector;
        count += 1;
    }
    Some((normal_matrix.try_inverse()? * right).fixed_rows::<3>(0).into_owned())
}

/// Distances of touches by an arm as it is, and by one whose command is corrected, RMS, millimetres; and which part of them is within
/// the 95 % that are stated of either.
struct Touched {
    as_it_is_mm: f64,
    corrected_mm: f64,
    within: [f64; 2],
    stated_mm: [f64; 2],
    /// Error of a point where the board was seen by the transform alone, and what is stated of it.
    space_mm: f64,
    space_stated_mm: f64,
}

/// Where the transform of a perfect calibration is: that of the cell, but for what belongs to the gauge. With `A` the arm as it is and
/// `F` as it is believed, `A(q) = Z F_e(q) T` with errors `e` of the joints between; `T` goes with the tip, and `Z` with the base.
fn true_mount_from_camera(cell: &Cell, arm: &Arm, rng: &mut ChaCha8Rng) -> Option<Isometry3<f64>> {
    const CONFIGURATIONS: usize = 40;
    let rigid = |x: &[f64]| shift_and_turn(&Vector6::from_column_slice(x));
    let configurations: Vec<Joints> =
        (0..CONFIGURATIONS).map(|_| std::array::from_fn(|_| rng.random_range(-3.0..3.0))).collect();
    let count = ArmErrors::none(6).values().len();
    let off = |x: &[f64]| -> Option<DVector<f64>> {
        let errors = ArmErrors::new(6, x[12..].to_vec())?;
        let mut off = Vec::with_capacity(6 * CONFIGURATIONS);
        for joints in &configurations {
            let pose = arm.forward(joints).ok()?;
            let tip =
                pose.isometry() * errors.true_tip(&pose, &arm.tip_from_joints(&pose, joints).ok()?).reported_from_true;
            let miss = cell.really(joints).inverse() * rigid(&x[..6]) * tip * rigid(&x[6..12]);
            off.extend(miss.translation.vector.iter().chain(miss.rotation.scaled_axis().iter()));
        }
        Some(DVector::from_vec(off))
    };
    let mut x = vec![0.0; 12 + count];
    for _ in 0..8 {
        let here = off(&x)?;
        let columns = (0..x.len()).map(|k| {
            let mut moved = x.clone();
            moved[k] += 1e-6;
            Some((off(&moved)? - &here) / 1e-6)
        });
        let by = DMatrix::from_columns(&columns.collect::<Option<Vec<_>>>()?);
        // What is compliance here is none: its columns are almost those of other errors.
        let normal = by.transpose() * &by + DMatrix::identity(x.len(), x.len()) * 1e-9;
        let step = normal.lu().solve(&(by.transpose() * here))?;
        x.iter_mut().zip(step.iter()).for_each(|(x, step)| *x -= step);
    }
    if off(&x)?.amax() > 1e-5 {
        return None;
    }
    let (base, tip) = (rigid(&x[..6]), rigid(&x[6..12]));
    Some(match cell.mode {
        Mode::EyeInHand => tip * cell.camera,
        Mode::EyeToHand => base.inverse() * cell.camera,
    })
}

fn session(cell: &Cell, views: usize, free_lens: bool, seed: u64) -> Result<Touched, Failure> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut taken = Vec::new();
    for _ in 0..TRIES {
        if taken.len() < views {
            taken.extend(cell.take(&mut rng));
        }
    }
    if taken.len() < views {
        return Err("the arm does not reach enough views".into());
    }
    let reported = |joints: &Joints| Pose::<Base, Tip>::from_isometry(cell.believed.forward(joints));
    let of_joints: Vec<_> = taken
        .iter()
        .map(|taken| JointView { base_from_tip: reported(&taken.joints), joints_rad: &taken.joints })
        .collect();
    let (placement, frames) = place_checked(&cell.arm, &of_joints)?;
    let observed = taken.iter().zip(frames).enumerate().map(|(i, (taken, tip_from_joints))| ObservedView {
        tip_from_joints,
        ..ObservedView::new(format!("{i}"), Some(reported(&taken.joints)), Some(taken.corners.clone().into()))
    });
    let observations = Observations {
        mode: Some(cell.mode),
        target: TARGET,
        image_size: (camera().width, camera().height),
        camera: if free_lens { CameraKnowledge::NOTHING } else { CameraKnowledge::Fixed(camera()) },
        views: observed.collect(),
    };
    let of_views = ArmOfViews {
        placement: placement.clone(),
        tool_m: cell.tool.translation.vector.into(),
        joints_rad: taken.iter().map(|taken| Some(taken.joints.to_vec())).collect(),
    };
    let wanted = FindingOptions::default().with_arm(Some(&of_views));
    let calibration =
        calibrate_with(&observations, Method::Joint, Options::default(), &wanted, &CancelToken::default())?;
    let arm = calibration.joint.as_ref().and_then(|joint| joint.arm.as_ref()).ok_or("no arm was estimated")?;
    // Random numbers of its own: what is touched does not depend on it.
    let true_camera =
        true_mount_from_camera(cell, &placement.arm, &mut ChaCha8Rng::seed_from_u64(1)).ok_or("no gauge")?;
    let corrected = CorrectedArm::new(placement.arm, arm).ok_or("another arm")?;
    if std::env::var_os("VERBOSE").is_some() {
        report(&calibration, arm);
    }
    let actual =
        |joints: &Joints| corrected.actual(joints).map_or_else(|_| Isometry3::identity(), |pose| *pose.isometry());
    let believed = |joints: &Joints| cell.believed.forward(joints);
    let hand_eye = calibration.hand_eye.ok_or("no answer")?;
    let board = calibration.joint.as_ref().ok_or("no joint estimate")?.reference_point;
    let space_m = (hand_eye.mount_from_camera().isometry() * board - true_camera * board).norm();
    let plain_tool = tool_by(cell, believed, &mut rng).ok_or("no tool")?;
    let corrected_tool = tool_by(cell, actual, &mut rng).ok_or("no tool")?;
    let stated = calibration
        .reach_errors()
        .and_then(|reach| Some([reach.as_it_is_95_m, reach.corrected_95_m?]))
        .unwrap_or([f64::NAN; 2]);
    let mut within = [0.0; 2];
    let (mut as_it_is, mut by_command, mut count) = (0.0, 0.0, 0.0);
    for _ in 0..TRIES {
        if count == TOUCHES as f64 {
            break;
        }
        let view = &taken[rng.random_range(0..taken.len())];
        let corner: Point3<f64> = TARGET.points()[rng.random_range(0..TARGET.points().len())];
        let in_camera: Point3<f64> = cell.camera_from_target(&cell.really(&view.joints)) * corner;
        let camera_at = |tip: &Isometry3<f64>, found: &Isometry3<f64>| match cell.mode {
            Mode::EyeInHand => tip * found,
            Mode::EyeToHand => *found,
        };
        let truth = camera_at(&cell.really(&view.joints), &cell.camera) * in_camera;
        let down = down(cell, &view.joints, &mut rng);
        let mount = |of: &HandEye| *of.mount_from_camera().isometry();
        // By the controller as it is.
        let seen = camera_at(&believed(&view.joints), &mount(&hand_eye)) * in_camera;
        let goal = Isometry3::from_parts(seen.coords.into(), down) * Translation3::from(-plain_tool);
        let Some(joints) = cell.believed_joints(&goal, &view.joints) else { continue };
        let plain = off(cell, &joints, &truth);
        // By corrected poses and commands.
        let seen = camera_at(&actual(&view.joints), &mount(&arm.hand_eye)) * in_camera;
        let goal = Isometry3::from_parts(seen.coords.into(), down) * Translation3::from(-corrected_tool);
        let Ok(command) = corrected.command(&Pose::from_isometry(goal), &joints) else { continue };
        let joints: Joints = command.joints_rad.try_into().map_err(|_wrong_count| "six joints")?;
        as_it_is += plain * plain;
        let by_way = [plain, off(cell, &joints, &truth)];
        by_command += by_way[1].powi(2);
        for (within, (distance, stated)) in within.iter_mut().zip(by_way.iter().zip(stated)) {
            *within += f64::from(*distance <= stated);
        }
        count += 1.0;
    }
    let rms_mm = |sum: f64| f64::sqrt(sum / count) * 1e3;
    Ok(Touched {
        as_it_is_mm: rms_mm(as_it_is),
        corrected_mm: rms_mm(by_command),
        within: within.map(|within| within / count),
        stated_mm: stated.map(|m| m * 1e3),
        space_mm: space_m * 1e3,
        space_stated_mm: calibration.tip_error_95_m().map_or(f64::NAN, |m| m * 1e3),
    })
}

fn report(calibration: &Calibration, arm: &handeye_estimate::ArmFit) {
    let noise = arm.noise;
    println!(
        "robot {:.4} mm {:.4}° → {:.4} mm {:.4}°; levels {:.4}° {:.4} mm {:.4}°; held out {:?}; contradicted {}",
        calibration.joint.as_ref().map_or(0.0, |joint| joint.noise.robot_m * 1e3),
        calibration.joint.as_ref().map_or(0.0, |joint| joint.noise.robot_rad.to_degrees()),
        noise.robot_m * 1e3,
        noise.robot_rad.to_degrees(),
        noise.link_rad.to_degrees(),
        noise.link_m * 1e3,
        noise.compliance_rad.to_degrees(),
        arm.heldout_px,
        arm.contradicted
    );
}

/// How the tool is turned when it touches: against the board's normal, which is up, or as the tip was when the board was seen; tilted by
/// up to 15°, with any turn about itself.
fn down(cell: &Cell, joints: &Joints, rng: &mut ChaCha8Rng) -> UnitQuaternion<f64> {
    let along = match cell.mode {
        Mode::EyeInHand => UnitQuaternion::from_scaled_axis(Vector3::x() * std::f64::consts::PI),
        Mode::EyeToHand => cell.believed.forward(joints).rotation,
    };
    let tilt = Vector3::new(rng.random_range(-0.18..0.18), rng.random_range(-0.18..0.18), 0.0);
    let turn = Vector3::z() * rng.random_range(-3.1..3.1);
    along * UnitQuaternion::from_scaled_axis(tilt) * UnitQuaternion::from_scaled_axis(turn)
}

fn off(cell: &Cell, joints: &Joints, point: &Point3<f64>) -> f64 {
    ((cell.really(joints) * cell.tool).translation.vector - point.coords).norm()
}

fn cells(csv: &str) -> Result<BTreeMap<usize, (String, Chain)>, Failure> {
    let mut arms: BTreeMap<usize, (String, Vec<Link>)> = BTreeMap::new();
    for line in csv.lines().skip(1) {
        let fields: Vec<&str> = line.split(',').collect();
        let number =
            |i: usize| fields.get(i).ok_or("a column is missing")?.parse::<f64>().map_err(|_not_a_number| "no number");
        let link = Link {
            place: Vector3::new(number(3)?, number(4)?, number(5)?),
            turn: Vector3::new(number(6)?, number(7)?, number(8)?),
        };
        arms.entry(fields[0].parse()?).or_insert_with(|| (fields[1].to_owned(), Vec::new())).1.push(link);
    }
    arms.into_iter()
        .map(|(arm, (model, links))| {
            let links: [Link; 6] = links.try_into().map_err(|_wrong_count| "an arm has six links")?;
            Ok((arm, (model, Chain(links))))
        })
        .collect()
}

fn cell(model: &str, truth: Chain, mode: Mode) -> Option<Cell> {
    let (believed, arm) = (Chain::nominal(model)?, built_in(model)?);
    let reach = -(believed.0[2].place.x + believed.0[3].place.x);
    let turned_over = UnitQuaternion::from_scaled_axis(Vector3::x() * std::f64::consts::PI);
    let (camera, target) = match mode {
        Mode::EyeInHand => (
            Isometry3::from_parts(
                Translation3::new(0.03, -0.06, 0.05),
                UnitQuaternion::from_scaled_axis(Vector3::new(0.05, -0.08, 0.4)),
            ),
            // At the usual start the arm stretches along −x. A target's z axis points away from who looks at it.
            Isometry3::from_parts(Translation3::new(-0.6 * reach, -0.15 * reach, 0.05), turned_over)
                * Translation3::from(-TARGET.centre().coords),
        ),
        Mode::EyeToHand => (
            Isometry3::from_parts(Translation3::new(-0.65 * reach, -0.1 * reach, -0.1), UnitQuaternion::identity()),
            Isometry3::from_parts(Translation3::new(0.01, 0.02, 0.06), turned_over)
                * Translation3::from(-TARGET.centre().coords),
        ),
    };
    Some(Cell { truth, believed, arm, mode, camera, target, tool: Isometry3::translation(0.0, 0.0, TOOL_M) })
}

fn main() -> ExitCode {
    match run() {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::FAILURE
        }
    }
}

fn run() -> Result<(), Failure> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let csv = std::fs::read_to_string(arguments.first().ok_or("which CSV of arms?")?)?;
    let views: usize = arguments.get(1).map_or(Ok(20), |text| text.parse())?;
    let given = |word: &str| arguments.iter().skip(2).any(|argument| argument == word);
    let (free_lens, exact) = (given("lens"), given("exact"));
    for (name, mode) in [("camera on the arm", Mode::EyeInHand), ("camera beside the arm", Mode::EyeToHand)] {
        let arms = cells(&csv)?;
        let sessions: Vec<_> = arms
            .into_par_iter()
            .filter_map(|(arm, (model, truth))| {
                let truth = if exact { Chain::nominal(&model)? } else { truth };
                let cell = cell(&model, truth, mode)?;
                Some((arm, model, session(&cell, views, free_lens, 100 + arm as u64)))
            })
            .collect();
        println!(
            "\n{name}, {views} views\n\n| arm | as it is mm | corrected mm | stated 95 % | within | in space mm | stated 95 % |\n| --- | --- | --- | --- | --- | --- | --- |"
        );
        let (mut plain, mut corrected, mut worse) = (Vec::new(), Vec::new(), 0);
        let (mut all_within, mut in_space) = ([0.0; 2], Vec::new());
        for (arm, model, touched) in sessions {
            match touched {
                Ok(Touched { as_it_is_mm, corrected_mm, within, stated_mm, space_mm, space_stated_mm }) => {
                    println!(
                        "| {arm} {model} | {as_it_is_mm:.3} | {corrected_mm:.3} | {:.2}, {:.2} | {:.0} %, {:.0} % | {space_mm:.3} | {space_stated_mm:.3} |",
                        stated_mm[0],
                        stated_mm[1],
                        within[0] * 100.0,
                        within[1] * 100.0
                    );
                    all_within = std::array::from_fn(|k| all_within[k] + within[k]);
                    plain.push(as_it_is_mm);
                    corrected.push(corrected_mm);
                    worse += usize::from(corrected_mm > as_it_is_mm);
                    in_space.push((space_mm, space_stated_mm));
                }
                Err(error) => println!("| {arm} {model} | {error} | |"),
            }
        }
        let rms = |values: &[f64]| (values.iter().map(|v| v * v).sum::<f64>() / values.len().max(1) as f64).sqrt();
        println!(
            "\nmedian {:.3} → {:.3}, RMS {:.3} → {:.3}, worse {worse} of {}, within what is stated {:.1} %, {:.1} %",
            median(plain.iter().copied()).unwrap_or(f64::NAN),
            median(corrected.iter().copied()).unwrap_or(f64::NAN),
            rms(&plain),
            rms(&corrected),
            plain.len(),
            all_within[0] / plain.len() as f64 * 100.0,
            all_within[1] / plain.len() as f64 * 100.0
        );
        println!(
            "in space {:.3}, stated {:.3}, {} of {} within",
            median(in_space.iter().map(|(error, _)| *error)).unwrap_or(f64::NAN),
            median(in_space.iter().map(|(_, stated)| *stated)).unwrap_or(f64::NAN),
            in_space.iter().filter(|(error, stated)| error <= stated).count(),
            in_space.len()
        );
    }
    Ok(())
}
