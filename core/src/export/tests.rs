use super::*;
use crate::camera::Distortion;
use crate::result::IntrinsicsEstimate;
use crate::result::tests::{eye_to_hand, golden, golden_intrinsics, intrinsics_only, pose_pairs_only};

fn render(name: &str, result: &CalibrationResult) -> Result<ExportFile, ExportError> {
    let files = by_name(name)?.render(result, &ExportNames::default())?;
    assert_eq!(files.len(), 1);
    Ok(files.into_iter().next().expect("a file"))
}

fn with_lens(distortion: Distortion) -> CalibrationResult {
    let k = Intrinsics { distortion, ..golden_intrinsics() };
    CalibrationResult { intrinsics: Some(IntrinsicsEstimate::new(&k, None, true)), ..golden() }
}

/// Numbers of the file behind a key, up to the next line without one.
fn numbers_of(text: &str, path: &str) -> Vec<f64> {
    yaml::Yaml::parse(text).and_then(|y| y.numbers(path)).unwrap_or_else(|e| panic!("{e}\n{text}"))
}

/// The matrix that belongs to the quaternion and the rpy angles of the golden calibration, by an independent program.
const GOLDEN_MATRIX: [f64; 16] = [
    0.166579116,
    -0.937283305,
    0.306188511,
    0.045,
    0.965806345,
    0.092530430,
    -0.242190471,
    -0.032,
    0.198669331,
    0.336062681,
    0.920647800,
    0.061,
    0.0,
    0.0,
    0.0,
    1.0,
];

#[test]
fn opencv_yaml_of_the_golden_calibration_is_as_other_programs_write_it() {
    let file = render("opencv_yaml", &golden()).expect("a file");
    let lines: Vec<&str> = file.text.lines().collect();
    assert_eq!(lines[..2], ["%YAML:1.0", "---"]);
    assert!(lines[2].starts_with("# T_tool0_camera_color_optical_frame: "), "{}", lines[2]);
    let matrix = numbers_of(&file.text, "T_tool0_camera_color_optical_frame.data");
    // Both are given to nine digits.
    assert!(matrix.iter().zip(GOLDEN_MATRIX).all(|(a, b)| (a - b).abs() < 2e-9), "{matrix:?}");
    assert_eq!(numbers_of(&file.text, "camera_matrix.data"), [912.4, 0.0, 640.7, 0.0, 911.8, 361.2, 0.0, 0.0, 1.0]);
    assert_eq!(numbers_of(&file.text, "distortion_coefficients.data"), [0.082, -0.191, 0.0006, -0.0004, 0.0]);
    assert!(file.text.contains("image_width: 1280\nimage_height: 720\n"), "{}", file.text);
    assert!(file.text.contains("avg_reprojection_error: 0.31\n"));
}

#[test]
fn ros_camera_info_of_the_golden_calibration_is_as_other_programs_write_it() {
    let file = render("ros_camera_info", &golden()).expect("a file");
    let (comment, body) = file.text.split_once('\n').expect("lines");
    assert!(comment.starts_with("# ") && comment.contains("sha256 00ff00ff"), "{comment}");
    let expected = "\
image_width: 1280
image_height: 720
camera_name: camera_color
camera_matrix:
  rows: 3
  cols: 3
  data: [912.4, 0.0, 640.7, 0.0, 911.8, 361.2, 0.0, 0.0, 1.0]
distortion_model: plumb_bob
distortion_coefficients:
  rows: 1
  cols: 5
  data: [0.082, -0.191, 0.0006, -0.0004, 0.0]
rectification_matrix:
  rows: 3
  cols: 3
  data: [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]
projection_matrix:
  rows: 3
  cols: 4
  data: [912.4, 0.0, 640.7, 0.0, 0.0, 911.8, 361.2, 0.0, 0.0, 0.0, 1.0, 0.0]
binning_x: 0
binning_y: 0
roi:
  x_offset: 0
  y_offset: 0
  height: 0
  width: 0
  do_rectify: false
";
    assert_eq!(body, expected);
}

#[test]
fn easy_handeye2_of_the_golden_calibration_is_as_it_writes_itself() {
    let file = render("easy_handeye2", &golden()).expect("a file");
    assert_eq!(file.name, "my_cell.calib");
    let (comment, body) = file.text.split_once('\n').expect("lines");
    assert!(comment.starts_with("# T_tool0_camera_color_optical_frame: "), "{comment}");
    let expected = "\
parameters:
  name: my_cell
  calibration_type: eye_in_hand
  robot_base_frame: base_link
  robot_effector_frame: tool0
  tracking_base_frame: camera_color_optical_frame
  tracking_marker_frame: board
  freehand_robot_movement: true
  move_group_namespace: /
  move_group: manipulator
transform:
  translation:
    x: 0.045
    y: -0.032
    z: 0.061
  rotation:
";
    assert!(body.starts_with(expected), "{body}");
    let yaml = yaml::Yaml::parse(body).expect("YAML");
    for (key, value) in ["x", "y", "z", "w"].into_iter().zip(crate::result::tests::GOLDEN_XYZW) {
        let written = yaml.number(&format!("transform.rotation.{key}")).expect("a number");
        assert!((written - value).abs() < 1e-9, "{key}: {written}");
    }
}

#[test]
fn eye_to_hand_is_seen_from_the_base_and_the_quaternion_turns_to_positive_w() {
    let mut result = eye_to_hand();
    let hand_eye = result.hand_eye.as_mut().expect("a hand-eye");
    hand_eye.rotation_xyzw = hand_eye.rotation_xyzw.map(|v| -v);
    assert!(hand_eye.rotation_xyzw[3] < 0.0);
    let file = render("easy_handeye2", &result).expect("a file");
    assert!(file.text.starts_with("# T_base_link_camera_color_optical_frame: "), "{}", file.text);
    assert!(file.text.contains("calibration_type: eye_on_base"));
    assert!(file.text.ends_with("    x: -0.5\n    y: 0.5\n    z: -0.5\n    w: 0.5\n"), "{}", file.text);
    let file = render("opencv_yaml", &result).expect("a file");
    assert!(file.text.contains("T_base_link_camera_color_optical_frame: !!opencv-matrix"));
}

