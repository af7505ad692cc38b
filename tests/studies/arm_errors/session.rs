//! One session: views are taken and calibrated with, and points are touched.

use handeye_arm::Arm;
use handeye_estimate::corrected_arm::CorrectedArm;
use handeye_estimate::diagnose::findings::FindingOptions;
use handeye_estimate::diagnose::{Calibration, calibrate_with};
use handeye_estimate::handeye::HandEye;
use handeye_estimate::handeye::joint::{ArmErrors, LEVELS_OF_ARMS, LinkError, arm_parameters};
use handeye_estimate::placement::{ArmOfViews, JointView, Placement, place_checked};
use handeye_estimate::robot_accuracy::RobotAccuracy;
use handeye_estimate::{ArmFit, CameraKnowledge, KnownLens, Method, Observations, ObservedView, Options};
use handeye_geometry::frames::{Base, Pose, Tip};
use handeye_geometry::progress::CancelToken;
use handeye_simulate::links::shift_and_turn;
use nalgebra::{DMatrix, DVector, Isometry3, Point3, Translation3, UnitQuaternion, Vector3, Vector6};
use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;

use crate::Failure;
use crate::cell::{Cell, TARGET, TRIES, Taken};
use crate::chain::between;

const TOUCHES: usize = 40;

/// Distances of touches with uncorrected commands, with corrected ones, and with the best transform that Park and Martin's method
/// finds from the same views, RMS, millimetres; and which part of the first two is within their stated 95 %.
pub struct Touched {
    pub as_it_is_mm: f64,
    pub corrected_mm: f64,
    pub park_mm: f64,
    pub within: [f64; 2],
    pub stated_mm: [f64; 2],
    /// Error of a point where the board was seen from the transform alone, and the stated error; NaN if the errors of the arm are
    /// not those of a chain, and no single transform is the true one.
    pub space_mm: f64,
    pub space_stated_mm: f64,
}

/// How the views of a session are chosen, and what is known about it.
#[derive(Clone, Copy)]
pub struct Asked {
    pub views: usize,
    pub free_lens: bool,
    /// The stated accuracy of the given lens.
    pub accuracy_px: Option<f64>,
    /// Chosen by guided capture, not at random.
    pub guided: bool,
    /// Whether the chain is the only error of the arm.
    pub of_links: bool,
}

