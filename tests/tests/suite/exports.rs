//! Every export, read by the programs that it is meant for.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use handeye_dataset::write;
use handeye_estimate::handeye::HandEye;
use handeye_export::{CameraLink, ExportInput, ExportNames, ExportView};
use handeye_geometry::camera::{Distortion, Intrinsics};
use handeye_geometry::frames::{Base, Pose, Target, Tip};
use handeye_geometry::testing::python;
use handeye_result::testing::golden_arm;
use handeye_result::{ArmEstimate, CalibrationResult, IntrinsicsEstimate, Quality};
use handeye_tests::{handeye_binary, workspace_root};
use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};
use serde_json::json;

/// Tip to camera of the calibration that `docs/reference/exports.md` shows.
const GOLDEN_M: [f64; 3] = [0.045, -0.032, 0.061];
const GOLDEN_XYZW: [f64; 4] = [0.195832126, 0.036412615, 0.644503346, 0.738200065];

fn result_of(links: &HandEye, distortion: Distortion) -> CalibrationResult {
    let (chain, fit) = golden_arm();
    // The robot of a fixed camera is on a table, with a tool.
    let on_a_table = chain.clone().mounted(gimbal_lock(1.0, 0.3), golden());
    let chain = if matches!(links, HandEye::EyeInHand { .. }) { chain } else { on_a_table };
    let mut result =
        CalibrationResult { arm: ArmEstimate::new(&chain, &fit, [0.0, 0.0, 0.1]), ..CalibrationResult::default() };
    result.set_links(links, None, None);
    let k = Intrinsics { width: 1280, height: 720, fx: 912.4, fy: 911.8, cx: 640.7, cy: 361.2, distortion };
    result.intrinsics = Some(IntrinsicsEstimate::new(&k, None, false));
    result.quality = Quality { rms_px: Some(0.31), ..Quality::default() };
    "0.1.0".clone_into(&mut result.provenance.tool_version);
    result.provenance.input_sha256 = Some("00ff".repeat(16));
    result
}

fn in_hand(tip_from_camera: Isometry3<f64>) -> HandEye {
    let base_from_target = Pose::<Base, Target>::from_translation_xyzw([0.4, -0.1, 0.02], [0.0, 0.6, 0.0, -0.8]);
    HandEye::EyeInHand { tip_from_camera: tip_from_camera.into(), base_from_target }
}

fn golden() -> Isometry3<f64> {
    *Pose::<Tip, Base>::from_translation_xyzw(GOLDEN_M, GOLDEN_XYZW).isometry()
}

/// A rotation about y by ±90°, where roll and yaw rotate about one axis, after a rotation about x.
fn gimbal_lock(sign: f64, off_rad: f64) -> Isometry3<f64> {
    let pitch = UnitQuaternion::from_axis_angle(&Vector3::y_axis(), sign * (std::f64::consts::FRAC_PI_2 - off_rad));
    let turn = |axis, angle| UnitQuaternion::from_axis_angle(&axis, angle);
    let rotation = turn(Vector3::z_axis(), 2.5) * pitch * turn(Vector3::x_axis(), 0.7);
    Isometry3::from_parts(Translation3::new(0.1, 0.0, -0.2), rotation)
}

fn views() -> Vec<ExportView> {
    let view = |i: u32| {
        let angle = Vector3::new(2.9, 0.2 * f64::from(i), -0.3 * f64::from(i));
        let translation = Translation3::new(0.42 - 0.1 * f64::from(i), -0.11, 0.55);
        let pose = Isometry3::from_parts(translation, UnitQuaternion::from_scaled_axis(angle));
        ExportView { name: format!("images/{i:04}.png"), base_from_tip: pose.into() }
    };
    (1..=4).map(view).collect()
}

