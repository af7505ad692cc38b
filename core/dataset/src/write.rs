//! The files of a dataset folder as text. What is written here, [`super::Dataset::read`] reads to the same numbers.

use std::collections::BTreeMap;
use std::fmt::Write as _;

use super::CameraInput;
use handeye_arm::ArmModel;
use handeye_estimate::handeye::Mode;
use handeye_geometry::frames::{Base, Pose, Tip};
use handeye_geometry::targets::TargetSpec;

/// Name of the pose table that [`description`] points to.
pub const POSE_TABLE: &str = "poses.csv";

/// The arm of the joint values in a pose table by [`pose_table_with_joints`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Joints<'a> {
    /// This arm.
    Of(&'a ArmModel),
    /// An unknown arm with this many joints: the values are kept, and not used.
    Count(usize),
}

impl Joints<'_> {
    /// Number of joints; `None` for an invalid arm.
    pub fn count(self) -> Option<usize> {
        match self {
            Self::Of(model) => Some(model.arm().ok()?.joint_count()),
            Self::Count(count) => Some(count),
        }
    }
}

/// Facts about the robot in addition to its poses.
#[derive(Debug, Clone, Copy, Default)]
pub struct Robot<'a> {
    /// The joint values in the pose table.
    pub joints: Option<Joints<'a>>,
    /// Position of the tool's tip in the frame of the tip, metres.
    pub tool_m: Option<[f64; 3]>,
    /// Accuracy of the robot, millimetres.
    pub accuracy_mm: Option<f64>,
}

/// The text of `dataset.toml` for a pose table by [`pose_table`], or with joints by [`pose_table_with_joints`].
pub fn description(mode: Mode, target: &TargetSpec, camera: Option<&CameraInput>, robot: Robot<'_>) -> String {
    let mode = match mode {
        Mode::EyeInHand => "eye_in_hand",
        Mode::EyeToHand => "eye_to_hand",
    };
    let mut text = format!(
        "mode = \"{mode}\"\n\n{}\n\
         [robot]\nposes = \"{POSE_TABLE}\"\nlength_unit = \"m\"\nrotation = \"quaternion_xyzw\"\npose = \"base_from_tip\"\n",
        target_table(target)
    );
    if let Some(tool_m) = robot.tool_m {
        let _ok = writeln!(text, "tool_m = {tool_m:?}").is_ok();
    }
    if let Some(accuracy_mm) = robot.accuracy_mm {
        let _ok = writeln!(text, "accuracy_mm = {accuracy_mm:?}").is_ok();
    }
    match robot.joints {
        Some(Joints::Of(arm)) => text.push_str(&arm_table(arm)),
        Some(Joints::Count(count)) => text.push_str(&joint_columns(count)),
        None => {}
    }
    if let Some(camera) = camera {
        text.push_str(&camera_table(camera));
    }
    text
}

/// The text of `dataset.toml` for images without a robot: these and no others.
pub fn description_of_images<'a>(
    images: impl IntoIterator<Item = &'a str>,
    target: &TargetSpec,
    camera: Option<&CameraInput>,
) -> String {
    let images: Vec<&str> = images.into_iter().collect();
    let camera = camera.map(camera_table).unwrap_or_default();
    format!("images = {}\n\n{}{camera}", toml::Value::from(images), target_table(target))
}

/// The rest of `[robot]`, and `[robot.arm]`.
fn arm_table(model: &ArmModel) -> String {
    let joints = model.arm().map_or(0, |arm| arm.joint_count());
    let table = match model {
        ArmModel::Kind(kind) => format!("[robot.arm]\nkind = \"{}\"\n", kind.name()),
        ArmModel::Dh(rows) => format!("[robot.arm]\ndh = {rows:?}\n"),
        ArmModel::Chain(arm) => {
            let tables = BTreeMap::from([("robot", BTreeMap::from([("arm", BTreeMap::from([("chain", arm)]))]))]);
            toml::to_string(&tables).expect("an arm is names and numbers, which TOML has")
        }
    };
    format!("{}\n{table}", joint_columns(joints))
}

/// The columns of joint values; with radians the metres of a prismatic joint stay as they are.
fn joint_columns(count: usize) -> String {
    format!("joints = {count}\njoint_unit = \"rad\"\n")
}

