//! The joint estimator compared with an independent implementation of the same model (`reference_nonlinear.NL_slack` of
//! each data set: same corners, same camera, robot noise by an EM iteration) on real and rendered data.

use std::collections::BTreeMap;
use std::path::Path;

use handeye_estimate::handeye::Mode;
use handeye_estimate::handeye::joint::{JointProblem, JointSolution, JointStart, estimate};
use handeye_geometry::camera::{Distortion, Intrinsics};
use handeye_geometry::frames::{Anchor, Base, Mount, Pose, Target, Tip};
use handeye_geometry::progress::CancelToken;
use handeye_geometry::targets::bent::{BoardPoints, BoardShape};
use handeye_geometry::targets::observation::{Corner, View};
use handeye_geometry::testing::data_folder;
use nalgebra::{Isometry3, Matrix3, Point3, Rotation3, Translation3, UnitQuaternion, Vector2};
use serde_json::Value;

fn numbers(value: &Value) -> Vec<f64> {
    match value {
        Value::Array(items) => items.iter().flat_map(numbers).collect(),
        other => vec![other.as_f64().expect("a number")],
    }
}

fn pose<D, S>(value: &Value) -> Pose<D, S> {
    let m = numbers(value);
    let rotation = Matrix3::new(m[0], m[1], m[2], m[4], m[5], m[6], m[8], m[9], m[10]);
    let rotation = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(rotation));
    Pose::from_isometry(Isometry3::from_parts(Translation3::new(m[3], m[7], m[11]), rotation))
}

struct Set {
    mode: Mode,
    points: Vec<Point3<f64>>,
    views: Vec<View>,
    start: JointStart,
    reference: Pose<Mount, handeye_geometry::frames::Camera>,
    reference_sigma_mm: Vec<f64>,
}

/// Corners per image: from `points.csv` (own target points) or `corners.csv` (chessboard, one detector).
fn corners(folder: &Path, json: &Value) -> (Vec<Point3<f64>>, BTreeMap<String, Vec<Corner>>) {
    let mut by_image: BTreeMap<String, Vec<Corner>> = BTreeMap::new();
    if let Ok(text) = std::fs::read_to_string(folder.join("points.csv")) {
        let mut points: Vec<Point3<f64>> = Vec::new();
        for line in text.lines().skip(1) {
            let cells: Vec<&str> = line.split(',').collect();
            let at = |i: usize| cells[i].parse::<f64>().expect("a number");
            let point = Point3::new(at(2), at(3), at(4));
            let index = points.iter().position(|p| (p - point).norm() < 1e-9).unwrap_or_else(|| {
                points.push(point);
                points.len() - 1
            });
            by_image.entry(cells[1].to_owned()).or_default().push(Corner::new(index, Vector2::new(at(5), at(6))));
        }
        return (points, by_image);
    }
    let board = &json["board"];
    let columns = board["inner_cols"].as_u64().expect("columns") as usize;
    let rows = board["inner_rows"].as_u64().expect("rows") as usize;
    let square = board["square_m"].as_f64().expect("square");
    let points = (0..columns * rows)
        .map(|i| Point3::new((i % columns) as f64 * square, (i / columns) as f64 * square, 0.0))
        .collect();
    let detector = if json["detector"] == "sb" { "sb_accuracy" } else { "classic_subpix" };
    let text = std::fs::read_to_string(folder.join("corners.csv")).expect("corners.csv");
    for line in text.lines().skip(1) {
        let cells: Vec<&str> = line.split(',').collect();
        if cells[0] == detector {
            let px = Vector2::new(cells[4].parse().expect("u"), cells[5].parse().expect("v"));
            let index = cells[3].parse().expect("corner");
            by_image.entry(cells[2].to_owned()).or_default().push(Corner::new(index, px));
        }
    }
    (points, by_image)
}