pub fn session(cell: &Cell, asked: Asked, seed: u64) -> Result<Touched, Failure> {
    let Asked { views, free_lens, guided, of_links, .. } = asked;
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let placed = Placed::of(cell)?;
    let taken = if guided {
        crate::guided::guided(cell, &placed, views, free_lens, &mut rng)
    } else {
        cell.take(views, &mut rng)
    };
    if taken.len() < if guided { 10 } else { views } {
        return Err(format!("the arm does not reach enough views: {}", taken.len()).into());
    }
    let (mut observations, of_views) = observed(cell, &placed, &taken, free_lens);
    if let (CameraKnowledge::Fixed(intrinsics), Some(accuracy_px)) = (observations.camera, asked.accuracy_px) {
        observations.camera = CameraKnowledge::Near(KnownLens { intrinsics, accuracy_px });
    }
    let calibrate = |method| {
        let wanted = FindingOptions::default().with_arm(Some(&of_views));
        calibrate_with(&observations, method, Options::default(), &wanted, &CancelToken::default())
    };
    let calibration = calibrate(Method::Joint)?;
    let arm = calibration.joint.as_ref().and_then(|joint| joint.arm.as_ref()).ok_or("no arm was estimated")?;
    if std::env::var_os("VERBOSE").is_some() {
        report(&calibration, arm);
    }
    let hand_eye = calibration.hand_eye.ok_or("no answer")?;
    // Random numbers of its own: the touched points do not depend on it.
    let true_camera = if of_links {
        true_mount_from_camera(cell, &of_views.placement.arm, &mut ChaCha8Rng::seed_from_u64(1))
    } else {
        None
    };
    let board = calibration.joint.as_ref().ok_or("no joint estimate")?.reference_point;
    let space_m =
        true_camera.map_or(f64::NAN, |truth| (hand_eye.mount_from_camera().isometry() * board - truth * board).norm());
    let corrected = CorrectedArm::new(of_views.placement.arm.clone(), arm).ok_or("another arm")?;
    let actual =
        |joints: &[f64]| corrected.actual(joints).map_or_else(|_| Isometry3::identity(), |pose| *pose.isometry());
    let believed = |joints: &[f64]| cell.believed.forward(joints);
    let park = calibrate(Method::ClosedForm("park_martin"))?.hand_eye.ok_or("no closed form")?;
    let [plain_tool, park_tool, corrected_tool] = if cell.has_few_joints() {
        let mounted = [&hand_eye, &park, &arm.hand_eye].map(|of| *of.mount_from_camera().isometry());
        [
            cell.tool_by_touching(believed, &mounted[0], &taken, &mut rng).ok_or("no tool")?,
            cell.tool_by_touching(believed, &mounted[1], &taken, &mut rng).ok_or("no tool")?,
            cell.tool_by_touching(actual, &mounted[2], &taken, &mut rng).ok_or("no tool")?,
        ]
    } else {
        let plain_tool = cell.tool_by(believed, &taken, &mut rng).ok_or("no tool")?;
        [plain_tool, plain_tool, cell.tool_by(actual, &taken, &mut rng).ok_or("no tool")?]
    };
    let stated = calibration
        .reach_errors()
        .and_then(|reach| Some([reach.as_it_is_95_m, reach.corrected_95_m?]))
        .unwrap_or([f64::NAN; 2]);
    let mut within = [0.0; 2];
    let (mut squared, mut count) = ([0.0; 3], 0.0);
    for _ in 0..TRIES {
        if count == TOUCHES as f64 {
            break;
        }
        let view = &taken[rng.random_range(0..taken.len())];
        let (in_camera, truth) = cell.point(view, &mut rng);
        let down = cell.down(&taken, &mut rng);
        let as_it_is = Touch { view, in_camera, down, tool: plain_tool };
        let by_park = Touch { tool: park_tool, ..as_it_is };
        let by_controller = [as_it_is.by_controller(cell, &hand_eye), by_park.by_controller(cell, &park)];
        let [Some(plain), Some(by_park)] = by_controller else { continue };
        // With corrected poses and commands.
        let seen = cell.camera_at(&actual(&view.joints), arm.hand_eye.mount_from_camera().isometry()) * in_camera;
        let down = if cell.has_few_joints() { actual(&plain).rotation } else { down };
        let goal = Isometry3::from_parts(seen.coords.into(), down) * Translation3::from(-corrected_tool);
        let corrected = corrected.clone().with_tool(corrected_tool);
        let Ok(command) = corrected.command(&Pose::from_isometry(goal), &plain) else { continue };
        let off = [plain, command.joints_rad, by_park].map(|joints| cell.off(&joints, &truth, &mut rng));
        squared = std::array::from_fn(|k| squared[k] + off[k] * off[k]);
        within = std::array::from_fn(|k| within[k] + f64::from(off[k] <= stated[k]));
        count += 1.0;
    }
    if count < 1.0 {
        return Err("the arm reaches none of the points".into());
    }
    let [as_it_is_mm, corrected_mm, park_mm] = squared.map(|sum| f64::sqrt(sum / count) * 1e3);
    Ok(Touched {
        as_it_is_mm,
        corrected_mm,
        park_mm,
        within: within.map(|within| within / count),
        stated_mm: stated.map(|m| m * 1e3),
        space_mm: space_m * 1e3,
        space_stated_mm: calibration.tip_error_95_m().map_or(f64::NAN, |m| m * 1e3),
    })
}

/// The error of a transform if the chain is not known: relative to the one from so many views that it is right for the poses which
/// this arm reports, and to the true one, millimetres at the board; and the stated error.
pub struct Unknown {
    pub from_reported: f64,
    pub from_truth: f64,
    pub stated: f64,
}

const VERY_MANY: usize = 300;

/// A session whose joints are not known, but the accuracy of the robot is.
pub struct ByAccuracy {
    /// Root mean square distance and angle between where the tip is and where it is reported, millimetres and degrees.
    pub accuracy: [f64; 2],
    /// Root mean square distance of touches, millimetres.
    pub touch_mm: f64,
    /// The error stated for them, and the share within it.
    pub stated_mm: f64,
    pub within: f64,
}

