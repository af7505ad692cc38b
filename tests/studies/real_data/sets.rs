//! The recorded sets: poses, corners and target poses from their `views.json` and corner tables.

use std::collections::BTreeMap;
use std::path::Path;

use handeye_estimate::handeye::{Mode, PosePair};
use handeye_geometry::camera::{Distortion, Intrinsics};
use handeye_geometry::frames::{Base, Camera, Pose, Target, Tip};
use handeye_geometry::targets::bent::BoardPoints;
use handeye_geometry::targets::observation::{Corner, View};
use handeye_geometry::targets::{AprilTag, Grid, TargetSpec};
use nalgebra::{Isometry3, Matrix3, Point3, Rotation3, Translation3, UnitQuaternion, Vector2, Vector3};
use serde_json::Value;

/// One set.
pub struct Set {
    pub name: String,
    pub mode: Mode,
    pub target: TargetSpec,
    /// Empty corners if the set has pose pairs only.
    pub image_size: (u32, u32),
    pub board: BoardPoints,
    /// Empty corners where the set has pose pairs only.
    pub views: Vec<View>,
    pub pairs: Vec<PosePair>,
    pub intrinsics: Intrinsics,
    pub centre: Point3<f64>,
}

impl Set {
    /// Whether it has corners.
    pub fn has_corners(&self) -> bool {
        !self.views.is_empty()
    }
}

const NAMES: [&str; 7] = [
    "caliban_no_curv",
    "rwhe_cs_synthetic_3",
    "rwhe_kuka_1_eye_in_hand",
    "visp_franka_eye_in_hand",
    "visp_franka_eye_to_hand",
    "rct_circles_eye_in_hand",
    "moveit_pose_samples",
];

/// The chosen sets, or all.
pub fn all(data: &Path, chosen: &[String]) -> Vec<Set> {
    let wanted = |name: &&str| chosen.is_empty() || chosen.iter().any(|c| name.contains(c.as_str()));
    NAMES.into_iter().filter(wanted).map(|name| load(data, name)).collect()
}

fn numbers(value: &Value) -> Vec<f64> {
    match value {
        Value::Array(items) => items.iter().flat_map(numbers).collect(),
        other => vec![other.as_f64().expect("views.json has numbers here")],
    }
}

fn pose<D, S>(value: &Value) -> Pose<D, S> {
    let m = numbers(value);
    let rotation = Matrix3::new(m[0], m[1], m[2], m[4], m[5], m[6], m[8], m[9], m[10]);
    let rotation = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(rotation));
    Pose::from_isometry(Isometry3::from_parts(Translation3::new(m[3], m[7], m[11]), rotation))
}

fn read_json(path: &Path) -> Value {
    let text = std::fs::read_to_string(path).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
    serde_json::from_str(&text).unwrap_or_else(|e| panic!("{}: {e}", path.display()))
}

fn load(data: &Path, name: &str) -> Set {
    let folder = data.join(name);
    if name == "moveit_pose_samples" {
        return pose_pairs(&folder, name);
    }
    let json = read_json(&folder.join("views.json"));
    let mode = if json["mode"] == "eye_to_hand" { Mode::EyeToHand } else { Mode::EyeInHand };
    let (k, d) = (numbers(&json["K"]), numbers(&json["D"]));
    let mut intrinsics = Intrinsics::pinhole(1, 1, 1.0);
    (intrinsics.fx, intrinsics.fy, intrinsics.cx, intrinsics.cy) = (k[0], k[4], k[2], k[5]);
    intrinsics.distortion = Distortion::BrownConrady([0.0; 5]).with_coefficients(&d);
    let (mut points, mut by_image) = corners(&folder, &json);
    if json["board"]["type"] == "apriltag" {
        points.swap(2, 3);
    }
    let (mut views, mut pairs) = (Vec::new(), Vec::new());
    for view in json["views"].as_array().expect("views.json has views") {
        let image = view["image"].as_str().expect("every view has an image").to_owned();
        let base_from_tip: Pose<Base, Tip> = pose(&view["base_T_gripper"]);
        let camera_from_target: Pose<Camera, Target> = pose(&view["cam_T_target"]);
        pairs.push(PosePair { anchor_from_mount: mode.anchor_from_mount(&base_from_tip), camera_from_target });
        let mut found = by_image.remove(&image).expect("every view has corners");
        if json["board"]["type"] == "apriltag" {
            // The file goes around the tag, a target runs row by row.
            found.swap(2, 3);
            for (index, corner) in found.iter_mut().enumerate() {
                corner.index = index;
            }
        }
        views.push(View::new(image, base_from_tip, found));
    }
    let centre = Point3::from(points.iter().map(|p| p.coords).sum::<Vector3<f64>>() / points.len() as f64);
    let first = json["views"][0]["image"].as_str().expect("every view has an image");
    let image = [folder.join("images").join(first), folder.join(first)].into_iter().find(|path| path.exists());
    let image_size = image::image_dimensions(image.expect("the images are there")).expect("an image");
    (intrinsics.width, intrinsics.height) = image_size;
    let (target, board) = (target(&json["board"]), BoardPoints::new(&points));
    Set { name: name.to_owned(), mode, target, image_size, board, views, pairs, intrinsics, centre }
}

