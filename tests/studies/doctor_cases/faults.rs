//! The nine faults that have to be ranked first, and healthy sessions.

use handeye_estimate::diagnose::calibrate;
use handeye_estimate::diagnose::doctor::{Diagnosis, diagnose};
use handeye_estimate::diagnose::findings::{Finding, FindingCode, FindingOptions, Severity};
use handeye_estimate::handeye::Mode;
use handeye_estimate::{Method, Observations, ObservedView};
use handeye_geometry::observations::Noise;
use handeye_geometry::progress::CancelToken;
use handeye_simulate::Servo;
use handeye_simulate::links::normal;
use handeye_simulate::session::{ArmError, Cone, Fault, Setup, changed, observed};
use nalgebra::{Isometry3, SMatrix, Vector3, Vector6};
use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;

/// The diagnosis with the calibration, as made by the command line.
pub fn examined(observations: &Observations) -> Diagnosis {
    let cancel = CancelToken::default();
    match calibrate(observations, Method::Joint, &cancel) {
        Ok(calibration) => calibration.diagnosis().clone(),
        Err(_) => examined_alone(observations),
    }
}

/// The diagnosis of the data alone, which takes a third of the time.
pub fn examined_alone(observations: &Observations) -> Diagnosis {
    diagnose(observations, &FindingOptions::default(), &CancelToken::default())
}

fn direction(rng: &mut ChaCha8Rng) -> Vector3<f64> {
    loop {
        let v = Vector3::from_fn(|_, _| rng.random_range(-1.0..1.0));
        if v.norm() > 0.1 && v.norm() < 1.0 {
            return v.normalize();
        }
    }
}

fn twist(translation: Vector3<f64>, rotation: Vector3<f64>) -> Vector6<f64> {
    let mut twist = Vector6::zeros();
    twist.fixed_rows_mut::<3>(0).copy_from(&translation);
    twist.fixed_rows_mut::<3>(3).copy_from(&rotation);
    twist
}

/// Names of the faults.
pub const FAULTS: [&str; 9] = [
    "board slipped 5 mm at view 12",
    "square 2 % wrong",
    "joint 4 offset 0.2°",
    "one view captured in motion",
    "poses inverted",
    "millimetres",
    "rows out of step from a view on",
    "rows out of step",
    "images letter by letter, poses by number",
];

/// A session with a fault, one of variable size this many times as large as its name states, and the code that has to come
/// first. Both set-ups, with the lens given and estimated, alternate.
pub fn faulty(fault: usize, times: f64, seed: u64) -> (Observations, FindingCode) {
    let mut rng = ChaCha8Rng::seed_from_u64(seed ^ 0x5eed);
    let mode = if seed.is_multiple_of(2) { Mode::EyeInHand } else { Mode::EyeToHand };
    let estimated = seed % 4 > 1;
    // The combination of the arm's repeatability and a small error of its geometry.
    let setup = Setup { estimated, joints: true, ..Setup::new(mode, 20, seed) };
    match fault {
        0 => {
            // A board slips in its plane and rotates a little.
            let angle = rng.random_range(0.0..std::f64::consts::TAU);
            let slip = Vector3::new(angle.cos(), angle.sin(), 0.0) * 5e-3 * times;
            let turn = Vector3::z() * rng.random_range(-0.01..0.01) * times;
            let fault = Fault { board_moved: Some((12, twist(slip, turn))), ..Fault::default() };
            (observed(&setup.with(fault)), FindingCode::BoardMoved)
        }
        1 => {
            let scale = if rng.random::<bool>() { 0.02 } else { -0.02 } * times;
            (observed(&setup.with(Fault { scale, ..Fault::default() })), FindingCode::WrongScale)
        }
        2 => {
            let offset = 0.2f64.to_radians() * times * if rng.random::<bool>() { 1.0 } else { -1.0 };
            (observed(&setup.with(Fault { joint: Some((3, offset)), ..Fault::default() })), FindingCode::JointOffset)
        }
        3 => {
            // An image one frame late at 30 Hz, with an arm at 0.1 m/s and 10°/s.
            let motion = twist(direction(&mut rng) * 3.3e-3, direction(&mut rng) * 0.33f64.to_radians()) * times;
            let moving = vec![(rng.random_range(0..20), motion)];
            (observed(&setup.with(Fault { moving, ..Fault::default() })), FindingCode::OutlierView)
        }
        4 => (changed(observed(&setup), |p| p.inverse()), FindingCode::InvertedPoses),
        5 => {
            let in_millimetres = |mut p: Isometry3<f64>| {
                p.translation.vector *= 1e3;
                p
            };
            (changed(observed(&setup), in_millimetres), FindingCode::WrongLengthUnit)
        }
        6 | 7 => {
            // One or two images or poses that are missing or duplicated: at a view, or before the first.
            let by = [-2, -1, 1, 2][rng.random_range(0..4usize)];
            let from = if fault == 6 { rng.random_range(4..=14) } else { 0 };
            let rows = (0..20).map(|row: usize| if row < from { Some(row) } else { row.checked_add_signed(by) });
            (paired(observed(&setup), rows), FindingCode::ShiftedPoses)
        }
        _ => {
            let mut by_letters: Vec<usize> = (0..20).collect();
            by_letters.sort_by_key(|view| (view + 1).to_string());
            let mut session = observed(&setup);
            for (n, view) in session.views.iter_mut().enumerate() {
                view.name = format!("{}.png", n + 1);
            }
            // Row by row the images in alphabetical order, the poses in the order taken.
            let poses: Vec<_> = session.views.iter().map(|view| view.base_from_tip).collect();
            session.views = by_letters.iter().map(|view| session.views[*view].clone()).collect();
            for (view, pose) in session.views.iter_mut().zip(poses) {
                view.base_from_tip = pose;
            }
            (session, FindingCode::ShiftedPoses)
        }
    }
}