pub fn by_accuracy(cell: &Cell, asked: Asked, seed: u64) -> Result<ByAccuracy, Failure> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let placed = Placed::of(cell)?;
    let taken = cell.take(asked.views, &mut rng);
    let accuracy = accuracy(cell, &cell.take(VERY_MANY, &mut rng)).ok_or("not aligned")?;
    let (mut observations, _) = observed(cell, &placed, &taken, asked.free_lens);
    observations.views.iter_mut().for_each(|view| view.tip_from_joints.clear());
    let robot = RobotAccuracy::new(accuracy[0] * 1e3, Some(cell.tool.translation.vector.into()));
    let wanted = FindingOptions::default().with_robot_accuracy(Some(robot));
    let work = CancelToken::default();
    let calibration = calibrate_with(&observations, Method::Joint, Options::default(), &wanted, &work)?;
    let hand_eye = calibration.hand_eye.ok_or("no answer")?;
    let stated_m = calibration.reach_errors().ok_or("nothing stated")?.as_it_is_95_m;
    let believed = |joints: &[f64]| cell.believed.forward(joints);
    let tool = cell.tool_by(believed, &taken, &mut rng).ok_or("no tool")?;
    let mut off = Vec::new();
    for _ in 0..TRIES {
        if off.len() == TOUCHES {
            break;
        }
        let view = &taken[rng.random_range(0..taken.len())];
        let (in_camera, truth) = cell.point(view, &mut rng);
        let down = cell.down(&taken, &mut rng);
        let touch = Touch { view, in_camera, down, tool };
        let Some(joints) = touch.by_controller(cell, &hand_eye) else { continue };
        off.push(cell.off(&joints, &truth, &mut rng));
    }
    if off.is_empty() {
        return Err("the arm reaches none of the points".into());
    }
    let count = off.len() as f64;
    Ok(ByAccuracy {
        accuracy: [accuracy[0] * 1e3, accuracy[1].to_degrees()],
        touch_mm: (off.iter().map(|off| off * off).sum::<f64>() / count).sqrt() * 1e3,
        stated_mm: stated_m * 1e3,
        within: off.iter().filter(|off| **off <= stated_m).count() as f64 / count,
    })
}

/// Root mean square distance and angle between where the tip is and where it is reported, with base and tip where that is least: a
/// hand-eye calibration takes up the rest. A rotation counts as at 0.3 m.
fn accuracy(cell: &Cell, taken: &[Taken]) -> Option<[f64; 2]> {
    const LEVER_M: f64 = 0.3;
    let rigid = |x: &DVector<f64>, at: usize| shift_and_turn(&x.fixed_rows::<6>(at).into_owned());
    let misses = |x: &DVector<f64>| -> Vec<Vector6<f64>> {
        let miss = |view: &Taken| {
            between(&cell.real.tip(&view.joints), &(rigid(x, 0) * cell.believed.forward(&view.joints) * rigid(x, 6)))
        };
        taken.iter().map(miss).collect()
    };
    let scaled = |x: &DVector<f64>| {
        DVector::from_iterator(
            6 * taken.len(),
            misses(x).iter().flat_map(|miss| {
                let numbers: [f64; 6] = std::array::from_fn(|i| miss[i] * if i < 3 { 1.0 } else { LEVER_M });
                numbers
            }),
        )
    };
    let mut x = DVector::zeros(12);
    for _ in 0..8 {
        let here = scaled(&x);
        let columns: Vec<DVector<f64>> = (0..12)
            .map(|k| {
                let mut moved = x.clone();
                moved[k] += 1e-6;
                (scaled(&moved) - &here) / 1e-6
            })
            .collect();
        let by = DMatrix::from_columns(&columns);
        x -= (by.transpose() * &by).lu().solve(&(by.transpose() * here))?;
    }
    let mean_square = |at: usize| {
        misses(&x).iter().map(|miss| miss.fixed_rows::<3>(at).norm_squared()).sum::<f64>() / taken.len() as f64
    };
    Some([mean_square(0).sqrt(), mean_square(3).sqrt()])
}

/// A point that was seen, and how it should be touched.
#[derive(Clone, Copy)]
struct Touch<'a> {
    view: &'a Taken,
    in_camera: Point3<f64>,
    down: UnitQuaternion<f64>,
    /// The tip of the tool as found.
    tool: Vector3<f64>,
}