/// The target that the corners of a set belong to.
fn target(board: &Value) -> TargetSpec {
    let count = |name: &str| board[name].as_u64().expect("the board has a size") as usize;
    let length = |name: &str| board[name].as_f64().expect("the board has lengths");
    match board["type"].as_str() {
        Some("apriltag") => {
            let family = "36h11".parse().expect("a family");
            TargetSpec::AprilTag(AprilTag { tag_m: length("size_m"), id: 0, family, border_bits: None })
        }
        Some("circle_grid_modified") => {
            TargetSpec::Circles(Grid { columns: count("cols"), rows: count("rows"), square_m: length("spacing_m") })
        }
        _ => TargetSpec::Chessboard(Grid {
            columns: count("inner_cols"),
            rows: count("inner_rows"),
            square_m: length("square_m"),
        }),
    }
}

/// Pairs `[base_T_eef, cam_T_target]` without corners.
fn pose_pairs(folder: &Path, name: &str) -> Set {
    let mode = Mode::EyeToHand;
    let pairs = read_json(&folder.join("pose_samples.json"))
        .as_array()
        .expect("a list of pairs")
        .iter()
        .map(|pair| PosePair {
            anchor_from_mount: mode.anchor_from_mount(&pose(&pair[0])),
            camera_from_target: pose(&pair[1]),
        })
        .collect();
    let intrinsics = Intrinsics::pinhole(1, 1, 1.0);
    let (board, views, centre) = (BoardPoints::new(&[]), Vec::new(), Point3::origin());
    // The distances between its points are never used.
    let target = TargetSpec::Chessboard(Grid { columns: 0, rows: 0, square_m: 1.0 });
    Set { name: name.to_owned(), mode, target, image_size: (1, 1), board, views, pairs, intrinsics, centre }
}

/// Corners per image: from `points.csv` (own target points) or `corners.csv` (chessboard, the detector of `views.json`).
fn corners(folder: &Path, json: &Value) -> (Vec<Point3<f64>>, BTreeMap<String, Vec<Corner>>) {
    let mut by_image: BTreeMap<String, Vec<Corner>> = BTreeMap::new();
    let number = |cell: &str| cell.parse::<f64>().expect("a table of numbers");
    if let Ok(text) = std::fs::read_to_string(folder.join("points.csv")) {
        let mut points: Vec<Point3<f64>> = Vec::new();
        for line in text.lines().skip(1) {
            let cells: Vec<&str> = line.split(',').collect();
            let point = Point3::new(number(cells[2]), number(cells[3]), number(cells[4]));
            let index = points.iter().position(|p| (p - point).norm() < 1e-9).unwrap_or_else(|| {
                points.push(point);
                points.len() - 1
            });
            let px = Vector2::new(number(cells[5]), number(cells[6]));
            by_image.entry(cells[1].to_owned()).or_default().push(Corner::new(index, px));
        }
        return (points, by_image);
    }
    let count = |name: &str| json["board"][name].as_u64().expect("the board has a size") as usize;
    let (columns, rows) = (count("inner_cols"), count("inner_rows"));
    let square = json["board"]["square_m"].as_f64().expect("the board has a square");
    let points = (0..columns * rows)
        .map(|i| Point3::new((i % columns) as f64 * square, (i / columns) as f64 * square, 0.0))
        .collect();
    let detector = if json["detector"] == "sb" { "sb_accuracy" } else { "classic_subpix" };
    let text = std::fs::read_to_string(folder.join("corners.csv")).expect("a chessboard set has corners.csv");
    for line in text.lines().skip(1).filter(|line| line.starts_with(detector)) {
        let cells: Vec<&str> = line.split(',').collect();
        let index = cells[3].parse().expect("a corner's index");
        let px = Vector2::new(number(cells[4]), number(cells[5]));
        by_image.entry(cells[2].to_owned()).or_default().push(Corner::new(index, px));
    }
    (points, by_image)
}
