//! Formats about the corrected arm, against its forward kinematics, by readers that share nothing with the writers.

use std::collections::BTreeMap;

use nalgebra::{Matrix4, Rotation3, Vector3};

use super::tests::file_of;
use super::*;
use handeye_arm::urdf::Urdf;
use handeye_arm::{Arm, ArmKind, testing};
use handeye_estimate::ArmFit;
use handeye_estimate::handeye::joint::{ArmErrors, LinkError, Noise, arm_parameters};
use handeye_result::testing::{golden, golden_arm, golden_arm_with_a_field};
use handeye_result::{ArmEstimate, CalibrationResult};
use proptest::prelude::*;

/// Rounding error of a product of seven transforms, metres and radians.
const NEAR: f64 = 1e-9;
const UR_KINDS: [ArmKind; 7] =
    [ArmKind::Ur3, ArmKind::Ur5, ArmKind::Ur10, ArmKind::Ur3e, ArmKind::Ur5e, ArmKind::Ur10e, ArmKind::Ur16e];

/// A result whose arm has these errors; none of them is one of compliance.
fn with_arm(arm: &Arm, error: impl Fn(usize) -> f64) -> CalibrationResult {
    let joints = arm.joint_count();
    let value = |(k, parameter): (usize, &handeye_estimate::handeye::joint::ArmParameter)| match parameter.error {
        LinkError::Compliance => 0.0,
        // A centimetre of length for a radian of angle.
        LinkError::ShiftX | LinkError::ShiftY => error(k) * 0.1,
        _ => error(k),
    };
    let values: Vec<f64> = arm_parameters(joints).iter().enumerate().map(value).collect();
    let count = values.len();
    let fit = ArmFit {
        errors: ArmErrors::new(joints, values).expect("so many"),
        covariance: nalgebra::DMatrix::from_diagonal_element(12 + count, 12 + count, 1e-9),
        ..golden_arm().1
    };
    CalibrationResult { arm: ArmEstimate::new(arm, &fit, [0.0, 0.0, 0.1]), ..golden() }
}

fn text_of(format: &str, name: &str, result: &CalibrationResult) -> String {
    file_of(format, name, result, &ExportNames::default(), &[]).text
}

/// Tip pose by the corrected arm of a result.
fn actual(result: &CalibrationResult, joints: &[f64]) -> Matrix4<f64> {
    let arm = result.arm.as_ref().expect("an arm").corrected_arm().expect("an arm");
    arm.actual(joints).expect("so many").matrix()
}

fn shift(x: f64, y: f64, z: f64) -> Matrix4<f64> {
    Matrix4::new_translation(&Vector3::new(x, y, z))
}

fn turn(axis: Vector3<f64>, angle: f64) -> Matrix4<f64> {
    Rotation3::from_scaled_axis(axis * angle).to_homogeneous()
}

fn placed([x, y, z, roll, pitch, yaw]: [f64; 6]) -> Matrix4<f64> {
    shift(x, y, z) * turn(Vector3::z(), yaw) * turn(Vector3::y(), pitch) * turn(Vector3::x(), roll)
}

fn numbers<const N: usize>(words: &str, separator: char) -> [f64; N] {
    let numbers: Vec<f64> = words.split(separator).map(|word| word.trim().parse().expect("a number")).collect();
    numbers.try_into().expect("so many numbers")
}

/// The numbers behind a word at the end of a comment.
fn in_comment(text: &str, words: &str) -> [f64; 6] {
    let line = text.lines().find(|line| line.contains(words)).unwrap_or_else(|| panic!("{words} not in {text}"));
    numbers(line.rsplit_once(": ").expect("numbers").1, ' ')
}

/// `base_from_tip` of a kinematics file as the robot description composes it.
fn by_kinematics(text: &str, joints: &[f64]) -> Matrix4<f64> {
    let mut links: BTreeMap<&str, [f64; 6]> = BTreeMap::new();
    let mut link = "";
    for line in text.lines().filter(|line| !line.starts_with('#')) {
        let (key, value) = line.trim().split_once(':').expect("a key");
        let at = ["x", "y", "z", "roll", "pitch", "yaw"].iter().position(|known| *known == key);
        match at {
            Some(at) => links.get_mut(link).expect("a link")[at] = value.trim().parse().expect("a number"),
            None if value.trim().is_empty() && key != "kinematics" => {
                link = key;
                links.insert(link, [f64::NAN; 6]);
            }
            None => {}
        }
    }
    // base_link carries base_link_inertia and base, each turned by half a turn.
    let half_turn = turn(Vector3::z(), std::f64::consts::PI);
    let mut base_link_from_link = half_turn;
    for (link, angle) in ["shoulder", "upper_arm", "forearm", "wrist_1", "wrist_2", "wrist_3"].iter().zip(joints) {
        base_link_from_link *= placed(links[link]) * turn(Vector3::z(), *angle);
    }
    let base_link_from_base = half_turn;
    let base_from_tool0 = base_link_from_base.try_inverse().expect("a turn") * base_link_from_link;
    placed(in_comment(text, "# base in the base"))
        * base_from_tool0
        * placed(in_comment(text, "# TCP of reported poses in tool0: "))
}

