use super::*;
use handeye_geometry::camera::{Distortion, Intrinsics};
use handeye_geometry::frames::Pose;
use handeye_result::testing::{eye_to_hand, golden, golden_intrinsics, intrinsics_only, pose_pairs_only};
use handeye_result::{CalibrationResult, IntrinsicsEstimate};

/// The file of that name.
pub(super) fn file_of(
    format: &str,
    name: &str,
    result: &CalibrationResult,
    names: &ExportNames,
    views: &[ExportView],
) -> ExportFile {
    let input = ExportInput { result, names, views };
    let files = preview(by_name(format).expect("known"), &input).unwrap_or_else(|e| panic!("{format}: {e}"));
    let known: Vec<_> = files.iter().map(|file| file.name.clone()).collect();
    files.into_iter().find(|file| file.name == name).unwrap_or_else(|| panic!("{name} is not in {known:?}"))
}

/// One image with the flange at xyz (0.42, −0.11, 0.55) m, rpy (π − 0.1, 0.2, 0.3) rad.
pub(super) fn golden_views() -> Vec<ExportView> {
    let rotation = rotation::from_rpy([std::f64::consts::PI - 0.1, 0.2, 0.3]);
    let base_from_tip = Pose::from_isometry(nalgebra::Isometry3::from_parts([0.42, -0.11, 0.55].into(), rotation));
    vec![ExportView { name: "a.png".into(), base_from_tip }]
}

/// Formats of an eye-to-hand transform with a file of each.
fn eye_to_hand_input_names() -> [(&'static str, &'static str); 15] {
    [
        ("opencv_yaml", "opencv.yaml"),
        ("easy_handeye2", "my_cell.calib"),
        ("easy_handeye", "my_cell_eye_on_base.yaml"),
        ("static_transform_ros2", "static_transform_ros2.sh"),
        ("static_transform_ros1", "static_transform_ros1.sh"),
        ("ros_tf", "transform_stamped.yaml"),
        ("urdf", "my_cell.urdf"),
        ("xacro", "my_cell.urdf.xacro"),
        ("moveit_launch", "my_cell.launch"),
        ("mrcal", "camera.cameramodel"),
        ("visp", "rMc.yaml"),
        ("zivid", "hand_eye_transform.yaml"),
        ("industrial_calibration", "industrial_calibration.yaml"),
        ("ethz", "hand_eye_calibration.json"),
        ("matlab", "handeye_calibration.m"),
    ]
}

fn with_lens(distortion: Distortion) -> CalibrationResult {
    let k = Intrinsics { distortion, ..golden_intrinsics() };
    CalibrationResult { intrinsics: Some(IntrinsicsEstimate::new(&k, None, true)), ..golden() }
}

fn render(name: &str, result: &CalibrationResult) -> Result<Vec<ExportFile>, ExportError> {
    preview(by_name(name)?, &ExportInput::new(result, &ExportNames::default()))
}

#[test]
fn a_format_refuses_a_result_without_what_it_is_about() {
    let hand_eye_formats = eye_to_hand_input_names().map(|(format, _)| format);
    for format in hand_eye_formats.iter().filter(|name| !["opencv_yaml", "mrcal", "visp", "matlab"].contains(*name)) {
        let error = render(format, &intrinsics_only()).expect_err("no hand-eye");
        assert!(matches!(error, ExportError::NeedsHandEye { .. }), "{error}");
        assert!(error.to_string().starts_with(&format!("{format} is about a hand-eye transform")), "{error}");
        assert!(error.is_bad_input());
        assert!(render(format, &pose_pairs_only()).is_ok(), "{format}");
    }
    for format in ["ros_camera_info", "kalibr", "mrcal", "colmap", "nerfstudio"] {
        let error = render(format, &pose_pairs_only()).expect_err("no intrinsics");
        assert!(error.to_string().starts_with(&format!("{format} is about a camera's intrinsics")), "{error}");
    }
    let without_target = CalibrationResult { target: None, ..golden() };
    let error = render("industrial_calibration", &without_target).expect_err("no target");
    assert!(matches!(error, ExportError::NeedsTarget { .. }), "{error}");
    let nothing = CalibrationResult::default();
    for format in formats().iter().filter(|format| format.name() != "json") {
        assert!(render(format.name(), &nothing).is_err(), "{}", format.name());
    }
    let error = by_name("kalibur").err().expect("unknown").to_string();
    assert!(error.contains("json, ros_camera_info, opencv_yaml, easy_handeye2"), "{error}");
}