/// The views with the poses of other rows; views without a pose are left out.
fn paired(mut session: Observations, rows: impl Iterator<Item = Option<usize>>) -> Observations {
    let poses: Vec<_> = session.views.iter().map(|view| (view.base_from_tip, view.tip_from_joints.clone())).collect();
    let views = session.views.into_iter().zip(rows).filter_map(|(view, row)| {
        let (base_from_tip, tip_from_joints) = poses.get(row?)?.clone();
        Some(ObservedView { base_from_tip, tip_from_joints, ..view })
    });
    session.views = views.collect();
    session
}

fn cone(rng: &mut ChaCha8Rng) -> Cone {
    Cone { tilt_deg: rng.random_range(25.0..50.0), roll_deg: rng.random_range(20.0..120.0), ..Cone::PUBLISHED }
}

/// A healthy session: set-up, number of views, noise, geometry and what is known are drawn at random.
pub fn healthy(seed: u64) -> Observations {
    let mut rng = ChaCha8Rng::seed_from_u64(seed ^ 0x4ea1);
    let mode = if rng.random::<bool>() { Mode::EyeInHand } else { Mode::EyeToHand };
    let robot = [(1e-6, 1e-5), (1e-4, 0.02), (5e-4, 0.1)][rng.random_range(0..3usize)];
    observed(&Setup {
        cone: cone(&mut rng),
        noise: Noise {
            corner_px: [0.03, 0.1, 0.3][rng.random_range(0..3usize)],
            robot_m: robot.0,
            robot_rad: f64::to_radians(robot.1),
            ..Noise::EXACT
        },
        estimated: rng.random(),
        joints: rng.random(),
        ..Setup::new(mode, rng.random_range(10..=40), seed)
    })
}

