//! Models for tests of panes: a window at work, from a made-up chain whose truth is known.

use handeye_result::CalibrationResult;
use std::path::PathBuf;
use std::sync::Arc;

use handeye_arm::{ArmKind, JointKind, JointValues};
use handeye_coppeliasim::cell::ArmKinematics;
use handeye_estimate::corrected_arm::CorrectedArm;
use handeye_estimate::diagnose::Calibration;
use handeye_estimate::diagnose::findings::{self, Finding, FindingOptions};
use handeye_estimate::handeye::joint::{ArmErrors, ArmParameter, LinkError, SmallSample, arm_parameters};
use handeye_estimate::handeye::screening::Distance;
use handeye_estimate::handeye::{HandEye, Mode};
use handeye_estimate::reach_error::USUAL_TOOL;
use handeye_estimate::verify::{self, Predictor, Uncertainty, Verification};
use handeye_estimate::{self as estimate, CameraKnowledge, Method, Observations, ObservedView, ViewStatus};
use handeye_export::ExportInput;
use handeye_geometry::camera::Intrinsics;
use handeye_geometry::depth::{ColourMap, DepthImage};
use handeye_geometry::frames::{Base, Camera, Pose, Target, Tip};
use handeye_geometry::progress::CancelToken;
use handeye_geometry::targets::observation::{Corner, Corners, View};
use handeye_session::{CaptureId, CaptureRecord, Document, Role};
use handeye_track::{BoardDetection, ByDepth, Estimate, MotionModel, Setup, State, Update};
use image::{Rgb, RgbImage};
use nalgebra::{DMatrix, Isometry3, Matrix6, Translation3, UnitQuaternion, Vector2, Vector3, Vector6};

use crate::model::{
    BoardMotion, BoardPath, CellFacts, CellSource, ColouredDepth, Corrected, FollowRequest, FollowStatus, FrameImages,
    FrameInfo, JobId, LinkState, LiveDetection, LiveFrame, Model, Moves, Observed, PreviewFile, RobotState,
    SessionState, Simulation, Solved, TrackError, TrackPoint, TrackState, Tracked, Truth, ViewSettings,
};
use crate::session::start::{self, BOARD};
use crate::track::worker::TrackedBy;
use crate::truth;

/// Captures of the fit.
pub const FITTED: u32 = 10;
/// Captures that verify it.
pub const VERIFYING: u32 = 2;

/// Where the camera of the sample really is.
pub fn tip_from_camera() -> Pose<Tip, Camera> {
    let turn = UnitQuaternion::from_euler_angles(0.0, 0.0, std::f64::consts::FRAC_PI_2);
    Pose::from_isometry(Isometry3::from_parts(Translation3::new(0.05, 0.0, 0.0), turn))
}

fn base_from_target() -> Pose<Base, Target> {
    let turn = UnitQuaternion::from_euler_angles(std::f64::consts::PI, 0.0, 0.0);
    Pose::from_isometry(Isometry3::from_parts(Translation3::new(0.4, 0.1, 0.02), turn))
}

/// The camera of the sample.
pub fn intrinsics() -> Intrinsics {
    Intrinsics::pinhole(640, 480, 589.37)
}

/// View number `n`: the board tilted and turned differently each time.
fn camera_from_target(n: u32) -> Pose<Camera, Target> {
    let n = f64::from(n);
    let turn = UnitQuaternion::from_euler_angles(0.45 * (1.7 * n).sin(), 0.45 * (2.3 * n).cos(), 0.5 * (0.9 * n).sin());
    let centre = Translation3::new(0.02 * (1.1 * n).sin(), 0.02 * (0.7 * n).cos(), 0.32 + 0.04 * (1.9 * n).sin());
    let half = BOARD.centre();
    Pose::from_isometry(
        centre * Isometry3::from_parts(Translation3::identity(), turn) * Translation3::new(-half.x, -half.y, 0.0),
    )
}

fn base_from_tip(n: u32) -> Pose<Base, Tip> {
    base_from_target() * camera_from_target(n).inverse() * tip_from_camera().inverse()
}

/// Corners with a noise of about 0.05 px that is the same in every run.
fn corners(n: u32) -> Corners {
    corners_at(n, &camera_from_target(n))
}