/// Writes every format that can hold a calibration, with what the readers need. Returns the formats.
fn write_case(folder: &Path, result: &CalibrationResult, names: &ExportNames) -> Vec<&'static str> {
    let views = views();
    let input = ExportInput { result, names, views: &views };
    let formats: Vec<_> = handeye_export::formats()
        .iter()
        .copied()
        .filter(|format| handeye_export::preview(*format, &input).is_ok())
        .collect();
    handeye_export::write_all(&folder.join("exports"), &formats, &input).unwrap_or_else(|error| panic!("{error}"));
    let poses: Vec<_> = views
        .iter()
        .map(|v| {
            let t: [f64; 3] = v.base_from_tip.translation().into();
            json!({"name": v.name, "translation_m": t, "rotation_xyzw": v.base_from_tip.xyzw()})
        })
        .collect();
    let context = json!({"names": names, "views": poses});
    std::fs::write(folder.join("context.json"), context.to_string()).expect("written");
    result.write(&folder.join("result.json")).expect("written");
    formats.iter().map(|format| format.name()).collect()
}

fn read_with_python(arguments: &[&Path]) {
    let Some(python) = python() else { return };
    let output = Command::new(python)
        .arg(workspace_root().join("tests/python/read_exports.py"))
        .args(arguments)
        .output()
        .expect("python runs");
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    assert!(output.status.success(), "{}{}", text(&output.stdout), text(&output.stderr));
    println!("{}", text(&output.stdout).lines().last().unwrap_or_default());
}

#[test]
fn the_readers_of_every_format_find_the_calibration_in_it() {
    let folder = tempfile::tempdir().expect("a folder");
    let lenses = [
        ("none", Distortion::None),
        ("without_k3", Distortion::BrownConrady([0.082, -0.191, 0.0006, -0.0004, 0.0])),
        ("brown_conrady", Distortion::BrownConrady([0.082, -0.191, 0.0006, -0.0004, 0.05])),
        ("rational", Distortion::Rational([0.1, -0.2, 1e-7, -4e-4, 0.03, 0.25, 1.0 / 3.0, 0.01])),
        ("fisheye", Distortion::Fisheye([0.1, -0.02, 0.003, -4e-8])),
    ];
    let base_from_camera = Isometry3::from_parts(
        Translation3::new(1.0, 0.25, 0.5),
        UnitQuaternion::from_quaternion(nalgebra::Quaternion::new(-0.5, 0.5, -0.5, 0.5)),
    );
    let to_hand = HandEye::EyeToHand {
        base_from_camera: base_from_camera.into(),
        tip_from_target: Pose::<Tip, Target>::from_translation_xyzw([0.0, 0.01, 0.1], [0.1, 0.2, 0.3, 0.9]),
    };
    let mut cases: Vec<(String, HandEye, Distortion)> = Vec::new();
    for (name, lens) in lenses {
        cases.push((format!("eye_in_hand_{name}"), in_hand(golden()), lens));
        cases.push((format!("eye_to_hand_{name}"), to_hand, lens));
    }
    for (sign, off) in [(1.0, 0.0), (-1.0, 0.0), (1.0, 1e-9), (-1.0, 1e-7)] {
        cases.push((format!("gimbal_lock_{sign}_{off:e}"), in_hand(gimbal_lock(sign, off)), lenses[1].1));
    }
    let link = CameraLink { frame: "camera_body".into(), translation_m: [0.0, 0.015, 0.0], ..CameraLink::default() };
    let plain = ExportNames::default();
    let linked = ExportNames {
        calibration: "cell-2.left".into(),
        base_frame: "world/base".into(),
        effector_frame: "on".into(),
        camera_name: "1e3".into(),
        camera_link: Some(link),
        ..ExportNames::default()
    };
    let mut seen = BTreeSet::new();
    for (name, links, lens) in &cases {
        for (suffix, names) in [("", &plain), ("_linked", &linked)] {
            let case = folder.path().join(format!("{name}{suffix}"));
            std::fs::create_dir(&case).expect("a folder");
            seen.extend(write_case(&case, &result_of(links, *lens), names));
        }
    }
    let all: BTreeSet<_> = handeye_export::formats().iter().map(|format| format.name()).collect();
    assert_eq!(seen, all, "a format was never written");
    read_with_python(&[Path::new("--cases"), folder.path()]);
}