fn load(folder: &Path) -> Set {
    let text = std::fs::read_to_string(folder.join("views.json")).expect("views.json");
    let json: Value = serde_json::from_str(&text).expect("JSON");
    let mode = if json["mode"] == "eye_to_hand" { Mode::EyeToHand } else { Mode::EyeInHand };
    let k = numbers(&json["K"]);
    let d = numbers(&json["D"]);
    let mut intrinsics = Intrinsics::pinhole(1, 1, 1.0);
    (intrinsics.fx, intrinsics.fy, intrinsics.cx, intrinsics.cy) = (k[0], k[4], k[2], k[5]);
    intrinsics.distortion = Distortion::BrownConrady([0.0; 5]).with_coefficients(&d);
    let (points, mut by_image) = corners(folder, &json);
    let mut views = Vec::new();
    let mut first = None;
    for view in json["views"].as_array().expect("views") {
        let name = view["image"].as_str().expect("image").to_owned();
        let base_from_tip: Pose<Base, Tip> = pose(&view["base_T_gripper"]);
        let camera_from_target: Pose<handeye_geometry::frames::Camera, Target> = pose(&view["cam_T_target"]);
        first.get_or_insert((base_from_tip, camera_from_target));
        let found = by_image.remove(&name).expect("corners of every view");
        views.push(View::new(name, base_from_tip, found));
    }
    // Start from the closed form of the reference, as a user's solve would.
    let mount_from_camera = pose(&json["reference"]["Park"]);
    let (base_from_tip, camera_from_target) = first.expect("a view");
    let anchor_from_target: Pose<Anchor, Target> =
        mode.anchor_from_mount(&base_from_tip) * mount_from_camera * camera_from_target;
    let nonlinear = &json["reference_nonlinear"]["NL_slack"];
    Set {
        mode,
        points,
        views,
        start: JointStart {
            mount_from_camera,
            anchor_from_target,
            intrinsics,
            shape: BoardShape::default(),
            noise: None,
        },
        reference: pose(&nonlinear["X"]),
        reference_sigma_mm: numbers(&nonlinear["sd_t_mm"]),
    }
}

fn solve(set: &Set) -> JointSolution {
    let board = BoardPoints::new(&set.points);
    let problem = JointProblem::new(set.mode, &board, &set.views);
    estimate(&problem, &set.start, &CancelToken::default()).expect("solves")
}

#[test]
fn agrees_with_an_independent_estimator_within_its_uncertainty() {
    let Some(data) = data_folder() else { return };
    for name in [
        "caliban_no_curv",
        "rwhe_cs_synthetic_3",
        "rwhe_kuka_1_eye_in_hand",
        "visp_franka_eye_in_hand",
        "visp_franka_eye_to_hand",
    ] {
        let set = load(&data.join(name));
        let solution = solve(&set);
        let found = solution.hand_eye.mount_from_camera();
        let (metres, radians) = found.distance_to(&set.reference);
        let sigma_mm = set.reference_sigma_mm.iter().map(|s| s * s).sum::<f64>().sqrt();
        println!(
            "{name}: t {:.2?} mm, off the reference by {:.3} mm (its sigma {sigma_mm:.3} mm) and {:.4}°; robot {:.3} mm {:.4}°, \
             corners {:.4} px, rms {:.4} px, {} steps",
            found.translation().map(|v| v * 1e3).as_slice(),
            metres * 1e3,
            radians.to_degrees(),
            solution.noise.robot_m * 1e3,
            solution.noise.robot_rad.to_degrees(),
            solution.noise.corner_px,
            solution.rms_px,
            solution.iterations,
        );
        // Both maximise nearly the same likelihood on the same corners. They differ in the noise levels (restricted
        // likelihood against a fixed number of EM steps), that is in the weights, and another choice of weights moves
        // the answer inside its uncertainty.
        assert!(metres * 1e3 < 2.0 * sigma_mm, "{name}: {metres} m");
    }
}