/// The same for a board elsewhere.
fn corners_at(n: u32, chain: &Pose<Camera, Target>) -> Corners {
    // Independent from corner to corner and from view to view: a pattern would be an error of the print.
    let noise_px = |i: usize, axis: u64| {
        let mut bits = (u64::from(n) << 32 | (i as u64) << 1 | axis).wrapping_add(0x9e37_79b9_7f4a_7c15);
        for factor in [0xbf58_476d_1ce4_e5b9, 0x94d0_49bb_1331_11eb] {
            bits = (bits ^ (bits >> 30)).wrapping_mul(factor);
        }
        ((bits >> 11) as f64 / (1_u64 << 53) as f64 - 0.5) * 0.05 * 12_f64.sqrt()
    };
    BOARD
        .points()
        .iter()
        .enumerate()
        .map(|(index, point)| {
            let px = intrinsics().project(&(chain.isometry() * point)).expect("the board is in front of the camera");
            Corner::new(index, px + Vector2::new(noise_px(index, 0), noise_px(index, 1)))
        })
        .collect()
}

fn record(n: u32) -> CaptureRecord {
    CaptureRecord {
        id: CaptureId(n),
        image: format!("images/{n:04}.png"),
        depth: Some(format!("depth/{n:04}.tiff")),
        base_from_tip: Some(base_from_tip(n)),
        joints_rad: Some(vec![0.1 * f64::from(n), 0.5, -1.0, 0.0, 1.5, 0.0]),
        sim_time_s: Some(f64::from(n)),
        role: if n <= FITTED { Role::Calibration } else { Role::Verification },
        excluded: false,
        frames: 1,
        corner_noise_px: None,
        settled_s: Some(0.3),
        pose_name: Some(format!("pose {n}")),
    }
}

/// Images with the column in the red and the row in the green.
pub fn images() -> FrameImages {
    let (width, height) = (640, 480);
    let rgb = RgbImage::from_fn(width, height, |column, row| Rgb([(column / 4) as u8, (row / 4) as u8, 120]));
    let metres = (0..width * height).map(|i| 0.3 + 0.2 * (i % width) as f32 / width as f32).collect();
    let metres = DepthImage { width, height, metres };
    let depth = ColouredDepth::new(metres, ColourMap::Turbo, [0.3, 0.5], 3.5).expect("an image");
    FrameImages { rgb, depth: Some(depth) }
}

/// Connected, with a live image in which the board is seen, and nothing captured.
pub fn connected() -> Model {
    let mut model = Model::new(CellSource::default(), ViewSettings::default());
    model.now_s = 100.0;
    let connected =
        LinkState::Connected { address: "tcp://127.0.0.1:1".to_owned(), server: "built-in cell".to_owned() };
    model.control = connected.clone();
    model.camera = connected.clone();
    model.mover = connected;
    model.robot = Some(RobotState {
        base_from_tip: base_from_tip(1),
        joints_rad: [0.1, 0.5, -1.0, 0.0, 1.5, 0.0].into(),
        sim_time_s: 12.35,
        simulation: Simulation::Running,
        is_armed: true,
    });
    model.cell = Some(CellFacts {
        joints: vec![
            crate::model::JointFacts {
                kind: JointKind::Revolute,
                range: Some([-std::f64::consts::TAU, std::f64::consts::TAU])
            };
            6
        ],
        nominal_intrinsics: Some(intrinsics()),
        arm: Some(arm()),
        arm_doubt: None,
        truth: Some(Truth {
            tip_from_camera: tip_from_camera(),
            base_from_target: Some(base_from_target()),
            intrinsics: intrinsics(),
        }),
        has_depth: true,
        moves: Moves::Freely,
        poses_are_typed: false,
    });
    let info = FrameInfo {
        number: 1,
        sim_time_s: 12.3,
        image_age_s: 0.0,
        image_off_m: 0.0,
        no_pose: None,
        received_s: 99.98,
        rate_hz: 20.0,
        depth_range_m: [0.3, 0.5],
        far_plane_m: 3.5,
        base_from_tip: Some(base_from_tip(1)),
        joints_rad: [0.1, 0.5, -1.0, 0.0, 1.5, 0.0].into(),
        base_from_target_true: Some(base_from_target()),
        clocks: None,
    };
    model.frame = Some(LiveFrame { info, images: Arc::new(images()) });
    model.board_seen_s = Some(model.now_s);
    model.detection = Some(LiveDetection {
        frame: 1,
        corners: Some(corners(1)),
        camera_from_target: Some(camera_from_target(1)),
        base_from_tip: Some(base_from_tip(1)),
        joints_rad: [0.1, 0.5, -1.0, 0.0, 1.5, 0.0].into(),
        took_s: 0.006,
        problem: None,
        dropped: 0,
    });
    model
}