/// The table `[target]` of a `dataset.toml`.
pub fn target_table(target: &TargetSpec) -> String {
    let mut text = format!("[target]\nkind = \"{}\"\n", target.kind());
    // Writing to a string cannot fail.
    let mut line = |key: &str, value: &dyn std::fmt::Display| {
        let _ok = writeln!(text, "{key} = {value}").is_ok();
    };
    let number = |value: f64| format!("{value:?}");
    let word = |value: &str| format!("\"{value}\"");
    match target {
        TargetSpec::Chessboard(grid) | TargetSpec::Circles(grid) | TargetSpec::AsymmetricCircles(grid) => {
            line("columns", &grid.columns);
            line("rows", &grid.rows);
            line("square_m", &number(grid.square_m));
        }
        TargetSpec::Charuco(board) => {
            line("columns", &board.columns);
            line("rows", &board.rows);
            line("square_m", &number(board.square_m));
            line("marker_m", &number(board.marker_m));
            line("dictionary", &word(board.dictionary.name()));
            if let Some(layout) = board.layout {
                line("layout", &word(layout.name()));
            }
        }
        TargetSpec::AprilGrid(board) => {
            line("columns", &board.columns);
            line("rows", &board.rows);
            line("tag_m", &number(board.tag_m));
            line("spacing_m", &number(board.spacing_m));
            line("first_id", &board.first_id);
            line("family", &word(board.family.name()));
            line("ids", &word(board.ids.name()));
            if let Some(bits) = board.border_bits {
                line("border_bits", &bits);
            }
        }
        TargetSpec::AprilTag(tag) => {
            line("tag_m", &number(tag.tag_m));
            line("id", &tag.id);
            line("family", &word(tag.family.name()));
            if let Some(bits) = tag.border_bits {
                line("border_bits", &bits);
            }
        }
    }
    text
}

fn camera_table(camera: &CameraInput) -> String {
    let mut text = format!("\n[camera]\nfixed = {}\nmodel = \"{}\"\n", camera.fixed, camera.model.name());
    if let Some(px) = camera.accuracy_px.filter(|_| camera.fixed) {
        // Writing to a string cannot fail.
        let _ok = writeln!(text, "accuracy_px = {px:?}").is_ok();
    }
    if let Some(k) = &camera.intrinsics {
        let numbers = [("fx", k.fx), ("fy", k.fy), ("cx", k.cx), ("cy", k.cy)];
        // Writing to a string cannot fail.
        let _ok = write!(text, "width = {}\nheight = {}\n", k.width, k.height).is_ok();
        for (key, value) in numbers {
            let _ok = writeln!(text, "{key} = {value:?}").is_ok();
        }
        let _ok = writeln!(text, "distortion = {:?}", k.distortion.coefficients()).is_ok();
    }
    text
}

/// The text of a pose table: metres and `quaternion_xyzw`, `base_from_tip`, every digit that a number has.
///
/// Names are quoted where they need it.
pub fn pose_table<'a>(views: impl IntoIterator<Item = (&'a str, &'a Pose<Base, Tip>)>) -> String {
    table(0, views.into_iter().map(|(name, base_from_tip)| (name, base_from_tip, &[][..])))
}

/// [`pose_table`] with joint values in radians, or metres of a prismatic joint, `joints` for every view.
pub fn pose_table_with_joints<'a>(
    joints: usize,
    views: impl IntoIterator<Item = (&'a str, &'a Pose<Base, Tip>, &'a [f64])>,
) -> String {
    table(joints, views)
}

fn table<'a>(joints: usize, views: impl IntoIterator<Item = (&'a str, &'a Pose<Base, Tip>, &'a [f64])>) -> String {
    let mut text = String::from("image,x,y,z,qx,qy,qz,qw");
    // Writing to a string cannot fail.
    for i in 1..=joints {
        let _ok = write!(text, ",q{i}").is_ok();
    }
    text.push('\n');
    for (name, base_from_tip, joints_rad) in views {
        text.push_str(&quoted(name));
        for value in base_from_tip.translation().iter().chain(&base_from_tip.xyzw()).chain(joints_rad) {
            let _ok = write!(text, ",{value:?}").is_ok();
        }
        text.push('\n');
    }
    text
}

fn quoted(cell: &str) -> String {
    if cell.contains(['"', ',', '\n', '\r']) || cell.trim() != cell {
        format!("\"{}\"", cell.replace('"', "\"\""))
    } else {
        cell.to_owned()
    }
}
