use super::*;
use handeye_geometry::targets::Grid;

const SEED10: &str = include_str!("../../../assets/poses/seed10.toml");

/// World tip poses x y z qx qy qz qw as they were taught.
#[expect(clippy::excessive_precision, reason = "every digit as it was taught")]
const TAUGHT: [[f64; 7]; 10] = [
    [
        -0.1100547923916193,
        -0.01595811170705489,
        0.8466254222789784,
        0.560910589456253,
        -0.5609503047415633,
        0.4305463900323013,
        0.43051582116844406,
    ],
    [
        -0.16595811170705488,
        -0.01595811170705487,
        0.8216254222789784,
        0.5417925804901749,
        -0.4495188049772251,
        0.575726166263469,
        0.415852167455231,
    ],
    [
        -0.1100547923916193,
        -0.01595811170705487,
        0.8216254222789784,
        3.21292597227468e-05,
        0.7932754374087434,
        -0.6088644721541127,
        1.7127530004424877e-05,
    ],
    [
        -0.1100547923916193,
        -0.01595811170705489,
        0.9216254222789784,
        1.4077336111962496e-05,
        0.7932754374087434,
        -0.608862940314109,
        1.085602215830202e-05,
    ],
    [
        -0.1100547923916193,
        -0.015958111707054884,
        0.8216254222789784,
        0.579152193496431,
        -0.5416388515007398,
        0.4546027806731813,
        0.40564319680902283,
    ],
    [
        -0.1100547923916193,
        -0.015958111707054884,
        0.8216254222789784,
        0.5415953148716405,
        -0.5791980963813808,
        0.4056650408034863,
        0.45457667640033966,
    ],
    [
        -0.2100547923916193,
        -0.015958111707054898,
        0.8816254222789784,
        0.5212515544329563,
        -0.5212938037943111,
        0.4777945964218841,
        0.47776763259657323,
    ],
    [
        -0.15000547923916193,
        -0.015958111707054898,
        0.8016254222789784,
        0.5212515544329563,
        -0.5212938037943111,
        0.4777945964218841,
        0.47776763259657323,
    ],
    [
        -0.15000547923916193,
        -0.015958111707054898,
        0.8016254222789784,
        0.5212515544329563,
        -0.5212938037943111,
        0.4777945964218841,
        0.47776763259657323,
    ],
    [
        -0.1010000547923916193,
        -0.015958111707054898,
        0.8016254222789784,
        0.5212515544329563,
        -0.5212938037943111,
        0.4777945964218841,
        0.47776763259657323,
    ],
];

fn seed10() -> TaughtPoses {
    TaughtPoses::parse(Path::new("seed10.toml"), SEED10).unwrap_or_else(|e| panic!("{e}"))
}

#[test]
fn seed10_holds_the_reference_poses_exactly() {
    let file = seed10();
    assert_eq!(file.poses.len(), TAUGHT.len());
    let document: toml::Table = SEED10.parse().expect("TOML");
    for (pose, taught) in document["pose"].as_array().expect("poses").iter().zip(TAUGHT) {
        let numbers = |key: &str| {
            pose["base_from_tip"][key].as_array().expect("numbers").iter().filter_map(toml::Value::as_float)
        };
        assert!(numbers("translation_m").chain(numbers("rotation_xyzw")).eq(taught), "{pose}");
    }
    for (pose, [x, y, z, qx, qy, qz, qw]) in file.poses.iter().zip(TAUGHT) {
        let Goal::Tip(base_from_tip) = &pose.goal else { panic!("{} is not a tip pose", pose.name) };
        assert_eq!(<[f64; 3]>::from(base_from_tip.translation()), [x, y, z], "{}", pose.name);
        // The third and fourth were taught with a quaternion 10⁻⁶ off unit length; the rotation is that of its axis.
        let expected = UnitQuaternion::from_quaternion(Quaternion::new(qw, qx, qy, qz));
        assert!(base_from_tip.rotation().angle_to(&expected) < 1e-15, "{}", pose.name);
    }
    assert_eq!(file.poses[7].goal, file.poses[8].goal);
    let start = file.start_joints_rad.expect("a start");
    assert_eq!(start, [0.0, 45.0, -60.0, 0.0, 90.0, 0.0].map(f64::to_radians));
    let limits = file.limits.expect("limits");
    let joints = [limits.joint_velocity, limits.joint_acceleration, limits.joint_jerk];
    assert_eq!(joints, [310.0, 100.0, 80.0].map(f64::to_radians));
    assert_eq!([limits.tip_velocity, limits.tip_acceleration, limits.tip_jerk], [30.0, 1.0, 1.0]);
}

#[test]
fn what_is_written_reads_back() {
    let mut poses = seed10();
    // Degrees and back to radians may move the last bit once; from then on nothing moves.
    let joints = Goal::Joints(vec![0.1, 0.2, 0.3, 0.4, 0.5, 0.6]);
    poses.poses.push(TaughtPose::new("by \"joints\" — é\n", joints));
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = folder.path().join("taught.toml");
    poses.write(&path).expect("write");
    let read = TaughtPoses::read(&path).expect("read");
    assert_eq!(read.poses[..10], poses.poses[..10]);
    assert_eq!(read.poses[10].name, poses.poses[10].name);
    let (Goal::Joints(a), Goal::Joints(b)) = (&read.poses[10].goal, &poses.poses[10].goal) else { panic!("joints") };
    assert!(a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-15));
    let bare =
        TaughtPoses { prismatic: Vec::new(), start_joints_rad: None, limits: None, poses: poses.poses[..1].to_vec() };
    bare.write(&path).expect("write");
    assert_eq!(TaughtPoses::read(&path).expect("read"), bare);
}