/// Ten captures of the fit and two that verify it, on the disk and searched, not solved.
pub fn captured() -> Model {
    let mut model = connected();
    let mut document = Document::new(start::meta(None, String::new()));
    document.captures = (1..=FITTED + VERIFYING).map(record).collect();
    for n in 1..=FITTED + VERIFYING {
        let thumbnail = RgbImage::from_fn(160, 120, |column, row| Rgb([column as u8, row as u8, (20 * n) as u8]));
        let observed =
            Observed { corners: Some(corners(n)), depth: None, image_size: (640, 480), thumbnail: Arc::new(thumbnail) };
        model.observed.insert(CaptureId(n), Some(Arc::new(observed)));
    }
    let folder = Some(PathBuf::from("sessions/sample"));
    model.session = SessionState { folder, document: Arc::new(document), undo: None, redo: None };
    model
}

/// As [`captured`], of images without a robot.
pub fn images_alone() -> Model {
    let mut model = captured();
    for capture in &mut Arc::make_mut(&mut model.session.document).captures {
        capture.base_from_tip = None;
    }
    model
}

/// The goal.
const FINDINGS: FindingOptions = FindingOptions::with_goal_mm(Some(0.5));

/// What was seen in the captures of the fit.
pub fn observations() -> Observations {
    let views = (1..=FITTED).map(|n| ObservedView::new(record(n).image, Some(base_from_tip(n)), Some(corners(n))));
    Observations {
        mode: Some(Mode::EyeInHand),
        target: BOARD,
        image_size: (640, 480),
        camera: CameraKnowledge::NOTHING,
        views: views.collect(),
    }
}

/// The same, solved and verified.
pub fn solved() -> Model {
    let mut model = captured();
    let observations = observations();
    let cancel = CancelToken::default();
    let calibration = Calibration::as_modelled(estimate::fit(&observations, Method::Joint, &cancel).expect("a fit"));
    assert!(matches!(calibration.hand_eye, Some(HandEye::EyeInHand { .. })));
    let mut result = CalibrationResult::of(&calibration, "0.1.0", None, std::collections::BTreeMap::new());
    result.truth = truth::comparison(&result, &tip_from_camera(), &intrinsics());
    let calibrated = Predictor::new(&calibration).expect("a hand-eye");
    let checks: Vec<View> =
        (FITTED + 1..=FITTED + VERIFYING).map(|n| View::new(record(n).image, base_from_tip(n), corners(n))).collect();
    let captures: Vec<&View> = checks.iter().collect();
    let verification = verify::verify(&calibrated, &BOARD, &captures, &cancel);
    model.solve.solved = Some(Arc::new(Solved {
        job: JobId(1),
        captures: (1..=FITTED).map(CaptureId).collect(),
        findings: findings::findings(&observations, Some(&calibration), &FINDINGS),
        result,
        corrected: None,
        calibrated: Some(calibrated),
        verification: Some(verification),
        depth: None,
        verified_captures: (FITTED + 1..=FITTED + VERIFYING).map(CaptureId).collect(),
        calibration,
        took_s: 0.2,
    }));
    model.solve.fresh = true;
    model
}

/// The same with its answer changed.
pub fn with_answer(change: impl FnOnce(&mut Solved)) -> Model {
    let mut model = solved();
    let mut solved = Solved::clone(model.solve.solved.as_ref().expect("solved"));
    change(&mut solved);
    model.solve.solved = Some(Arc::new(solved));
    model
}

/// The arm of the sample with errors of its own: tenths of a degree and of a millimetre.
pub fn corrected_arm() -> CorrectedArm {
    let robot = connected().robot.expect("connected");
    let bare = ArmKind::Ur5Coppeliasim.arm();
    let there = *bare.forward(&robot.joints_rad).expect("six joints").isometry();
    let (foot, tool) = (bare.base_from_first, bare.flange_from_tip);
    let arm = bare.mounted(robot.base_from_tip.isometry() * there.inverse() * foot, tool);
    let count = arm_parameters(6).len();
    let value = |(k, parameter): (usize, &ArmParameter)| {
        let size = if matches!(parameter.error, LinkError::ShiftX | LinkError::ShiftY) { 2e-4 } else { 2e-3 };
        size * (k as f64 * 0.7).sin()
    };
    CorrectedArm {
        arm,
        errors: ArmErrors::new(6, arm_parameters(6).iter().enumerate().map(value).collect()).expect("so many"),
        covariance: DMatrix::identity(count, count) * 1e-9,
        unexplained: (2e-5, 1e-5),
        small_sample: SmallSample::KNOWN,
        tool_m: USUAL_TOOL.into(),
    }
}

