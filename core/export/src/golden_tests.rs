//! One calibration in every format, against numbers of an independent program, which are given to nine digits.

use super::tests::{file_of, golden_views};
use super::*;
use handeye_result::testing::{GOLDEN_TRANSLATION_M, GOLDEN_XYZW, golden};

/// Rounding error of nine digits, for numbers up to about 1.
const NINE_DIGITS: f64 = 5e-9;

/// Rotation of the golden hand-eye by rows.
const MATRIX: [[f64; 3]; 3] = [
    [0.166579116, -0.937283305, 0.306188511],
    [0.965806345, 0.092530430, -0.242190471],
    [0.198669331, 0.336062681, 0.920647800],
];
const RPY: [f64; 3] = [0.35, -0.20, 1.40];
/// MoveIt's convention: Eigen's `eulerAngles(0, 1, 2)`, R = Rx · Ry · Rz.
const MOVEIT_RPY: [f64; 3] = [0.257237, 0.311187, 1.394907];
const ROTATION_VECTOR: [f64; 3] = [0.429877369, 0.079930497, 1.414769930];
const INVERSE_TRANSLATION_M: [f64; 3] = [0.011290914, 0.024638899, -0.077688094];

fn near(got: &[f64], expected: &[f64]) {
    assert_eq!(got.len(), expected.len(), "{got:?} {expected:?}");
    let off = got.iter().zip(expected).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    assert!(off < NINE_DIGITS, "{got:?} is {off:e} off {expected:?}");
}

/// The text of the only file, or of the file of that name.
fn text_of(format: &str, name: &str) -> String {
    file_of(format, name, &golden(), &ExportNames::default(), &golden_views()).text
}

/// Text without the lines that are comments, and those comments.
fn split_comments(text: &str) -> (String, String) {
    let is_comment = |line: &&str| line.starts_with(['#', '%']) || line.trim_start().starts_with("<!--");
    let (comments, body): (Vec<&str>, Vec<&str>) = text.lines().partition(is_comment);
    (comments.join("\n"), body.join("\n") + "\n")
}

/// Replaces every number by `N`, so that the layout can be compared, and gives the numbers.
fn layout_of(text: &str) -> (String, Vec<f64>) {
    let (mut layout, mut found) = (String::new(), Vec::new());
    for (i, part) in super::property_tests::split_numbers(text).into_iter().enumerate() {
        if i % 2 == 0 {
            layout.push_str(&part);
        } else {
            layout.push('N');
            found.push(part.parse().unwrap_or_else(|e| panic!("{part}: {e}")));
        }
    }
    (layout, found)
}

/// The layout is that of the example of the format's own program, and the numbers are those.
fn same_as_example(text: &str, example: &str) {
    let (layout, numbers) = layout_of(text);
    let (expected_layout, expected) = layout_of(example);
    assert_eq!(layout, expected_layout);
    near(&numbers, &expected);
}

#[test]
fn opencv_yaml_is_as_other_programs_write_it() {
    let text = text_of("opencv_yaml", "opencv.yaml");
    let lines: Vec<&str> = text.lines().collect();
    assert_eq!(lines[..2], ["%YAML:1.0", "---"]);
    assert!(lines[2].starts_with("# T_tool0_camera_color_optical_frame: "), "{}", lines[2]);
    let yaml = yaml::Yaml::parse(&text).expect("YAML");
    let numbers = |path| yaml.numbers(path).unwrap_or_else(|e| panic!("{e}\n{text}")).to_vec();
    let mut rows = Vec::new();
    for (row, t) in MATRIX.iter().zip(GOLDEN_TRANSLATION_M) {
        rows.extend([row[0], row[1], row[2], t]);
    }
    rows.extend([0.0, 0.0, 0.0, 1.0]);
    near(&numbers("T_tool0_camera_color_optical_frame.data"), &rows);
    assert_eq!(numbers("camera_matrix.data"), [912.4, 0.0, 640.7, 0.0, 911.8, 361.2, 0.0, 0.0, 1.0]);
    assert_eq!(numbers("distortion_coefficients.data"), [0.082, -0.191, 0.0006, -0.0004, 0.0]);
    assert!(text.contains("image_width: 1280\nimage_height: 720\n"), "{text}");
    assert!(text.contains("avg_reprojection_error: 0.31\n"));
}

