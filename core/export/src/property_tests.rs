//! Laws of the exports: every rotation survives its angles, every calibration its file, and no wrong number passes.

use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};
use proptest::prelude::*;

use super::*;
use handeye_estimate::ArmFit;
use handeye_estimate::handeye::HandEye;
use handeye_estimate::handeye::joint::{ArmErrors, arm_parameters};
use handeye_geometry::camera::{Distortion, Intrinsics};
use handeye_geometry::frames::Pose;
use handeye_result::testing::golden_arm;
use handeye_result::{ArmEstimate, CalibrationResult, IntrinsicsEstimate, Quality};

/// Splits a text at its numbers: text, number, text, number, …, text. Digits in words are text.
pub(super) fn split_numbers(text: &str) -> Vec<String> {
    let chars: Vec<char> = text.chars().collect();
    let mut parts = vec![String::new()];
    let mut at = 0;
    while at < chars.len() {
        let behind_word = at > 0 && (chars[at - 1].is_ascii_alphanumeric() || "_.)".contains(chars[at - 1]));
        let signed = usize::from(chars[at] == '-');
        let is_start = !behind_word && chars.get(at + signed).is_some_and(char::is_ascii_digit);
        let end = chars[at..].iter().position(|c| !(c.is_ascii_alphanumeric() || "+-._".contains(*c)));
        let word: String = chars[at..end.map_or(chars.len(), |n| at + n)].iter().collect();
        if is_start && word.parse::<f64>().is_ok() {
            at += word.len();
            parts.extend([word, String::new()]);
            continue;
        }
        let last = parts.last_mut().expect("never empty");
        last.push(chars[at]);
        at += 1;
    }
    parts
}

/// Places of the numbers in a file that are not in a comment, as (line, part of [`split_numbers`]).
fn numbers_in(text: &str) -> Vec<(usize, usize)> {
    let mut found = Vec::new();
    for (number, line) in text.lines().enumerate() {
        let trimmed = line.trim_start();
        // The comment of the launch file is there for its numbers; those of commands in scripts are as well.
        let is_payload = trimmed.contains("rpy=\"") || trimmed.starts_with("# ros");
        let is_comment = ["#", "%", "<!--", "<?xml"].iter().any(|start| trimmed.starts_with(start));
        if is_payload || !is_comment {
            found.extend((1..split_numbers(line).len()).step_by(2).map(|part| (number, part)));
        }
    }
    found
}

/// The file with one number changed by a millionth of the unit it is in.
fn with_wrong_number(file: &ExportFile, (line, part): (usize, usize)) -> ExportFile {
    let mut lines: Vec<String> = file.text.lines().map(str::to_owned).collect();
    let mut parts = split_numbers(&lines[line]);
    let value: f64 = parts[part].parse().expect("a number");
    parts[part] = text::number(value + 1e-6);
    lines[line] = parts.concat();
    ExportFile { name: file.name.clone(), text: lines.join("\n") + "\n" }
}

fn rotations() -> impl Strategy<Value = UnitQuaternion<f64>> {
    let anywhere = (prop::array::uniform3(-1.0..1.0), 0.0..std::f64::consts::TAU).prop_map(|(axis, angle)| {
        Vector3::from(axis)
            .try_normalize(1e-3)
            .map_or_else(UnitQuaternion::identity, |axis| UnitQuaternion::from_scaled_axis(axis * angle))
    });
    // At and near gimbal lock, where one of two angles is arbitrary.
    let locked = (-3.2..3.2, prop::bool::ANY, -20.0..-1.0, -3.2..3.2).prop_map(|(roll, up, off, yaw)| {
        let pitch = std::f64::consts::FRAC_PI_2 - f64::powf(10.0, off);
        rotation::from_rpy([roll, if up { pitch } else { -pitch }, yaw])
    });
    let quarter_turns = prop::array::uniform3(-2..3_i32)
        .prop_map(|turns| rotation::from_rpy(turns.map(|n| f64::from(n) * std::f64::consts::FRAC_PI_2)));
    prop_oneof![2 => anywhere, 2 => locked, 1 => quarter_turns]
}

fn isometries() -> impl Strategy<Value = Isometry3<f64>> {
    (prop::array::uniform3(-2.0..2.0), rotations())
        .prop_map(|(t, rotation)| Isometry3::from_parts(Translation3::from(t), rotation))
}

fn lenses() -> impl Strategy<Value = Distortion> {
    let c = || -0.3..0.3_f64;
    prop_oneof![
        Just(Distortion::None),
        prop::array::uniform5(c()).prop_map(Distortion::BrownConrady),
        prop::array::uniform4(c()).prop_map(|[k1, k2, p1, p2]| Distortion::BrownConrady([k1, k2, p1, p2, 0.0])),
        prop::array::uniform8(c()).prop_map(Distortion::Rational),
        prop::array::uniform4(c()).prop_map(Distortion::Fisheye),
    ]
}