/// [`solved`] with an answer that knows the errors of the arm.
pub fn with_errors_of_the_arm() -> Model {
    with_answer(|solved| {
        let (arm, reported) = (corrected_arm(), solved.calibrated.clone().expect("a hand-eye"));
        let uncertainty = reported.uncertainty.as_ref().map(|uncertainty| {
            let (known, of_arm) = (uncertainty.covariance.nrows(), arm.covariance.nrows());
            let mut covariance = DMatrix::zeros(known + of_arm, known + of_arm);
            covariance.view_mut((0, 0), (known, known)).copy_from(&uncertainty.covariance);
            covariance.view_mut((known, known), (of_arm, of_arm)).copy_from(&arm.covariance);
            Uncertainty { covariance, ..uncertainty.clone() }
        });
        let calibrated = Predictor { arm: Some(arm.errors.clone()), uncertainty, ..reported };
        let verification = solved.verification.clone().and_then(Result::ok).map(|it| {
            let centre_rms_m = it.centre_rms_m / 8.0;
            Verification { centre_rms_m, ..it }
        });
        solved.corrected = Some(Arc::new(Corrected { arm: Arc::new(arm), calibrated, verification }));
        solved.result.quality.reach_error_95_mm = Some(2.91);
        solved.result.quality.reach_error_corrected_95_mm = Some(0.25);
    })
}

/// The capture that does not fit the others in [`with_an_outlier`].
pub const OUTLIER: CaptureId = CaptureId(3);

/// The same, with a capture that the estimate excluded as an outlier: its board is 12.3 mm and 1.5° from where the others put it.
pub fn with_an_outlier() -> Model {
    let mut model = solved();
    let mut solved = Solved::clone(model.solve.current().expect("solved"));
    let at = solved.captures.iter().position(|id| *id == OUTLIER).expect("in the fit");
    let view = &mut solved.calibration.views[at];
    view.status = ViewStatus::Outlier;
    view.distance = Some(Distance { of_limit: 9.0, metres: 12.3e-3, radians: 1.5_f64.to_radians() });
    view.rms_px = Some(18.0);
    (view.influence_m, view.correction_m, view.correction_rad) = (None, None, None);
    let truth = solved.result.truth.take();
    solved.result = CalibrationResult::of(&solved.calibration, "0.1.0", None, std::collections::BTreeMap::new());
    solved.result.truth = truth;
    solved.findings = findings::findings(&observations(), Some(&solved.calibration), &FINDINGS);
    solved.result.findings = solved.findings.iter().map(Finding::to_record).collect();
    model.solve.solved = Some(Arc::new(solved));
    model
}

/// The same, with the text of every file as it would be written.
pub fn previewed() -> Model {
    let mut model = solved();
    let solved = model.solve.current().expect("solved").clone();
    for format in handeye_export::formats() {
        let files = handeye_export::preview(*format, &ExportInput::new(&solved.result, &model.export.names));
        let files = files
            .map_err(crate::text::Text::from)
            .map(|files| files.into_iter().map(|file| PreviewFile { name: file.name, text: file.text }).collect());
        model.export.previews.insert(format.name().to_owned(), files);
    }
    model
}

/// Images per second of the tracked board.
const TRACK_HZ: f64 = 20.0;

/// The tracked board at a time: a circle of 30 mm in its plane, twice a minute.
fn moving_board(time_s: f64) -> Pose<Base, Target> {
    let (sin, cos) = (std::f64::consts::TAU * time_s / 30.0).sin_cos();
    base_from_target().perturbed(&Vector6::new(0.03 * cos, 0.03 * sin, 0.0, 0.0, 0.0, 0.0))
}

/// A millimetre or so that is the same in every run.
fn small(time_s: f64, size: f64) -> Vector6<f64> {
    Vector6::from_fn(|row, _| size * (13.7 * time_s + 2.1 * row as f64).sin())
}

fn track_point(time_s: f64) -> TrackPoint {
    let is_known = !(12.0..13.5).contains(&time_s);
    let error = TrackError { position_m: 0.25e-3 + 0.15e-3 * (3.1 * time_s).sin(), rotation_rad: 1e-3 };
    TrackPoint {
        time_s,
        position_m: is_known.then(|| moving_board(time_s).translation().into()),
        position_95_m: is_known.then_some(0.5e-3 + if time_s < 14.0 { 0.3e-3 } else { 0.0 }),
        error: is_known.then_some(error),
        latency_s: 0.012,
    }
}