#[test]
fn formats_of_both_write_the_half_that_there_is() {
    let text = |format, result: &CalibrationResult| render(format, result).expect("a file").remove(0).text;
    assert!(!text("opencv_yaml", &intrinsics_only()).contains("\nT_"));
    assert!(!text("opencv_yaml", &pose_pairs_only()).contains("camera_matrix"));
    assert!(!text("matlab", &intrinsics_only()).contains("rigidtform3d"));
    assert!(!text("matlab", &pose_pairs_only()).contains("cameraParameters"));
    let alone = text("mrcal", &intrinsics_only());
    assert!(alone.contains("# There is no hand-eye: the reference frame is the camera itself."), "{alone}");
    assert!(alone.contains("'extrinsics': [ 0.0, 0.0, 0.0, 0.0, 0.0, 0.0,],"), "{alone}");
    let pinhole = CalibrationResult { hand_eye: None, target: None, mode: None, ..with_lens(Distortion::None) };
    assert_eq!(render("visp", &pinhole).expect("a file")[0].name, "camera.xml");
    let error = render("visp", &intrinsics_only()).expect_err("a lens that ViSP cannot hold");
    assert!(matches!(error, ExportError::NeedsModel { .. }), "{error}");
    assert!(!text("visp", &pose_pairs_only()).contains("camera.xml"));
}

#[test]
fn poses_of_images_need_views_and_a_camera_that_moves() {
    let (names, views) = (ExportNames::default(), golden_views());
    for format in ["colmap", "nerfstudio"] {
        let format = by_name(format).expect("known");
        let error = preview(format, &ExportInput::new(&golden(), &names)).expect_err("no views");
        assert!(matches!(error, ExportError::NeedsViews { .. }), "{error}");
        let fixed = eye_to_hand();
        let error = preview(format, &ExportInput { views: &views, ..ExportInput::new(&fixed, &names) });
        let error = error.expect_err("a camera that stands still");
        assert!(matches!(error, ExportError::NeedsMovingCamera { .. }), "{error}");
        let mut lost = views.clone();
        lost[0].base_from_tip = Pose::from_translation_xyzw([f64::NAN, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0]);
        let error = preview(format, &ExportInput { views: &lost, ..ExportInput::new(&golden(), &names) });
        assert!(matches!(error, Err(ExportError::BadView { .. })), "{error:?}");
    }
    let mut blank = views.clone();
    blank[0].name = "a b.png".into();
    let result = golden();
    let input = ExportInput { views: &blank, ..ExportInput::new(&result, &names) };
    let error = preview(by_name("colmap").expect("known"), &input).expect_err("a blank");
    assert!(matches!(error, ExportError::BadView { .. }), "{error}");
    assert!(preview(by_name("nerfstudio").expect("known"), &input).is_ok(), "JSON holds any name");
}