/// `base_from_tip` of a table, row by row.
fn by_rows(text: &str, joints: &[f64]) -> Matrix4<f64> {
    let mut lines = text.lines().filter(|line| !line.starts_with('#'));
    assert_eq!(lines.next(), Some("joint,a_m,alpha_rad,d_m,theta_offset_rad,beta_rad"));
    lines.fold(Matrix4::identity(), |before, line| {
        let (name, rest) = line.split_once(',').expect("a row");
        let q = name.parse::<usize>().map_or(0.0, |joint| joints[joint - 1]);
        let [a, alpha, d, theta, beta] = numbers(rest, ',');
        let along = turn(Vector3::z(), q + theta) * shift(0.0, 0.0, d) * shift(a, 0.0, 0.0);
        before * along * turn(Vector3::x(), alpha) * turn(Vector3::y(), beta)
    })
}

fn by_urdf(text: &str, joints: &[f64]) -> Matrix4<f64> {
    let arm = Urdf::parse(text, "arm.urdf").expect("URDF").arm(None, None).expect("an arm");
    arm.forward(joints).expect("so many").matrix()
}

fn same(what: &str, got: &Matrix4<f64>, expected: &Matrix4<f64>) {
    let off = (got - expected).amax();
    assert!(off < NEAR, "{what} is off by {off:e}: {got}{expected}");
}

/// Arms of every shape that errors are estimated for, at a place and with a tool.
fn arms() -> Vec<(&'static str, Arm)> {
    let mount = nalgebra::Isometry3::new([0.3, -0.2, 0.8].into(), [0.1, -0.4, 2.0].into());
    let tool = nalgebra::Isometry3::new([0.01, 0.02, 0.15].into(), [0.6, 0.1, -0.3].into());
    let file = |file: testing::ArmFile| (file.name, file.arm().expect("an arm"));
    let mut arms: Vec<(&str, Arm)> = ArmKind::ALL.iter().map(|kind| (kind.name(), kind.arm())).collect();
    arms.extend([file(testing::UR5), file(testing::PANDA), file(testing::XARM6)]);
    let mounted: Vec<_> = arms.iter().map(|(name, arm)| (*name, arm.clone().mounted(mount, tool))).collect();
    arms.into_iter().chain(mounted).collect()
}

#[test]
fn the_files_of_every_arm_have_its_corrected_kinematics() {
    for (name, arm) in arms() {
        let result = with_arm(&arm, |k| 5e-3 * ((k * k) as f64 + 1.0).sin());
        for by in [0.0, 0.9, 2.3, 4.1] {
            let joints: Vec<f64> = (0..arm.joint_count()).map(|j| 2.8 * (by * (j as f64 + 1.0)).sin()).collect();
            let expected = actual(&result, &joints);
            same(name, &by_urdf(&text_of("arm_urdf", "my_cell_arm.urdf", &result), &joints), &expected);
            same(name, &by_rows(&text_of("dh_table", "my_cell_dh.csv", &result), &joints), &expected);
            let nominal = arm.forward(&joints).expect("so many").matrix();
            assert!((nominal - expected).amax() > 1e-4, "{name}: the errors are seen");
        }
    }
}

#[test]
fn arms_of_universal_robots_have_their_kinematics_in_the_frames_of_the_driver() {
    let is_ur = |name: &str| UR_KINDS.iter().any(|kind| kind.name() == name);
    let mut found = 0;
    for (name, arm) in arms().into_iter().filter(|(name, _)| is_ur(name)) {
        let result = with_arm(&arm, |k| 5e-3 * ((k * k) as f64 + 1.0).sin());
        let text = text_of("ur_kinematics", "my_cell_kinematics.yaml", &result);
        for by in [0.0, 0.9, 2.3, 4.1] {
            let joints: Vec<f64> = (0..6).map(|j| 2.8 * (by * (f64::from(j) + 1.0)).sin()).collect();
            same(name, &by_kinematics(&text, &joints), &actual(&result, &joints));
        }
        found += 1;
    }
    assert_eq!(found, 2 * UR_KINDS.len() + 2, "and the UR5 of a URDF file");
}