/// The same, with the board tracked along a circle for half a minute, and followed by the arm.
pub fn tracking() -> Model {
    let mut model = solved();
    let time_s = 30.0;
    let truth = moving_board(time_s);
    let chain = (base_from_tip(1) * tip_from_camera()).inverse() * truth;
    if let Some(detection) = &mut model.detection {
        detection.corners = Some(corners_at(1, &chain));
        detection.camera_from_target = Some(chain);
    }
    let seen = BoardDetection {
        corners: corners_at(1, &chain),
        camera_from_target: chain,
        base_from_target: truth.perturbed(&small(time_s, 0.4e-3)),
        covariance: Matrix6::identity() * 1e-8,
        rms_px: 0.08,
    };
    let by_depth = ByDepth {
        base_from_target: truth.perturbed(&small(time_s + 0.3, 0.9e-3)),
        first_corner_in_base: None,
        corners: 66,
        rms_m: 0.4e-3,
    };
    let estimate = Estimate {
        time_s,
        base_from_target: truth.perturbed(&small(time_s, 0.2e-3)),
        covariance: Matrix6::from_diagonal(&Vector6::new(1e-8, 1e-8, 4e-8, 1e-7, 1e-7, 2e-8)),
        velocity_m_s: Vector3::new(0.0, -6.3e-3, 0.0),
        angular_velocity_rad_s: Vector3::zeros(),
    };
    let error = Some(TrackError { position_m: 0.31e-3, rotation_rad: 0.9e-3 });
    let setup = Setup {
        target: model.document().meta.target,
        calibrated: model.calibrated().expect("solved").clone(),
        motion: MotionModel::default(),
    };
    model.track = TrackState {
        on: true,
        by: Some(Arc::new(TrackedBy { setup, arm: None })),
        wants_corrected: None,
        request: Some(FollowRequest::KeepView),
        follow: FollowStatus::Following { distance_m: 1.2e-3, angle_rad: 4e-3, is_kept_off: false },
        newest: Some(Arc::new(Tracked {
            frame: 1,
            update: Update {
                time_s,
                state: State::Tracking { corners: 68, of: 70 },
                seen: Some(seen),
                with_depth: None,
                by_depth: Some(by_depth),
                estimate: Some(estimate),
            },
            latency_s: 0.012,
            rate_hz: TRACK_HZ,
            error,
            truth: Some(truth),
        })),
        history: (0..=(time_s * TRACK_HZ) as u32).map(|n| track_point(f64::from(n) / TRACK_HZ)).collect(),
        board: BoardMotion { path: BoardPath::Circle, speed_m_s: 0.05 },
        board_hidden: false,
    };
    if let Some(frame) = &mut model.frame {
        frame.info.base_from_target_true = Some(truth);
        frame.info.sim_time_s = time_s;
    }
    let (from, to) = (base_from_tip(2).translation(), base_from_tip(1).translation());
    for n in 0..=60 {
        let part = f64::from(n) / 60.0;
        let arc = Vector3::new(0.0, 0.0, 0.05 * (std::f64::consts::PI * part).sin());
        model.trail.add((from + (to - from) * part + arc).into());
    }
    if let Some(robot) = &mut model.robot {
        robot.joints_rad = joints_at(&robot.base_from_tip);
    }
    model
}

/// The arm of the reference scene.
fn arm() -> ArmKinematics {
    let (base_from_arm, connection_from_tip) =
        (Isometry3::translation(0.0, 0.0, 0.025), Isometry3::translation(0.0, 0.0, 0.017));
    ArmKinematics::ur5(base_from_arm, connection_from_tip, &ArmKind::Ur5Coppeliasim.ranges()).expect("ranges with room")
}

/// The joints with which the arm of the reference scene has its tip there.
fn joints_at(base_from_tip: &Pose<Base, Tip>) -> JointValues {
    arm().reach(base_from_tip, &[0.0, 0.8, -1.5, 0.5, 1.5, 0.0]).expect("within reach")
}

#[test]
fn the_sample_is_a_good_calibration() {
    let model = solved();
    let solved = model.solve.current().expect("solved");
    let truth = solved.result.truth.as_ref().expect("compared");
    assert!(truth.translation_error_mm.is_some_and(|mm| mm < 0.5), "{truth:?}");
    assert!(matches!(solved.verification, Some(Ok(_))));
}