/// A realistic healthy session: an arm whose error depends on where it is and is 1 to 3 mm, views level by level, corner
/// errors that neighbours share, a sheet that is not flat. Joints are not given if links have errors: an offset of a
/// joint is then real. The second value is its set-up.
pub fn as_met(seed: u64) -> (Observations, Setup) {
    let mut rng = ChaCha8Rng::seed_from_u64(seed ^ 0x3e71);
    let mode = if rng.random::<bool>() { Mode::EyeInHand } else { Mode::EyeToHand };
    let size_m = rng.random_range(1e-3..3e-3);
    let rad_per_m = 0.07f64.to_radians() / 1e-3;
    let arm_error = match rng.random_range(0..4) {
        0 => ArmError::None,
        // The tip is 0.2 m from the mean of its positions, RMS, along all three axes together.
        1 => ArmError::Affine(SMatrix::from_fn(|i, _| {
            normal(&mut rng) * size_m * if i < 3 { 1.0 } else { rad_per_m } / 0.2
        })),
        _ => ArmError::Links(std::array::from_fn(|_| {
            std::array::from_fn(|k| normal(&mut rng) * 0.5 * size_m * if k < 2 { 1.0 } else { rad_per_m })
        })),
    };
    let robot = [(2e-5, 5e-3), (1e-4, 0.02)][rng.random_range(0..2usize)];
    let warp_m = if rng.random::<bool>() { 0.0 } else { rng.random_range(-1e-3..1e-3) };
    let corner_px = [0.03, 0.1, 0.3][rng.random_range(0..3usize)];
    let setup = Setup {
        cone: cone(&mut rng),
        noise: Noise { corner_px, robot_m: robot.0, robot_rad: f64::to_radians(robot.1), ..Noise::EXACT },
        shared_px: if rng.random::<bool>() { 0.5 * corner_px } else { 0.0 },
        estimated: rng.random(),
        joints: !matches!(arm_error, ArmError::Links(_)) && rng.random(),
        by_level: rng.random(),
        arm_error,
        fault: Fault { warp_m, ..Fault::default() },
        ..Setup::new(mode, rng.random_range(10..=40), seed)
    };
    (observed(&setup), setup)
}

/// A healthy session of an arm of servo motors: eccentric gears, play, links that bend under their weight and sensors with 4096
/// steps per turn, which cause errors of the tip of some millimetres; views level by level or in no order, a printed board on a
/// sheet. None of this is in the model of any estimate.
pub fn servo(seed: u64) -> Setup {
    let mut rng = ChaCha8Rng::seed_from_u64(seed ^ 0x5e70);
    let mode = if rng.random::<bool>() { Mode::EyeInHand } else { Mode::EyeToHand };
    let degrees = |rng: &mut ChaCha8Rng, most: f64| rng.random_range(0.3 * most..most).to_radians();
    let servo = Servo {
        eccentric: std::array::from_fn(|_| [degrees(&mut rng, 0.3), rng.random_range(0.0..std::f64::consts::TAU)]),
        play_rad: std::array::from_fn(|_| degrees(&mut rng, 0.4)),
        sag_rad: std::array::from_fn(|_| degrees(&mut rng, 0.4)),
        step_rad: std::f64::consts::TAU / 4096.0,
    };
    Setup {
        noise: Noise {
            corner_px: [0.05, 0.1, 0.2][rng.random_range(0..3usize)],
            robot_m: 5e-5,
            robot_rad: 0.01f64.to_radians(),
            ..Noise::EXACT
        },
        shared_px: if rng.random::<bool>() { 0.05 } else { 0.0 },
        estimated: rng.random(),
        by_level: rng.random(),
        arm_error: ArmError::Servo(servo),
        fault: Fault { warp_m: rng.random_range(-3e-4..3e-4), ..Fault::default() },
        ..Setup::new(mode, rng.random_range(12..=40), seed)
    }
}

/// Whether a finding reports a cause that this healthy session does not have.
pub fn names_a_cause(finding: &Finding, setup: &Setup) -> bool {
    use FindingCode as C;
    let cause = [
        C::BoardMoved,
        C::CameraMoved,
        C::WrongScale,
        C::WrongIntrinsics,
        C::JointOffset,
        C::OutlierView,
        C::OutlierCorners,
        C::ShiftedPoses,
        C::WrongMode,
        C::WrongLengthUnit,
    ];
    let flat = setup.fault.warp_m == 0.0 && finding.code == C::BoardBent;
    finding.severity >= Severity::Warning && (flat || cause.contains(&finding.code))
}

/// Whether a finding reports that something moved.
pub fn names_a_move(finding: &Finding) -> bool {
    matches!(finding.code, FindingCode::BoardMoved | FindingCode::CameraMoved)
}

/// Error of the size found for a target that is 2 % too large, over its uncertainty, squared.
pub fn scale_error(estimated: bool, seed: u64) -> Option<f64> {
    let setup = Setup { estimated, ..Setup::new(Mode::EyeInHand, 20, seed) };
    let diagnosis = examined_alone(&observed(&setup.with(Fault { scale: 0.02, ..Fault::default() })));
    let scale = diagnosis.hypotheses.iter().find(|h| h.code == FindingCode::WrongScale)?.estimate?;
    Some(((scale.value - 1.02) / scale.sigma?).powi(2))
}