#[test]
fn everything_written_reads_back_and_a_wrong_number_does_not() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let out = folder.path().join("new/exports");
    let names = ExportNames { target_frame: "on".into(), camera_name: "1e3".into(), ..ExportNames::default() };
    let mut result = golden();
    result.hand_eye.as_mut().expect("a hand-eye").translation_m = [1e-7, -1.0 / 3.0, 1e3];
    let views = golden_views();
    let input = ExportInput { result: &result, names: &names, views: &views };
    let written = write_all(&out, formats(), &input).unwrap_or_else(|e| panic!("{e}"));
    let rendered: Vec<_> = formats()
        .iter()
        .flat_map(|f| preview(*f, &input).expect("rendered").into_iter().map(move |r| (*f, r)))
        .collect();
    assert_eq!(written.len(), rendered.len());
    let mut seen: Vec<_> = rendered.iter().map(|(_, file)| file.name.to_lowercase()).collect();
    seen.sort();
    seen.dedup();
    assert_eq!(seen.len(), rendered.len(), "two formats write one file: {seen:?}");

    let mut other = result.clone();
    other.hand_eye.as_mut().expect("a hand-eye").translation_m[0] += 1e-8;
    other.intrinsics.as_mut().expect("intrinsics").cx += 1e-8;
    other.arm.as_mut().expect("an arm").joints[1].shift_mm.as_mut().expect("a shift")[0] += 1e-5;
    let other = ExportInput { result: &other, ..input };
    for ((format, file), path) in rendered.iter().zip(&written) {
        let read = ExportFile { name: file.name.clone(), text: fs::read_to_string(path).expect("text") };
        assert_eq!(read, *file);
        assert_eq!(format.compare(&read, &input), Ok(()), "{}", format.name());
        if file.name != "points3D.txt" {
            assert!(format.compare(&read, &other).is_err(), "{} {}", format.name(), file.name);
        }
        let empty = ExportFile { text: String::new(), ..read };
        assert!(format.compare(&empty, &input).is_err(), "{} {}", format.name(), file.name);
    }
}

#[test]
fn names_that_would_break_a_file_are_refused_and_nothing_is_written() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let refuse = |names: &ExportNames| {
        write_all(folder.path(), formats(), &ExportInput::new(&golden(), names)).expect_err("refused")
    };
    for bad in ["", "a: b", "a\nb", "\"", "#x", "-x", "../up", "$(x)", "<", "ä"] {
        let names = ExportNames { calibration: bad.into(), ..ExportNames::default() };
        assert!(matches!(refuse(&names), ExportError::BadName { what: "calibration", .. }), "{bad:?}");
    }
    let link = CameraLink { frame: "a b".into(), ..CameraLink::default() };
    let names = ExportNames { camera_link: Some(link), ..ExportNames::default() };
    assert!(matches!(refuse(&names), ExportError::BadName { what: "camera link", .. }));
    let twice = ExportNames { camera_frame: "tool0".into(), ..ExportNames::default() };
    assert!(matches!(refuse(&twice), ExportError::SameFrame { .. }));
    for (translation_m, rotation_xyzw) in
        [([f64::NAN; 3], REP103_OPTICAL_XYZW), ([0.0; 3], [0.0; 4]), ([0.0; 3], [f64::NAN; 4])]
    {
        let link = CameraLink { translation_m, rotation_xyzw, ..CameraLink::default() };
        let names = ExportNames { camera_link: Some(link), ..ExportNames::default() };
        assert!(matches!(refuse(&names), ExportError::BadCameraLink { .. }));
    }
    let refused = write_all(folder.path(), formats(), &ExportInput::new(&intrinsics_only(), &ExportNames::default()));
    assert!(matches!(refused, Err(ExportError::NeedsHandEye { .. })));
    assert_eq!(fs::read_dir(folder.path()).expect("list").count(), 0);
}