#[test]
fn every_lens_model_keeps_its_coefficients_under_the_name_of_the_reader() {
    let cases = [
        (Distortion::None, "plumb_bob", vec![0.0; 5]),
        (Distortion::BrownConrady([1., 2., 3., 4., 5.]), "plumb_bob", vec![1., 2., 3., 4., 5.]),
        (
            Distortion::Rational([1., 2., 3., 4., 5., 6., 7., 8.]),
            "rational_polynomial",
            (1..=8).map(f64::from).collect(),
        ),
        (Distortion::Fisheye([1., 2., 3., 4.]), "equidistant", vec![1., 2., 3., 4.]),
    ];
    for (distortion, ros_name, coefficients) in cases {
        let result = with_lens(distortion);
        let ros = render("ros_camera_info", &result).expect("a file").text;
        assert!(ros.contains(&format!("distortion_model: {ros_name}\n")), "{ros}");
        assert_eq!(numbers_of(&ros, "distortion_coefficients.data"), coefficients);
        let opencv = render("opencv_yaml", &result).expect("a file").text;
        assert!(opencv.contains(&format!("distortion_model: {}\n", distortion.name())), "{opencv}");
        assert_eq!(numbers_of(&opencv, "distortion_coefficients.data"), coefficients);
    }
}

#[test]
fn a_format_refuses_a_result_without_what_it_is_about() {
    let error = render("easy_handeye2", &intrinsics_only()).expect_err("no hand-eye");
    assert!(error.to_string().contains("easy_handeye2 is about a hand-eye transform"), "{error}");
    assert!(error.is_bad_input());
    let error = render("ros_camera_info", &pose_pairs_only()).expect_err("no intrinsics");
    assert!(error.to_string().contains("ros_camera_info is about a camera's intrinsics"), "{error}");
    assert!(render("opencv_yaml", &intrinsics_only()).is_ok_and(|f| !f.text.contains("\nT_")));
    assert!(render("opencv_yaml", &pose_pairs_only()).is_ok_and(|f| !f.text.contains("camera_matrix")));
    assert!(render("opencv_yaml", &CalibrationResult::default()).is_err());
    let error = by_name("kalibr").err().expect("unknown").to_string();
    assert!(error.contains("json, ros_camera_info, opencv_yaml, easy_handeye2"), "{error}");
}

#[test]
fn everything_written_reads_back_and_a_wrong_number_does_not() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let out = folder.path().join("new/exports");
    let names = ExportNames { target_frame: "on".into(), camera_name: "1e3".into(), ..ExportNames::default() };
    let mut result = golden();
    result.hand_eye.as_mut().expect("a hand-eye").translation_m = [1e-7, -1.0 / 3.0, 1e22];
    let written = write_all(&out, formats(), &result, &names).unwrap_or_else(|e| panic!("{e}"));
    assert_eq!(written.len(), formats().len());
    let mut other = result.clone();
    other.hand_eye.as_mut().expect("a hand-eye").translation_m[0] += 1e-8;
    other.intrinsics.as_mut().expect("intrinsics").cx += 1e-8;
    for (format, path) in formats().iter().zip(&written) {
        let text = fs::read_to_string(path).expect("text");
        assert_eq!(format.compare(&text, &result, &names), Ok(()), "{}", format.name());
        assert!(format.compare(&text, &other, &names).is_err(), "{}", format.name());
        assert!(format.compare("", &result, &names).is_err(), "{}", format.name());
    }
}

#[test]
fn names_that_would_break_a_file_are_refused_and_nothing_is_written() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    for bad in ["", "a: b", "a\nb", "\"", "#x", "-x", "../up"] {
        let names = ExportNames { calibration: bad.into(), ..ExportNames::default() };
        assert!(matches!(write_all(folder.path(), formats(), &golden(), &names), Err(ExportError::BadName { .. })));
    }
    let refused = write_all(folder.path(), formats(), &intrinsics_only(), &ExportNames::default());
    assert!(matches!(refused, Err(ExportError::NeedsHandEye { .. })));
    assert_eq!(fs::read_dir(folder.path()).expect("list").count(), 0);
}

/// Writes the golden exports where a script with the real readers looks at them.
#[test]
fn golden_exports_are_left_for_the_readers_of_other_programs() {
    let Some(folder) = std::env::var_os("HANDEYE_EXPORTS").map(PathBuf::from) else {
        println!("skipped: HANDEYE_EXPORTS names no folder");
        return;
    };
    let lenses = [
        Distortion::None,
        Distortion::BrownConrady([0.082, -0.191, 0.0006, -0.0004, 0.0]),
        Distortion::Rational([0.1, -0.2, 1e-7, -4e-4, 0.03, 0.25, 1.0 / 3.0, 0.01]),
        Distortion::Fisheye([0.1, -0.02, 0.003, -4e-8]),
    ];
    for lens in lenses {
        let mut all = with_lens(lens);
        write_all(&folder.join(lens.name()), formats(), &all, &ExportNames::default())
            .unwrap_or_else(|e| panic!("{e}"));
        all.set_links(&eye_to_hand().links().expect("links"), None, None);
        let to_hand = folder.join(format!("{}_eye_to_hand", lens.name()));
        write_all(&to_hand, formats(), &all, &ExportNames::default()).unwrap_or_else(|e| panic!("{e}"));
    }
}