#[test]
fn ros_camera_info_is_as_other_programs_write_it() {
    let (comments, body) = split_comments(&text_of("ros_camera_info", "camera_info.yaml"));
    assert!(comments.contains("sha256 00ff00ff"), "{comments}");
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
fn easy_handeye_of_both_generations_is_as_they_write_it_themselves() {
    let (comments, body) = split_comments(&text_of("easy_handeye2", "my_cell.calib"));
    assert!(comments.starts_with("# T_tool0_camera_color_optical_frame: "), "{comments}");
    let example = "\
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
    x: 0.195832126
    y: 0.036412615
    z: 0.644503346
    w: 0.738200065
";
    same_as_example(&body, example);
    let (_, body) = split_comments(&text_of("easy_handeye", "my_cell_eye_on_hand.yaml"));
    let example = "\
parameters:
  eye_on_hand: true
  freehand_robot_movement: true
  move_group: manipulator
  move_group_namespace: /
  namespace: /my_cell_eye_on_hand/
  robot_base_frame: base_link
  robot_effector_frame: tool0
  tracking_base_frame: camera_color_optical_frame
  tracking_marker_frame: board
transformation:
  qw: 0.738200065
  qx: 0.195832126
  qy: 0.036412615
  qz: 0.644503346
  x: 0.045
  y: -0.032
  z: 0.061
";
    same_as_example(&body, example);
}

#[test]
fn static_transforms_have_their_arguments_in_the_publishers_order() {
    let text = text_of("static_transform_ros2", "static_transform_ros2.sh");
    let (comments, body) = split_comments(&text);
    let example = "\
exec ros2 run tf2_ros static_transform_publisher --x 0.045 --y -0.032 --z 0.061 \\
  --qx 0.195832126 --qy 0.036412615 --qz 0.644503346 --qw 0.738200065 \\
  --frame-id tool0 --child-frame-id camera_color_optical_frame
";
    same_as_example(&body, example);
    assert!(text.starts_with("#!/bin/sh\n# T_tool0_camera_color_optical_frame: "), "{text}");
    let older = comments.lines().last().expect("a line");
    same_as_example(
        older,
        "# ros2 run tf2_ros static_transform_publisher 0.045 -0.032 0.061 1.4 -0.2 0.35 tool0 camera_color_optical_frame",
    );

    let (comments, body) = split_comments(&text_of("static_transform_ros1", "static_transform_ros1.sh"));
    let example = "exec rosrun tf2_ros static_transform_publisher 0.045 -0.032 0.061 \
                   0.195832126 0.036412615 0.644503346 0.738200065 tool0 camera_color_optical_frame\n";
    same_as_example(&body, example);
    let older = comments.lines().last().expect("a line");
    same_as_example(
        older,
        "# rosrun tf static_transform_publisher 0.045 -0.032 0.061 1.4 -0.2 0.35 tool0 camera_color_optical_frame 100",
    );
    assert!(comments.contains("YAW PITCH ROLL"), "{comments}");
}

#[test]
fn urdf_and_xacro_have_rpy_about_fixed_axes() {
    let text = text_of("urdf", "my_cell.urdf");
    let example = "  <link name=\"camera_color_optical_frame\"/>
  <joint name=\"tool0_to_camera_color_optical_frame\" type=\"fixed\">
    <parent link=\"tool0\"/>
    <child link=\"camera_color_optical_frame\"/>
    <origin xyz=\"0.045 -0.032 0.061\" rpy=\"0.35 -0.2 1.4\"/>
  </joint>
</robot>
";
    let at = text.find("  <link name=\"camera").expect("the camera's link");
    same_as_example(&text[at..], example);
    let text = text_of("xacro", "my_cell.urdf.xacro");
    let (_, numbers) = layout_of(text.split("<origin").nth(1).expect("an origin"));
    near(&numbers, &[GOLDEN_TRANSLATION_M, RPY].concat());
}

#[test]
fn a_camera_link_takes_the_place_of_the_optical_frame() {
    // The body of the camera is where its driver states, 15 mm from the lens.
    let link = CameraLink { translation_m: [0.0, 0.015, 0.0], ..CameraLink::default() };
    let names = ExportNames { camera_link: Some(link), ..ExportNames::default() };
    let urdf = file_of("urdf", "my_cell.urdf", &golden(), &names, &[]).text;
    let example = " xyz=\"0.047498687 -0.017512905 0.06398004\" rpy=\"-2.607692961 -1.1697366 -0.669219671\"/>\n  </joint>\n</robot>\n";
    same_as_example(urdf.split("<origin").nth(1).expect("an origin"), example);
    assert!(urdf.contains("<child link=\"camera_link\"/>") && !urdf.contains("optical"), "{urdf}");
    for format in ["static_transform_ros1", "static_transform_ros2", "ros_tf", "moveit_launch", "easy_handeye2"] {
        let file =
            by_name(format).expect("known").render(&ExportInput::new(&golden(), &names)).expect("a file").remove(0);
        let first = file.text.lines().find(|line| line.contains("T_tool0_")).expect("a comment");
        assert!(first.contains("T_tool0_camera_link: "), "{first}");
        assert!(!file.text.contains("optical"), "{}", file.text);
    }
    // Formats of a number alone have nothing to do with the tree of frames.
    let zivid = file_of("zivid", "hand_eye_transform.yaml", &golden(), &names, &[]).text;
    assert!(zivid.contains("T_tool0_camera_color_optical_frame"), "{zivid}");
}

#[test]
fn the_launch_file_has_the_rpy_of_urdf_and_not_that_of_moveit() {
    let text = text_of("moveit_launch", "my_cell.launch");
    let at = text.find("  <node").expect("a node");
    let example = "  <node pkg=\"tf2_ros\" type=\"static_transform_publisher\" name=\"camera_link_broadcaster\"\n      \
                   args=\"0.045 -0.032 0.061   0.195832126 0.036412615 0.644503346 0.738200065 tool0 \
                   camera_color_optical_frame\" />\n</launch>\n";
    same_as_example(&text[at..], example);
    let comment = text.lines().find(|line| line.contains("rpy=\"")).expect("a comment");
    let (_, numbers) = layout_of(comment);
    near(&numbers[3..], &RPY);

    let read = rotation::from_rpy([numbers[3], numbers[4], numbers[5]]);
    let matrix = read.to_rotation_matrix();
    for (i, row) in MATRIX.iter().enumerate() {
        near(&[matrix[(i, 0)], matrix[(i, 1)], matrix[(i, 2)]], row);
    }
    // MoveIt's own comment, pasted into a URDF, is another rotation.
    let trap = rotation::from_rpy(MOVEIT_RPY).angle_to(&read).to_degrees();
    assert!((trap - 29.76).abs() < 0.005, "{trap}°");
}

#[test]
fn kalibr_and_mrcal_have_the_camera_in_their_own_layout() {
    let (_, body) = split_comments(&text_of("kalibr", "camchain.yaml"));
    let example = "\
cam0:
  cam_overlaps: []
  camera_model: pinhole
  distortion_coeffs: [0.082, -0.191, 0.0006, -0.0004]
  distortion_model: radtan
  intrinsics: [912.4, 911.8, 640.7, 361.2]
  resolution: [1280, 720]
  rostopic: /camera_color/image_raw
";
    assert_eq!(body, example);
    let (comments, body) = split_comments(&text_of("mrcal", "camera.cameramodel"));
    let example = "\
{
    'lensmodel':  'LENSMODEL_OPENCV5',
    'intrinsics': [ 912.4, 911.8, 640.7, 361.2, 0.082, -0.191, 0.0006, -0.0004, 0.0,],
    'extrinsics': [ -0.429877369, -0.079930497, -1.41476993, 0.011290914, 0.024638899, -0.077688094,],
    'imagersize': [ 1280, 720,],
}
";
    same_as_example(&body, example);
    assert!(comments.contains("they map tool0 to the camera"), "{comments}");
    near(&layout_of(&body).1[12..15], &INVERSE_TRANSLATION_M);
}

