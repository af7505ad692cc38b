//! The files of a dataset folder as text. What is written here, [`super::Dataset::read`] reads to the same numbers.

use std::fmt::Write as _;

use super::CameraInput;
use crate::frames::{Base, Pose, Tip};
use crate::handeye::Mode;
use crate::target::TargetSpec;

/// Name of the pose table that [`description`] points to.
pub const POSE_TABLE: &str = "poses.csv";

/// The text of `dataset.toml` for a pose table by [`pose_table`].
pub fn description(mode: Mode, target: &TargetSpec, camera: Option<&CameraInput>) -> String {
    let mode = match mode {
        Mode::EyeInHand => "eye_in_hand",
        Mode::EyeToHand => "eye_to_hand",
    };
    let kind = match target {
        TargetSpec::Chessboard(_) => "chessboard",
        TargetSpec::Circles(_) => "circles",
    };
    let grid = target.grid();
    let mut text = format!(
        "mode = \"{mode}\"\n\n[target]\nkind = \"{kind}\"\ncolumns = {}\nrows = {}\nsquare_m = {:?}\n\n\
         [robot]\nposes = \"{POSE_TABLE}\"\nlength_unit = \"m\"\nrotation = \"quaternion_xyzw\"\npose = \"base_from_tip\"\n",
        grid.columns, grid.rows, grid.square_m
    );
    if let Some(camera) = camera {
        text.push_str(&camera_table(camera));
    }
    text
}

fn camera_table(camera: &CameraInput) -> String {
    let mut text = format!("\n[camera]\nfixed = {}\nmodel = \"{}\"\n", camera.fixed, camera.model.name());
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
    let mut text = String::from("image,x,y,z,qx,qy,qz,qw\n");
    for (name, base_from_tip) in views {
        text.push_str(&quoted(name));
        for value in base_from_tip.translation().iter().chain(&base_from_tip.xyzw()) {
            // Writing to a string cannot fail.
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