impl Touch<'_> {
    /// Joint values from the poses that the controller reports.
    fn by_controller(&self, cell: &Cell, hand_eye: &HandEye) -> Option<Vec<f64>> {
        let mounted = hand_eye.mount_from_camera();
        let tip = cell.believed.forward(&self.view.joints);
        let seen = cell.camera_at(&tip, mounted.isometry()) * self.in_camera;
        let goal = Isometry3::from_parts(seen.coords.into(), self.down) * Translation3::from(-self.tool);
        cell.believed_touch(&goal, &self.tool, &self.view.joints)
    }
}

pub fn unknown(cell: &Cell, asked: Asked, seed: u64) -> Result<Unknown, Failure> {
    let Asked { views, free_lens, of_links, .. } = asked;
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let placed = Placed::of(cell)?;
    let calibrate = |taken: &[Taken], free_lens| -> Result<Calibration, Failure> {
        let (mut observations, _) = observed(cell, &placed, taken, free_lens);
        observations.views.iter_mut().for_each(|view| view.tip_from_joints.clear());
        let wanted = FindingOptions::default();
        Ok(calibrate_with(&observations, Method::Joint, Options::default(), &wanted, &CancelToken::default())?)
    };
    let taken = cell.take(views, &mut rng);
    let calibration = calibrate(&taken, free_lens)?;
    let board = calibration.joint.as_ref().ok_or("no joint estimate")?.reference_point;
    let found = calibration.hand_eye.ok_or("no answer")?;
    let many = calibrate(&cell.take(VERY_MANY, &mut rng), false)?.hand_eye.ok_or("no answer")?;
    let at = |of: &HandEye| of.mount_from_camera().isometry() * board;
    let truth =
        if of_links { true_mount_from_camera(cell, &placed.arm, &mut ChaCha8Rng::seed_from_u64(1)) } else { None };
    Ok(Unknown {
        from_reported: (at(&found) - at(&many)).norm() * 1e3,
        from_truth: truth.map_or(f64::NAN, |truth| (at(&found) - truth * board).norm() * 1e3),
        stated: calibration.tip_error_95_m().map_or(f64::NAN, |m| m * 1e3),
    })
}

/// The arm that the program knows, with its base.
pub struct Placed {
    pub arm: Arm,
}

impl Placed {
    pub fn of(cell: &Cell) -> Result<Self, Failure> {
        let mut rng = ChaCha8Rng::seed_from_u64(2);
        let joints: Vec<Vec<f64>> =
            (0..10).map(|_| cell.arm.joints().iter().map(|_| rng.random_range(-1.5..1.5)).collect()).collect();
        let views: Vec<JointView<'_>> = joints
            .iter()
            .map(|joints| JointView { base_from_tip: reported(cell, joints), joints_rad: joints })
            .collect();
        Ok(Self { arm: place_checked(&cell.arm, &views)?.0.arm })
    }
}

fn reported(cell: &Cell, joints: &[f64]) -> Pose<Base, Tip> {
    Pose::from_isometry(cell.believed.forward(joints))
}

/// The input of the estimator: corners, reported poses, joint values, and the arm that the program knows.
pub fn observed(cell: &Cell, placed: &Placed, taken: &[Taken], free_lens: bool) -> (Observations, ArmOfViews) {
    let view = |(i, taken): (usize, &Taken)| {
        let pose = reported(cell, &taken.reported);
        let tip_from_joints = placed.arm.tip_from_joints(&pose, &taken.reported).unwrap_or_default();
        ObservedView {
            tip_from_joints,
            ..ObservedView::new(format!("{i}"), Some(pose), Some(taken.corners.clone().into()))
        }
    };
    let observations = Observations {
        mode: Some(cell.mode),
        target: TARGET,
        image_size: (cell.lens.width, cell.lens.height),
        camera: if free_lens { CameraKnowledge::NOTHING } else { CameraKnowledge::Fixed(cell.lens) },
        views: taken.iter().enumerate().map(view).collect(),
    };
    let of_views = ArmOfViews {
        placement: Placement { arm: placed.arm.clone(), misses: vec![(0.0, 0.0); taken.len()] },
        tool_m: cell.tool.translation.vector.into(),
        joints_rad: taken.iter().map(|taken| Some(taken.reported.clone())).collect(),
    };
    (observations, of_views)
}