#[test]
fn an_exact_arm_of_universal_robots_has_the_nominal_numbers_of_its_description() {
    // Shoulder z; upper_arm roll; forearm x; wrist_1 x, z; wrist_2 y, roll; wrist_3 y and its half turns.
    let quarter = std::f64::consts::FRAC_PI_2;
    let expected = [
        [0.0, 0.0, 0.1625, 0.0, 0.0, 0.0],
        [0.0, 0.0, 0.0, quarter, 0.0, 0.0],
        [-0.425, 0.0, 0.0, 0.0, 0.0, 0.0],
        [-0.3922, 0.0, 0.1333, 0.0, 0.0, 0.0],
        [0.0, -0.0997, 0.0, quarter, 0.0, 0.0],
        [0.0, 0.0996, 0.0, quarter, std::f64::consts::PI, std::f64::consts::PI],
    ];
    let text = text_of("ur_kinematics", "my_cell_kinematics.yaml", &with_arm(&ArmKind::Ur5e.arm(), |_| 0.0));
    let yaml = yaml::Yaml::parse(&text).expect("YAML");
    for (link, expected) in ["shoulder", "upper_arm", "forearm", "wrist_1", "wrist_2", "wrist_3"].iter().zip(expected) {
        let number = |key: &&str| yaml.number(&format!("kinematics.{link}.{key}")).expect("a number");
        let got: Vec<f64> = ["x", "y", "z", "roll", "pitch", "yaw"].iter().map(number).collect();
        same(link, &placed(got.try_into().expect("six")), &placed(expected));
    }
    assert!(
        in_comment(&text, "# base in the base")
            .iter()
            .chain(&in_comment(&text, "# TCP of reported poses in tool0: "))
            .all(|v| v.abs() < NEAR),
        "{text}"
    );
    let hash = text.lines().find_map(|line| line.strip_prefix("  hash: calib_")).expect("a hash");
    assert!(hash.parse::<u64>().is_ok(), "{hash}");
    let other = text_of("ur_kinematics", "my_cell_kinematics.yaml", &with_arm(&ArmKind::Ur5e.arm(), |_| 1e-6));
    assert!(!other.contains(hash), "another arm has another hash");
}

#[test]
fn the_rows_of_an_exact_arm_are_those_of_its_maker() {
    let text = text_of("dh_table", "my_cell_dh.csv", &with_arm(&ArmKind::Ur10e.arm(), |_| 0.0));
    let rows: Vec<[f64; 5]> =
        text.lines().skip(2).map(|line| numbers(line.split_once(',').expect("a row").1, ',')).collect();
    let is_near = |got: &[f64; 5], expected: &[f64; 5]| got.iter().zip(expected).all(|(a, b)| (a - b).abs() < NEAR);
    assert_eq!(rows.len(), 8);
    for (got, row) in rows[1..7].iter().zip(ArmKind::Ur10e.rows()) {
        assert!(is_near(got, &[row.a_m, row.alpha_rad, row.d_m, row.theta_offset_rad, 0.0]), "{got:?} {row:?}");
    }
    assert!(is_near(&rows[0], &[0.0; 5]) && is_near(&rows[7], &[0.0; 5]), "{rows:?}");
}

#[test]
fn axes_that_are_nearly_parallel_stay_where_they_are_and_have_the_angle_of_hayati() {
    // One milliradian between axes 2 and 3 has their common normal hundreds of metres away.
    let text =
        text_of("dh_table", "my_cell_dh.csv", &with_arm(&ArmKind::Ur5e.arm(), |k| if k == 4 { 1e-3 } else { 0.0 }));
    let rows: Vec<[f64; 5]> =
        text.lines().skip(2).map(|line| numbers(line.split_once(',').expect("a row").1, ',')).collect();
    assert!(rows.iter().flatten().all(|value| value.abs() < 2.0), "{text}");
    assert!(rows.iter().any(|row| (row[4].abs() - 1e-3).abs() < 1e-6), "{text}");
}