#[test]
fn a_prismatic_joint_has_metres_in_file_and_program() {
    // Angles that degrees have exactly.
    let goal = vec![0.0, -0.25, std::f64::consts::FRAC_PI_2];
    let poses = vec![TaughtPose::new("on the rail", Goal::Joints(goal.clone()))];
    let taught = TaughtPoses { prismatic: vec![1], start_joints_rad: Some(goal), limits: None, poses };
    let text = taught.to_toml();
    assert!(text.contains("prismatic_joints = [2]") && text.contains(", -0.25, 90.0]"), "{text}");
    assert_eq!(TaughtPoses::parse(Path::new("p.toml"), &text).expect("its own"), taught);
    let wrong = text.replace("[2]", "[0]");
    let error = TaughtPoses::parse(Path::new("p.toml"), &wrong).expect_err("counted from 1").to_string();
    assert!(error.starts_with("p.toml, row 4") && error.contains("from 1 at the base"), "{error}");
}

#[test]
fn a_defect_is_one_line_with_the_file_the_row_and_the_pose() {
    let third = SEED10.lines().position(|l| l.contains("\"P3\"")).expect("a third") + 1;
    let row = |n: usize| format!("seed10.toml, row {n}");
    let pose_row = format!("{}, pose \"P3\"", row(third - 1));
    let cases = [
        ("handeye-poses", "handeye-session", row(5), "format"),
        ("version = 1", "version = 2", row(6), "version is 2"),
        ("-60.0", "nan", row(7), "start_joints_deg is not finite"),
        ("tip_jerk = 1.0", "tip_jerk = 0", row(9), "tip_jerk must be"),
        ("tip_jerk = 1.0 ", "tip_jork = 1.0 ", row(15), "tip_jerk"),
        ("\"P3\"", "\"P2\"", format!("{}, pose \"P2\"", row(third - 1)), "same name"),
        ("\"P3\"\nbase_from_tip", "\"P3\"\njoints_deg = [1.0, 2.0]\nbase_from_tip", pose_row.clone(), "either"),
        ("\"P3\"\n", "\"P3\"\njoints_deg = [1.0]\n#", pose_row.clone(), "1 joint angles, others in this file have 6"),
        ("\"P3\"\n", "\"P3\"\n#", pose_row.clone(), "either base_from_tip or joints_deg"),
        ("0.7932754374087434", "0.8", pose_row.clone(), "rotation_xyzw has length 1.00"),
        ("0.7932754374087434", "inf", pose_row, "rotation_xyzw is not finite"),
        ("rotation_xyzw", "rotation_wxyz", row(19), "rotation_wxyz"),
    ];
    for (from, to, place, needle) in cases {
        assert!(SEED10.contains(from), "{from}");
        let error = TaughtPoses::parse(Path::new("seed10.toml"), &SEED10.replacen(from, to, 1)).expect_err(to);
        let text = error.to_string();
        assert!(text.starts_with(&place) && text.contains(needle) && !text.contains('\n'), "{to}: {text}");
    }
    let head = &SEED10[..SEED10.find("[[pose]]").expect("poses")];
    let error = TaughtPoses::parse(Path::new("p.toml"), head).expect_err("no poses").to_string();
    assert!(error.contains("no [[pose]]"), "{error}");
    assert!(TaughtPoses::read(Path::new("/nowhere/p.toml")).is_err());
}

#[test]
fn another_arm_base_or_target_is_another_cell() {
    let joint = TaughtJoint { kind: JointKind::Revolute, range: Some([-3.0, 3.0]) };
    let target = |square_m| TargetSpec::Chessboard(Grid { columns: 10, rows: 7, square_m });
    let cell = TaughtOn {
        base: "tcp://127.0.0.1:23000".into(),
        joints: vec![joint; 6],
        tip_at_zero_m: Some([0.8, 0.2, 0.0]),
        target: target(0.015),
    };
    // As computed again for another connection, with rounding.
    let again = TaughtOn { tip_at_zero_m: Some([0.8 + 1e-9, 0.2, 0.0]), ..cell.clone() };
    assert!(cell.is_same(&again));
    let others = [
        TaughtOn { base: "tcp://10.0.0.2:23000".into(), ..cell.clone() },
        TaughtOn { joints: vec![joint; 7], ..cell.clone() },
        TaughtOn { joints: vec![TaughtJoint { range: Some([-2.0, 3.0]), ..joint }; 6], ..cell.clone() },
        TaughtOn { tip_at_zero_m: Some([1.2, 0.2, 0.0]), ..cell.clone() },
        TaughtOn { target: target(0.02), ..cell.clone() },
    ];
    let pose = TaughtPose { cell: Some(cell.clone()), ..TaughtPose::new("a", Goal::Joints(vec![0.0; 6])) };
    assert!(pose.is_of(Some(&again)) && !pose.is_of(None));
    for other in others {
        assert!(!pose.is_of(Some(&other)), "{other:?}");
    }
    let unknown = TaughtPose::new("a", Goal::Joints(vec![0.0; 6]));
    assert!(!unknown.is_of(Some(&cell)), "nobody knows where it was taught");
}