/// Where the transform of a perfect calibration is: that of the cell, except for what belongs to the gauge. With `A` the true arm
/// and `F` the believed one, `A(q) = Z F_e(q) T` with errors `e` of the joints between; `T` goes with the tip, and `Z` with the
/// base.
fn true_mount_from_camera(cell: &Cell, arm: &Arm, rng: &mut ChaCha8Rng) -> Option<Isometry3<f64>> {
    const CONFIGURATIONS: usize = 40;
    let rigid = |x: &[f64]| shift_and_turn(&Vector6::from_column_slice(x));
    let joint_count = arm.joints().len();
    let configurations: Vec<Vec<f64>> =
        (0..CONFIGURATIONS).map(|_| (0..joint_count).map(|_| rng.random_range(-3.0..3.0)).collect()).collect();
    let count = ArmErrors::none(joint_count).values().len();
    let off = |x: &[f64]| -> Option<DVector<f64>> {
        let errors = ArmErrors::new(joint_count, x[12..].to_vec())?;
        let mut off = Vec::with_capacity(6 * CONFIGURATIONS);
        for joints in &configurations {
            let pose = arm.forward(joints).ok()?;
            let tip =
                pose.isometry() * errors.true_tip(&pose, &arm.tip_from_joints(&pose, joints).ok()?).reported_from_true;
            let miss = cell.real.tip(joints).inverse() * rigid(&x[..6]) * tip * rigid(&x[6..12]);
            off.extend(miss.translation.vector.iter().chain(miss.rotation.scaled_axis().iter()));
        }
        Some(DVector::from_vec(off))
    };
    // A rotation of the base can be expressed as errors of all joints after the first: the likeliest for an arm is
    // used.
    let likely = |k: usize| match k.checked_sub(12).map(|k| arm_parameters(joint_count)[k].error) {
        None => 0.0,
        Some(LinkError::ShiftX | LinkError::ShiftY) => 1e-9 / LEVELS_OF_ARMS[1].powi(2) * LEVELS_OF_ARMS[0].powi(2),
        Some(_) => 1e-9,
    };
    let likely = DVector::from_fn(12 + count, |k, _| likely(k));
    let mut x = vec![0.0; 12 + count];
    for _ in 0..8 {
        let here = off(&x)?;
        let columns = (0..x.len()).map(|k| {
            let mut moved = x.clone();
            moved[k] += 1e-6;
            Some((off(&moved)? - &here) / 1e-6)
        });
        let by = DMatrix::from_columns(&columns.collect::<Option<Vec<_>>>()?);
        let normal = by.transpose() * &by + DMatrix::from_diagonal(&likely);
        let step = normal.lu().solve(&(by.transpose() * here + likely.component_mul(&DVector::from_vec(x.clone()))))?;
        x.iter_mut().zip(step.iter()).for_each(|(x, step)| *x -= step);
    }
    if off(&x)?.amax() > 1e-5 {
        return None;
    }
    let (base, tip) = (rigid(&x[..6]), rigid(&x[6..12]));
    Some(match cell.mode {
        handeye_estimate::handeye::Mode::EyeInHand => tip * cell.camera,
        handeye_estimate::handeye::Mode::EyeToHand => base.inverse() * cell.camera,
    })
}

fn report(calibration: &Calibration, arm: &ArmFit) {
    let noise = arm.noise;
    for finding in &calibration.diagnosis().findings {
        println!("  {:?} {:?}: {:?}", finding.severity, finding.code, finding.evidence);
    }
    println!(
        "corrected within {:?} m, moved {:?} mm, robot {:.4} mm {:.4}° → {:.4} mm {:.4}°; levels {:.4}° {:.4} mm {:.4}°; held out {:?}; contradicted {}, size {:?}",
        calibration.reach_errors().and_then(|reach| reach.corrected_95_m),
        moved_mm(calibration),
        calibration.joint.as_ref().map_or(0.0, |joint| joint.noise.robot_m * 1e3),
        calibration.joint.as_ref().map_or(0.0, |joint| joint.noise.robot_rad.to_degrees()),
        noise.robot_m * 1e3,
        noise.robot_rad.to_degrees(),
        noise.link_rad.to_degrees(),
        noise.link_m * 1e3,
        noise.compliance_rad.to_degrees(),
        arm.heldout_px,
        arm.contradicted,
        arm.shape().and_then(|shape| Some((shape.shape.scale, shape.scale_sigma?)))
    );
}

fn moved_mm(calibration: &Calibration) -> Option<f64> {
    let joint = calibration.joint.as_ref()?;
    Some(calibration.stated_uncertainty().moved_m(&joint.reference_point) * 1e3)
}
