use super::*;
use handeye_arm::ArmKind;
use handeye_dataset::Dataset;
use handeye_estimate::placement::{PlacementError, place};
use handeye_geometry::se3;
use nalgebra::Vector6;

fn session(seed: u64, fault: Option<Fault>) -> RecordedSession {
    record(&Scene::realistic().unwrap(), &SessionOptions { seed, fault, ..SessionOptions::default() }).unwrap()
}

/// Root mean square of what the truth leaves of the corners of a view, with the tip at `base_from_tip`; pixels per axis.
fn rms_px(session: &RecordedSession, view: &RecordedView, base_from_tip: &Pose<Base, Tip>) -> f64 {
    let camera_from_target = session.truth.camera_from_target(base_from_tip);
    let points = session.target.points();
    let sum: f64 = view
        .corners
        .iter()
        .map(|corner| {
            let seen = camera_from_target.isometry() * points[corner.index];
            (session.truth.intrinsics.project(&seen).unwrap() - corner.px).norm_squared()
        })
        .sum();
    (sum / (2 * view.corners.len()) as f64).sqrt()
}

/// The largest of all views, with the tip where the record says.
fn worst_rms_px(session: &RecordedSession) -> f64 {
    session.views.iter().map(|view| rms_px(session, view, &view.base_from_tip)).fold(0.0, f64::max)
}

#[test]
fn the_arm_of_data_sets_is_the_arm_of_the_cell() {
    // The central difference of the cell's own kinematics is off by h²/6.
    const STEP: f64 = 1e-5;
    let scene = Scene::realistic().unwrap().resolve(3).unwrap();
    let arm = ArmKind::Ur5Coppeliasim.arm();
    let arm = arm
        .clone()
        .mounted(scene.world_from_arm * arm.base_from_first, arm.flange_from_tip * scene.connection_from_tip);
    for view in session(3, None).views {
        let tip = scene.reported_tip(&view.joints_rad).unwrap();
        let (distance_m, angle_rad) = arm.forward(&view.joints_rad).unwrap().distance_to(&tip);
        assert!(distance_m < 1e-12 && angle_rad < 1e-7, "acos near 1 has half the digits");
        let twists = arm.tip_by_joint(&view.joints_rad).unwrap();
        for (j, twist) in twists.iter().enumerate() {
            let moved = |step: f64| {
                let mut joints = view.joints_rad;
                joints[j] += step;
                se3::log((tip.inverse() * scene.reported_tip(&joints).unwrap()).isometry())
            };
            let difference: Vector6<f64> = (moved(STEP) - moved(-STEP)) / (2.0 * STEP);
            assert!((difference - twist).norm() < 1e-9, "joint {}", j + 1);
        }
    }
}

#[test]
fn a_healthy_session_is_what_the_truth_shows_but_for_its_noise() {
    // 0.05 mm and 0.01° of the robot are up to 0.3 px at 0.3 m; 140 numbers with 0.1 px scatter by 6 %.
    let mut scene = Scene::realistic().unwrap();
    scene.robot.repeatability_mm = 0.0;
    scene.robot.repeatability_deg = 0.0;
    let session = record(&scene, &SessionOptions::default()).unwrap();
    assert_eq!(session.views.len(), 20);
    for view in &session.views {
        assert_eq!(view.corners.len(), 70, "the whole board is in view");
        let rms = rms_px(&session, view, &view.base_from_tip);
        assert!((rms / 0.1 - 1.0).abs() < 0.3, "{}: {rms} px", view.name);
    }
    assert_eq!(record(&scene, &SessionOptions::default()).unwrap(), session, "the same seed gives the same session");
    let other = record(&scene, &SessionOptions { seed: 2, ..SessionOptions::default() }).unwrap();
    assert_ne!(other.views[0].joints_rad, session.views[0].joints_rad);
}

#[test]
fn every_fault_is_in_the_corners_or_the_poses_and_where_it_should_be() {
    for seed in 1..=3 {
        let healthy = worst_rms_px(&session(seed, None));
        assert!(healthy < 0.6, "{healthy}");
        let slipped = session(seed, Some(Fault::STUDIED[0]));
        for (i, view) in slipped.views.iter().enumerate() {
            // 5 mm at 0.5 m with 590 px are 5.9 px, less where it is seen from the side.
            let rms = rms_px(&slipped, view, &view.base_from_tip);
            assert!(if i < 11 { rms < 0.6 } else { rms > 1.5 }, "view {}: {rms} px", i + 1);
        }
        let moving = session(seed, Some(Fault::STUDIED[3]));
        for (i, view) in moving.views.iter().enumerate() {
            let rms = rms_px(&moving, view, &view.base_from_tip);
            assert!(if i == 11 { rms > 1.5 } else { rms < 0.6 }, "view {}: {rms} px", i + 1);
        }
        // 2 % of half a board of 135 mm at 0.4 m.
        let scaled = session(seed, Some(Fault::STUDIED[1]));
        assert_eq!((scaled.target.grid().square_m, scaled.truth.target.grid().square_m), (0.015, 0.015 * 1.02));
        assert!(worst_rms_px(&scaled) > 1.0);
    }
}