/// An arm of Universal Robots with errors, at a place and with a tool.
fn arms() -> impl Strategy<Value = ArmEstimate> {
    let errors = prop::collection::vec(-0.02..0.02_f64, arm_parameters(6).len());
    (errors, isometries(), isometries()).prop_map(|(values, mount, tool)| {
        let (chain, fit) = golden_arm();
        let fit = ArmFit { errors: ArmErrors::new(6, values).expect("so many"), ..fit };
        ArmEstimate::new(&chain.mounted(mount, tool), &fit, [0.0, 0.0, 0.1]).expect("six joints")
    })
}

/// Formats about the arm.
const ABOUT_ARMS: [&str; 3] = ["arm_urdf", "ur_kinematics", "dh_table"];

/// A calibration with names and views.
type Case = (CalibrationResult, ExportNames, Vec<ExportView>);

fn cases() -> impl Strategy<Value = Case> {
    let camera = (100.0..3000.0_f64, 100.0..3000.0_f64, 0.0..2000.0_f64, 0.0..2000.0_f64, lenses());
    let link = prop::option::of(isometries());
    let views = prop::collection::vec(isometries(), 1..4);
    (isometries(), isometries(), prop::bool::ANY, camera, link, views, arms()).prop_map(
        |(hand_eye, target, in_hand, (fx, fy, cx, cy, distortion), link, views, arm)| {
            let mut result = CalibrationResult { arm: Some(arm), ..CalibrationResult::default() };
            result.set_links(
                &if in_hand {
                    HandEye::EyeInHand { tip_from_camera: hand_eye.into(), base_from_target: target.into() }
                } else {
                    HandEye::EyeToHand { base_from_camera: hand_eye.into(), tip_from_target: target.into() }
                },
                None,
                None,
            );
            let k = Intrinsics { width: 1920, height: 1080, fx, fy, cx, cy, distortion };
            result.intrinsics = Some(IntrinsicsEstimate::new(&k, None, false));
            result.quality = Quality { rms_px: Some(cx / 1e3), ..Quality::default() };
            let camera_link = link.map(|link| {
                let link =
                    Pose::<handeye_geometry::frames::Mount, handeye_geometry::frames::Camera>::from_isometry(link);
                CameraLink {
                    translation_m: link.translation().into(),
                    rotation_xyzw: link.xyzw(),
                    ..CameraLink::default()
                }
            });
            let names = ExportNames { camera_link, ..ExportNames::default() };
            let view = |(i, pose): (usize, Isometry3<f64>)| ExportView {
                name: format!("images/{}.png", ["a", "b", "c"][i]),
                base_from_tip: pose.into(),
            };
            (result, names, views.into_iter().enumerate().map(view).collect())
        },
    )
}

proptest! {
    #[test]
    fn roll_pitch_yaw_give_the_rotation_back_at_gimbal_lock_too(rotation in rotations()) {
        let angles = rotation::rpy(&rotation);
        prop_assert!(angles[1].abs() <= std::f64::consts::FRAC_PI_2);
        let again = rotation::from_rpy(angles);
        let off = (rotation.to_rotation_matrix().into_inner() - again.to_rotation_matrix().into_inner()).amax();
        prop_assert!(off < 1e-11, "{:?} is off by {off:e}", angles);
    }

    #[test]
    fn every_format_reads_back_what_it_writes_and_sees_every_wrong_number((result, names, views) in cases()) {
        let with_arm = ExportInput { result: &result, names: &names, views: &views };
        // The axis of a joint may have any length there, and is the same.
        let without_arm = CalibrationResult { arm: None, ..result.clone() };
        let without_arm = ExportInput { result: &without_arm, ..with_arm };
        let lens = result.intrinsics.as_ref().map(|i| i.model.clone()).unwrap_or_default();
        for format in formats() {
            let input = if format.name() == "json" { without_arm } else { with_arm };
            let files = match preview(*format, &input) {
                Ok(files) => files,
                Err(ExportError::NeedsModel { model, .. }) => {
                    prop_assert_eq!(model, lens.as_str());
                    continue;
                }
                Err(ExportError::NeedsMovingCamera { .. }) => continue,
                Err(error) => return Err(TestCaseError::fail(format!("{}: {error}", format.name()))),
            };
            for file in files {
                let compared = format.compare(&file, &input);
                prop_assert!(compared.is_ok(), "{}: {compared:?}\n{}", format.name(), file.text);
                // A file of an arm has ten times the numbers of another: some of them in every case.
                let step = if ABOUT_ARMS.contains(&format.name()) { 16 } else { 1 };
                let first = (1e3 * views[0].base_from_tip.translation().x.abs()) as usize % step;
                for number in numbers_in(&file.text).into_iter().skip(first).step_by(step) {
                    let wrong = with_wrong_number(&file, number);
                    prop_assert!(
                        format.compare(&wrong, &input).is_err(),
                        "{} line {} part {}:\n{}", format.name(), number.0 + 1, number.1, wrong.text
                    );
                }
            }
        }
    }
}