/// A dataset of poses alone, with a result in it.
fn solved_dataset(folder: &Path) -> PathBuf {
    let dataset = folder.join("dataset");
    std::fs::create_dir(&dataset).expect("a folder");
    std::fs::write(
        dataset.join("dataset.toml"),
        r#"
mode = "eye_in_hand"
[target]
kind = "chessboard"
columns = 4
rows = 3
square_m = 0.03
poses = "target_poses.csv"
[robot]
poses = "poses.csv"
length_unit = "m"
rotation = "quaternion_xyzw"
pose = "base_from_tip"
"#,
    )
    .expect("written");
    let views = views();
    let table = write::pose_table(views.iter().map(|view| (view.name.as_str(), &view.base_from_tip)));
    std::fs::write(dataset.join("target_poses.csv"), &table).expect("written");
    std::fs::write(dataset.join(write::POSE_TABLE), table).expect("written");
    let lens = Distortion::BrownConrady([0.082, -0.191, 0.0006, -0.0004, 0.0]);
    result_of(&in_hand(golden()), lens).write(&dataset.join("result.json")).expect("written");
    dataset
}

fn handeye_export(path: &Path, out: &Path, arguments: &[&str]) -> Output {
    let mut command = Command::new(handeye_binary());
    command.arg("export").arg(path).args(arguments).arg("--out").arg(out);
    command.output().expect("the binary is built: cargo build -p handeye_app")
}

#[test]
fn the_command_line_exports_poses_of_images_from_a_dataset_folder() {
    let folder = tempfile::tempdir().expect("a folder");
    let dataset = solved_dataset(folder.path());
    let out = folder.path().join("out");
    let output = handeye_export(&dataset, &out, &["--format", "colmap", "nerfstudio"]);
    assert_eq!(output.status.code(), Some(0), "{}", String::from_utf8_lossy(&output.stderr));
    assert_eq!(String::from_utf8_lossy(&output.stdout).lines().count(), 4);
    let images = std::fs::read_to_string(out.join("images.txt")).expect("images");
    assert_eq!(images.matches(".png").count(), views().len(), "{images}");

    // The same from the result file in that folder; on its own the file has no poses.
    let output = handeye_export(&dataset.join("result.json"), &out, &["--format", "colmap"]);
    assert_eq!(output.status.code(), Some(0), "{}", String::from_utf8_lossy(&output.stderr));
    let alone = folder.path().join("alone.json");
    std::fs::copy(dataset.join("result.json"), &alone).expect("copied");
    let output = handeye_export(&alone, &out, &["--format", "colmap"]);
    let message = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(2), "{message}");
    assert!(message.contains("no robot poses are given"), "{message}");
}

#[test]
fn names_of_the_command_line_are_those_in_the_files() {
    let folder = tempfile::tempdir().expect("a folder");
    let dataset = solved_dataset(folder.path());
    let out = folder.path().join("out");
    let arguments = [
        "--format",
        "easy_handeye2",
        "ros_camera_info",
        "urdf",
        "--name",
        "cell7",
        "--base-frame",
        "world",
        "--effector-frame",
        "flange",
        "--camera-frame",
        "lens",
        "--target-frame",
        "plate",
        "--camera-name",
        "left",
        "--camera-link",
        "body:0,0.015,0",
    ];
    let output = handeye_export(&dataset, &out, &arguments);
    assert_eq!(output.status.code(), Some(0), "{}", String::from_utf8_lossy(&output.stderr));
    let text = |name: &str| std::fs::read_to_string(out.join(name)).expect("a file");
    let calib = text("cell7.calib");
    for line in ["robot_base_frame: world", "robot_effector_frame: flange", "tracking_base_frame: body", "frame: plate"]
    {
        assert!(calib.contains(line), "{calib}");
    }
    assert!(text("camera_info.yaml").contains("camera_name: left"));
    assert!(text("cell7.urdf").contains("rpy=\"-2.6076929"), "{}", text("cell7.urdf"));

    let output = handeye_export(&dataset, &out, &["--format", "urdf", "--camera-link", "body:1,2"]);
    assert_eq!(output.status.code(), Some(2));
}