#[test]
fn names_are_kept_in_documents_and_what_is_missing_there_has_its_default() {
    let link = CameraLink { translation_m: [0.0, 0.015, 0.0], ..CameraLink::default() };
    let names = ExportNames { camera_link: Some(link), base_frame: "world".into(), ..ExportNames::default() };
    let text = serde_json::to_string(&names).expect("JSON");
    assert_eq!(serde_json::from_str::<ExportNames>(&text).expect("names"), names);
    let partial: ExportNames =
        serde_json::from_str(r#"{"base_frame": "world", "camera_link": {"translation_m": [0, 0.015, 0]}}"#)
            .expect("names");
    assert_eq!(partial, names);
}

#[test]
fn every_text_file_says_first_which_way_in_which_unit_and_from_what() {
    let (result, names, views) = (golden(), ExportNames::default(), golden_views());
    let input = ExportInput { result: &result, names: &names, views: &views };
    for format in formats() {
        for file in preview(*format, &input).expect("rendered") {
            // JSON has no comments.
            if file.text.starts_with('{') || file.name == "points3D.txt" {
                continue;
            }
            // Directives and the line of the interpreter come before everything.
            let before = |line: &&str| ["%YAML", "---", "#!", "<?xml", "<launch"].iter().any(|b| line.starts_with(b));
            let first = file.text.lines().find(|line| !before(line)).expect("a line");
            let is_comment = ["#", "%", "<!--"].iter().any(|start| first.trim_start().starts_with(start));
            assert!(is_comment, "{}: {first}", file.name);
            for words in ["Euler|rpy: ", "T_|Intrinsics", "etres|pixels", "sha256 00ff00ff"] {
                assert!(words.split('|').any(|w| first.contains(w)), "{}: no {words} in {first}", file.name);
            }
        }
    }
}

#[test]
fn two_hyphens_in_a_name_do_not_end_a_comment_of_xml() {
    let names = ExportNames { effector_frame: "a---b".into(), ..ExportNames::default() };
    for (format, file) in
        [("urdf", "my_cell.urdf"), ("xacro", "my_cell.urdf.xacro"), ("moveit_launch", "my_cell.launch")]
    {
        let text = file_of(format, file, &golden(), &names, &[]).text;
        for comment in text.split("<!--").skip(1).map(|rest| rest.split("-->").next().expect("text")) {
            assert!(!comment.contains("--"), "{comment}");
        }
        assert!(text.contains("a---b"), "{text}");
    }
}

#[test]
fn eye_to_hand_is_seen_from_the_base_and_the_quaternion_turns_to_positive_w() {
    let mut result = eye_to_hand();
    let hand_eye = result.hand_eye.as_mut().expect("a hand-eye");
    hand_eye.rotation_xyzw = hand_eye.rotation_xyzw.map(|v| -v);
    assert!(hand_eye.rotation_xyzw[3] < 0.0);
    for (format, name) in eye_to_hand_input_names() {
        let text = file_of(format, name, &result, &ExportNames::default(), &[]).text;
        if format != "ethz" {
            assert!(text.contains("T_base_link_camera_color_optical_frame: "), "{text}");
            assert!(!text.contains("T_tool0_camera"), "{text}");
        }
    }
    let text = |format, name| file_of(format, name, &result, &ExportNames::default(), &[]).text;
    let easy = text("easy_handeye2", "my_cell.calib");
    assert!(easy.contains("calibration_type: eye_on_base"));
    assert!(easy.ends_with("    x: -0.5\n    y: 0.5\n    z: -0.5\n    w: 0.5\n"), "{easy}");
    assert!(text("easy_handeye", "my_cell_eye_on_base.yaml").contains("eye_on_hand: false\n"));
    assert!(text("urdf", "my_cell.urdf").contains("<parent link=\"base_link\"/>"));
    assert!(text("industrial_calibration", "industrial_calibration.yaml").contains("# T_tool0_board likewise"));
    assert!(text("opencv_yaml", "opencv.yaml").contains("T_base_link_camera_color_optical_frame: !!opencv-matrix"));
}

#[test]
fn every_lens_keeps_its_coefficients_under_the_name_of_the_reader_or_is_refused() {
    let brown = Distortion::BrownConrady([1., 2., 3., 4., 5.]);
    let rational = Distortion::Rational([1., 2., 3., 4., 5., 6., 7., 8.]);
    let fisheye = Distortion::Fisheye([1., 2., 3., 4.]);
    let without_k3 = Distortion::BrownConrady([1., 2., 3., 4., 0.]);
    let none = Distortion::None;
    // Format, file, lens, and words of the file or `None` where the lens is refused.
    let cases: &[(&str, &str, Distortion, Option<&str>)] = &[
        ("ros_camera_info", "camera_info.yaml", none, Some("plumb_bob\n")),
        ("ros_camera_info", "camera_info.yaml", brown, Some("data: [1.0, 2.0, 3.0, 4.0, 5.0]")),
        ("ros_camera_info", "camera_info.yaml", rational, Some("distortion_model: rational_polynomial\n")),
        ("ros_camera_info", "camera_info.yaml", fisheye, Some("distortion_model: equidistant\n")),
        ("opencv_yaml", "opencv.yaml", rational, Some("distortion_model: rational\n")),
        ("opencv_yaml", "opencv.yaml", fisheye, Some("data: [ 1.0, 2.0, 3.0, 4.0 ]")),
        ("kalibr", "camchain.yaml", none, Some("distortion_coeffs: []\n  distortion_model: none\n")),
        ("kalibr", "camchain.yaml", without_k3, Some("[1.0, 2.0, 3.0, 4.0]\n  distortion_model: radtan\n")),
        ("kalibr", "camchain.yaml", brown, None),
        ("kalibr", "camchain.yaml", rational, None),
        ("kalibr", "camchain.yaml", fisheye, Some("[1.0, 2.0, 3.0, 4.0]\n  distortion_model: equidistant\n")),
        (
            "mrcal",
            "camera.cameramodel",
            none,
            Some("'LENSMODEL_PINHOLE',\n    'intrinsics': [ 912.4, 911.8, 640.7, 361.2,],"),
        ),
        ("mrcal", "camera.cameramodel", brown, Some("361.2, 1.0, 2.0, 3.0, 4.0, 5.0,],")),
        ("mrcal", "camera.cameramodel", rational, Some("'LENSMODEL_OPENCV8'")),
        ("mrcal", "camera.cameramodel", fisheye, None),
        ("visp", "camera.xml", none, Some("<type>perspectiveProjWithoutDistortion</type>")),
        ("visp", "eMc.yaml", brown, Some("no camera.xml: ViSP's lens models cannot hold this distortion")),
        ("matlab", "handeye_calibration.m", none, Some("radialDistortion = [0.0, 0.0, 0.0];")),
        ("matlab", "handeye_calibration.m", brown, Some("[1.0, 2.0, 5.0];\ntangentialDistortion = [3.0, 4.0];")),
        ("matlab", "handeye_calibration.m", rational, None),
        ("matlab", "handeye_calibration.m", fisheye, None),
        ("colmap", "cameras.txt", none, Some("1 PINHOLE 1280 720 912.4 911.8 641.2 361.7\n")),
        ("colmap", "cameras.txt", without_k3, Some("1 OPENCV 1280 720 912.4 911.8 641.2 361.7 1.0 2.0 3.0 4.0\n")),
        (
            "colmap",
            "cameras.txt",
            brown,
            Some("1 FULL_OPENCV 1280 720 912.4 911.8 641.2 361.7 1.0 2.0 3.0 4.0 5.0 0.0 0.0 0.0\n"),
        ),
        ("colmap", "cameras.txt", rational, Some(" 1.0 2.0 3.0 4.0 5.0 6.0 7.0 8.0\n")),
        ("colmap", "cameras.txt", fisheye, Some("1 OPENCV_FISHEYE 1280 720 912.4 911.8 641.2 361.7 1.0 2.0 3.0 4.0\n")),
        ("nerfstudio", "transforms.json", none, Some("\"camera_model\": \"PINHOLE\"")),
        ("nerfstudio", "transforms.json", brown, Some("\"k3\": 5.0,")),
        ("nerfstudio", "transforms.json", rational, None),
        ("nerfstudio", "transforms.json", fisheye, Some("\"camera_model\": \"OPENCV_FISHEYE\"")),
    ];
    for (format, name, lens, words) in cases {
        let result: CalibrationResult = with_lens(*lens);
        let (names, views) = (ExportNames::default(), golden_views());
        let input = ExportInput { views: &views, ..ExportInput::new(&result, &names) };
        match (preview(by_name(format).expect("known"), &input), words) {
            (Ok(files), Some(words)) => {
                let file = files.iter().find(|file| file.name == *name).expect("a file of that name");
                assert!(file.text.contains(words), "{format} {words:?}: {}", file.text);
            }
            (Err(error @ ExportError::NeedsModel { .. }), None) => {
                let text = error.to_string();
                assert!(text.contains(lens.name()) && text.contains("model = "), "{text}");
                assert!(error.is_bad_input());
            }
            (other, _) => panic!("{format} with {}: {other:?}", lens.name()),
        }
    }
}