#[test]
fn visp_zivid_ethz_and_tf_have_the_hand_eye_in_their_own_layout() {
    let (comments, body) = split_comments(&text_of("visp", "eMc.yaml"));
    let [x, y, z] = ROTATION_VECTOR;
    let example =
        format!("rows: 6\ncols: 1\ndata:\n  - [0.045]\n  - [-0.032]\n  - [0.061]\n  - [{x}]\n  - [{y}]\n  - [{z}]\n");
    same_as_example(&body, &example);
    assert!(comments.contains("no camera.xml"), "{comments}");

    let (_, body) = split_comments(&text_of("zivid", "hand_eye_transform.yaml"));
    let (layout, numbers) = layout_of(&body);
    let row = "      [N, N, N, N],\n";
    let expected =
        format!("__version__:\n  serializer: N\n  data: N\nFloatMatrix:\n  Data:\n    [\n{}    ]\n", row.repeat(4));
    assert_eq!(layout, expected);
    near(&[numbers[5], numbers[9], numbers[13]], &[45.0, -32.0, 61.0]);
    near(&numbers[2..5], &MATRIX[0]);

    let read: serde_json::Value = serde_json::from_str(&text_of("ethz", "hand_eye_calibration.json")).expect("JSON");
    let number = |path: &str| read.pointer(path).and_then(serde_json::Value::as_f64).expect(path);
    near(&["/rotation/i", "/rotation/j", "/rotation/k", "/rotation/w"].map(number), &GOLDEN_XYZW);
    near(&["/translation/x", "/translation/y", "/translation/z"].map(number), &GOLDEN_TRANSLATION_M);
    assert_eq!(number("/delay"), 0.0);

    let (_, body) = split_comments(&text_of("ros_tf", "transform_stamped.yaml"));
    let (layout, numbers) = layout_of(&body);
    assert!(
        layout.starts_with("header:\n  stamp:\n    sec: N\n    nanosec: N\n  frame_id: tool0\nchild_frame_id: camera")
    );
    near(&numbers[2..], &[&GOLDEN_TRANSLATION_M[..], &GOLDEN_XYZW].concat());
}