#[test]
fn turning_the_reported_tip_by_the_twists_explains_joint_offsets() {
    let mut scene = Scene::realistic().unwrap();
    (scene.robot.repeatability_mm, scene.robot.repeatability_deg) = (0.0, 0.0);
    let exact = SessionOptions { corner_px: 0.0, seed: 5, ..SessionOptions::default() };
    let offset_rad = 0.2_f64.to_radians();
    let worst_px = |session: &RecordedSession, offsets_rad: [f64; 6]| {
        let views = session.views().unwrap();
        let one = |(view, recorded): (&View, &RecordedView)| {
            let twist: Vector6<f64> = view.tip_by_joint.iter().zip(offsets_rad).map(|(twist, q)| twist * q).sum();
            rms_px(session, recorded, &view.base_from_tip.perturbed(&twist))
        };
        views.iter().zip(&session.views).map(one).fold(0.0, f64::max)
    };
    for joint in 1..=6 {
        let fault = Some(Fault::JointOffset { joint, offset_deg: 0.2 });
        let session = record(&scene, &SessionOptions { fault, ..exact }).unwrap();
        let offsets_rad = std::array::from_fn(|j| if j + 1 == joint { offset_rad } else { 0.0 });
        assert!(worst_px(&session, [0.0; 6]) > 0.3, "joint {joint} matters");
        // The motion of one joint is a screw, and its exponential exact.
        assert!(worst_px(&session, offsets_rad) < 1e-6, "joint {joint}");
    }
    let offset_deg = [0.2, -0.2, 0.2, 0.2, -0.2, 0.2];
    scene.robot.joint_offset_deg = Some(offset_deg.into());
    let session = record(&scene, &exact).unwrap();
    // Of several joints the model has the first order; products of two offsets are 10⁻⁵ m and rad, 0.02 px at 0.3 m.
    assert!(worst_px(&session, [0.0; 6]) > 1.0);
    assert!(worst_px(&session, offset_deg.map(f64::to_radians)) < 0.1);
}

#[test]
fn poses_written_wrongly_do_not_fit_the_joint_values() {
    for fault in [Fault::PosesInverted, Fault::Millimetres] {
        assert!(matches!(session(1, Some(fault)).views(), Err(PlacementError::Foreign { .. })), "{fault}");
    }
    for fault in [None, Some(Fault::STUDIED[2])] {
        let session = session(1, fault);
        let views: Vec<JointView<'_>> = session
            .views
            .iter()
            .map(|view| JointView { base_from_tip: view.base_from_tip, joints_rad: &view.joints_rad })
            .collect();
        // What the controller reports is its own kinematics, whatever is wrong with the arm.
        assert!(place(&session.truth.arm, &views).unwrap().rms_m() < 1e-9);
    }
}

#[test]
fn a_session_reads_back_as_a_data_set_with_all_its_numbers() {
    let session = session(4, Some(Fault::STUDIED[2]));
    let folder = tempfile::tempdir().unwrap();
    session.write_dataset(folder.path(), true).unwrap();
    let data = Dataset::read(folder.path()).unwrap_or_else(|e| panic!("{e}"));
    assert_eq!((data.mode, data.target), (Some(Mode::EyeInHand), session.target));
    assert_eq!(data.camera.unwrap().intrinsics, Some(session.truth.intrinsics));
    for ((entry, view), expected) in data.entries.iter().zip(&session.views).zip(session.views().unwrap()) {
        assert_eq!(entry.name, view.name);
        assert_eq!(entry.joints_rad.as_deref(), Some(&view.joints_rad[..]));
        assert_eq!(entry.corners.as_ref(), Some(&view.corners));
        assert_eq!(entry.tip_by_joint, expected.tip_by_joint);
        let (distance_m, _) = entry.base_from_tip.unwrap().distance_to(&view.base_from_tip);
        assert!(distance_m < 1e-15);
    }
}

#[test]
fn faults_have_names() {
    for fault in Fault::STUDIED {
        assert_eq!(fault.to_string().parse(), Ok(fault));
    }
    assert_eq!("joint2".parse(), Ok(Fault::JointOffset { joint: 2, offset_deg: 0.2 }));
    assert_eq!("joint13".parse::<Fault>(), Err(UnknownFault("joint13".to_owned())));
    let absent = SessionOptions { fault: Some("joint7".parse().unwrap()), ..SessionOptions::default() };
    let error = record(&Scene::default(), &absent).unwrap_err();
    assert!(matches!(error, RecordError::NoSuchJoint { joint: 7, joints: 6 }), "{error}");
    let late = SessionOptions { views: 10, fault: Some(Fault::STUDIED[0]), ..SessionOptions::default() };
    let error = record(&Scene::default(), &late).unwrap_err();
    assert!(matches!(error, RecordError::NoSuchView { view: 12, views: 10 }), "{error}");
}