#[test]
fn an_arm_that_is_not_known_or_contradicted_or_another_is_refused_with_what_to_do() {
    let names = ExportNames::default();
    let refused = |format: &str, result: &CalibrationResult| {
        preview(by_name(format).expect("known"), &ExportInput::new(result, &names)).expect_err("refused")
    };
    let contradicted = {
        let mut result = golden();
        result.arm.as_mut().expect("golden").contradicted = true;
        result
    };
    for format in ["arm_urdf", "ur_kinematics", "dh_table"] {
        let error = refused(format, &CalibrationResult { arm: None, ..golden() });
        assert!(matches!(error, ExportError::NeedsArm { .. }) && error.to_string().contains("[robot.arm]"), "{error}");
        let error = refused(format, &contradicted);
        assert!(matches!(error, ExportError::ArmContradicted { .. }) && error.is_bad_input(), "{error}");
    }
    for (arm, why) in [
        (testing::PANDA.arm().expect("an arm"), "six joints"),
        (testing::XARM6.arm().expect("an arm"), "-x|axes"),
        (ArmKind::Ur5Coppeliasim.arm(), "-x"),
    ] {
        let error = refused("ur_kinematics", &with_arm(&arm, |_| 1e-3));
        assert!(matches!(error, ExportError::OtherArm { .. }), "{error}");
        assert!(why.split('|').any(|why| error.to_string().contains(why)), "{error}");
        assert!(error.to_string().contains("Export arm_urdf or dh_table"), "{error}");
    }
}

#[test]
fn what_no_fixed_chain_has_is_said_with_its_size() {
    let files = [
        ("arm_urdf", "my_cell_arm.urdf"),
        ("ur_kinematics", "my_cell_kinematics.yaml"),
        ("dh_table", "my_cell_dh.csv"),
    ];
    for (with_field, (chain, fit)) in [(false, golden_arm()), (true, golden_arm_with_a_field())] {
        let fit = ArmFit { noise: Noise { field_m: 4e-4, ..fit.noise }, ..fit };
        let arm = ArmEstimate::new(&chain, &fit, [0.0, 0.0, 0.1]);
        let result = CalibrationResult { arm, ..golden() };
        for (format, name) in files {
            let text = text_of(format, name, &result);
            assert!(text.contains("Compliance under gravity is not in it."), "{format}: {text}");
            assert_eq!(text.contains("changes with the place of the tip, typically 0.400 mm"), with_field, "{format}");
        }
    }
}

#[test]
fn the_description_of_the_arm_says_what_it_is_and_keeps_names_and_limits() {
    let text = text_of("arm_urdf", "my_cell_arm.urdf", &golden());
    let first = text.lines().nth(1).expect("a comment");
    for words in
        ["T_base_link_tool0 of the corrected arm", "Compliance under gravity is not in it", "not to the plain one"]
    {
        assert!(first.contains(words), "{first}");
    }
    let arm = Urdf::parse(&text, "arm.urdf").expect("URDF").arm(Some("base_link"), Some("tool0")).expect("an arm");
    let own = ArmKind::Ur5e.arm();
    assert_eq!(arm.ranges(), own.ranges());
    assert!(arm.joints().iter().zip(own.joints()).all(|(a, b)| a.name == b.name));
    // The last joint of the smallest arms turns without end.
    let text = text_of("arm_urdf", "my_cell_arm.urdf", &with_arm(&ArmKind::Ur3e.arm(), |_| 1e-3));
    let arm = Urdf::parse(&text, "arm.urdf").expect("URDF").arm(None, None).expect("an arm");
    assert_eq!(arm.ranges(), ArmKind::Ur3e.arm().ranges());
    // A link of the arm does not take the name of a frame.
    let names = ExportNames { base_frame: "link_2".into(), effector_frame: "link_2_".into(), ..ExportNames::default() };
    let text = file_of("arm_urdf", "my_cell_arm.urdf", &golden(), &names, &[]).text;
    assert!(Urdf::parse(&text, "arm.urdf").expect("URDF").arm(Some("link_2"), Some("link_2_")).is_ok(), "{text}");
}

proptest! {
    #[test]
    fn random_errors_of_a_random_arm_are_in_all_three_files(
        kind in 0..UR_KINDS.len(),
        errors in prop::collection::vec(-0.02..0.02_f64, 29),
        joints in prop::array::uniform6(-6.0..6.0_f64),
    ) {
        let result = with_arm(&UR_KINDS[kind].arm(), |k| errors[k]);
        let expected = actual(&result, &joints);
        for (got, what) in [
            (by_urdf(&text_of("arm_urdf", "my_cell_arm.urdf", &result), &joints), "arm_urdf"),
            (by_rows(&text_of("dh_table", "my_cell_dh.csv", &result), &joints), "dh_table"),
            (by_kinematics(&text_of("ur_kinematics", "my_cell_kinematics.yaml", &result), &joints), "ur_kinematics"),
        ] {
            prop_assert!((got - expected).amax() < NEAR, "{}: {}{}", what, got, expected);
        }
    }
}