#[test]
fn industrial_calibration_has_both_transforms_and_the_cost_of_its_own_definition() {
    let (_, body) = split_comments(&text_of("industrial_calibration", "industrial_calibration.yaml"));
    let yaml = yaml::Yaml::parse(&body).expect("YAML");
    let numbers = |key: &str, names: &[&str]| -> Vec<f64> {
        names.iter().map(|name| yaml.number(&format!("{key}.{name}")).expect("a number")).collect()
    };
    let [x, y, z, w] = GOLDEN_XYZW;
    let seven = numbers("camera_mount_to_camera", &["x", "y", "z", "qw", "qx", "qy", "qz"]);
    near(&seven, &[&GOLDEN_TRANSLATION_M[..], &[w, x, y, z]].concat());
    near(&numbers("camera_mount_to_camera_rpy", &["x", "y", "z"]), &RPY);
    near(&numbers("camera_mount_to_camera_pos", &["x", "y", "z"]), &GOLDEN_TRANSLATION_M);
    // The target's quaternion has a negative w in the result.
    near(
        &numbers("target_mount_to_target", &["x", "y", "z", "qw", "qx", "qy", "qz"]),
        &[0.4, -0.1, 0.02, 0.8, 0.0, -0.6, 0.0],
    );
    near(&[yaml.number("final_cost_per_obs").expect("a number")], &[0.31 * 0.31 / 4.0]);
    assert!(body.contains("initial_cost_per_obs: .nan\n"), "{body}");
}

#[test]
fn matlab_counts_pixels_from_one() {
    let (comments, body) = split_comments(&text_of("matlab", "handeye_calibration.m"));
    assert!(body.contains("K = [912.4, 0.0, 641.7; 0.0, 911.8, 362.2; 0.0, 0.0, 1.0];\n"), "{body}");
    assert!(body.contains("imageSize = [720.0, 1280.0];\nradialDistortion = [0.082, -0.191, 0.0];\n"), "{body}");
    assert!(body.contains("tangentialDistortion = [0.0006, -0.0004];\n"), "{body}");
    assert!(body.contains("parentFromChild = rigidtform3d(R, t);\n"), "{body}");
    assert!(comments.contains("pixel (1, 1) is the centre"), "{comments}");
}

#[test]
fn colmap_has_the_base_in_the_camera_and_corners_of_pixels_at_whole_numbers() {
    let (_, body) = split_comments(&text_of("colmap", "cameras.txt"));
    same_as_example(&body, "1 OPENCV 1280 720 912.4 911.8 641.2 361.7 0.082 -0.191 0.0006 -0.0004\n");
    let (_, body) = split_comments(&text_of("colmap", "images.txt"));
    let example =
        "1 0.091817289 0.839564948 -0.535059258 -0.020294705 -0.193515584 0.431235057 0.454978653 1 a.png\n\n";
    same_as_example(&body, example);
    let (_, body) = split_comments(&text_of("colmap", "points3D.txt"));
    assert_eq!(body.trim(), "");
}

#[test]
fn nerfstudio_has_the_camera_in_the_base_with_opengl_axes() {
    let text = text_of("nerfstudio", "transforms.json");
    let example = r#"{
  "camera_model": "OPENCV",
  "w": 1280,
  "h": 720,
  "fl_x": 912.4,
  "fl_y": 911.8,
  "cx": 641.2,
  "cy": 361.7,
  "k1": 0.082,
  "k2": -0.191,
  "p1": 0.0006,
  "p2": -0.0004,
  "frames": [
    {
      "file_path": "a.png",
      "transform_matrix": [
        [0.426599432, 0.902160805, -0.064177936, 0.442397413],
        [-0.894707186, 0.410562353, -0.175890894, -0.076117506],
        [-0.132332826, 0.132455416, 0.982315421, 0.478443502],
        [0.0, 0.0, 0.0, 1.0]
      ]
    }
  ]
}
"#;
    same_as_example(&text, example);
}
