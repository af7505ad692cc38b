//! A `dataset.toml` for a folder that has none: what was found is filled in, and what only the user can know is left as
//! choices, so that the text is refused until every choice is made.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use super::error::shown;
use super::images;
use super::joints;
use super::outside::leaves;
use super::text::{TextFile, records, resolve};
use handeye_geometry::natural_order;

/// Prefix of a line that the user has to decide on.
pub const CHOICE: &str = "#? ";

/// Endings of tables, in lower case.
const TABLES: [&str; 3] = ["csv", "txt", "tsv"];

/// The text of a `dataset.toml` for a folder, by what is in it; `None` for a folder with neither images nor tables.
///
/// Units, directions, the place of the camera and the target are never taken from the numbers: each has one line per
/// possibility after [`CHOICE`], and the user enables one of them.
pub fn template(folder: &Path) -> Option<String> {
    let tables: Vec<Found> = tables(folder).filter_map(|name| Found::read(folder, &name)).collect();
    let images = images_of(folder, &tables);
    if images.is_empty() && tables.is_empty() {
        return None;
    }
    let sizes = sizes(folder, &images);
    let mut text = Text::default();
    head(&mut text, folder, &images, &sizes, &tables);
    target(&mut text, &tables);
    robot(&mut text, &tables);
    camera(&mut text, &sizes);
    Some(text.0)
}

/// Names of the files in a folder that may be tables, in natural order.
pub(super) fn tables(folder: &Path) -> impl Iterator<Item = String> {
    let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
    let mut names: Vec<String> = entries
        .filter(|entry| entry.path().is_file())
        .map(|entry| entry.file_name().to_string_lossy().into_owned())
        .filter(|name| {
            let ending = Path::new(name).extension().map(|ending| ending.to_string_lossy().to_lowercase());
            !name.starts_with('.') && ending.is_some_and(|ending| TABLES.contains(&&*ending))
        })
        .collect();
    names.sort_by(|a, b| natural_order::compare(a, b));
    names.into_iter()
}

/// A table that was found.
struct Found {
    name: String,
    columns: Vec<String>,
    rows: Vec<Vec<String>>,
    kind: Kind,
}

enum Kind {
    /// `image,x,y,z` and one of the sets of rotation columns, with these keywords; then this many joint angles.
    Poses {
        rotations: &'static [&'static str],
        joints: usize,
    },
    Corners,
    /// Not a table that a data set has.
    Other,
}

/// The rotation columns of pose tables, and the keywords that have them.
const ROTATIONS: [(&[&str], &[&str]); 5] = [
    (&["qx", "qy", "qz", "qw"], &["quaternion_xyzw"]),
    (&["qw", "qx", "qy", "qz"], &["quaternion_wxyz"]),
    (&["rx", "ry", "rz"], &["rotation_vector", "rpy"]),
    (&["roll", "pitch", "yaw"], &["rpy"]),
    (&["r11", "r12", "r13", "r21", "r22", "r23", "r31", "r32", "r33"], &["matrix"]),
];

impl Found {
    fn read(folder: &Path, name: &str) -> Option<Self> {
        let file = TextFile::read(folder, Path::new(name)).ok()?;
        let mut rows = records(&file).ok()?.into_iter().map(|row| row.cells);
        let columns = rows.next()?;
        let kind = kind(&columns);
        Some(Self { name: name.to_owned(), columns, rows: rows.collect(), kind })
    }

    /// Largest magnitude of the numbers in some columns, by which a person knows their unit.
    fn largest(&self, columns: std::ops::Range<usize>) -> Option<f64> {
        let cells = self.rows.iter().flat_map(|row| row.get(columns.clone()).unwrap_or_default());
        cells.filter_map(|cell| cell.parse::<f64>().ok()).filter(|v| v.is_finite()).map(f64::abs).reduce(f64::max)
    }
}

fn kind(columns: &[String]) -> Kind {
    if columns.iter().eq(&["image", "column", "row", "u", "v"]) {
        return Kind::Corners;
    }
    let Some(rest) = columns.strip_prefix(&["image", "x", "y", "z"].map(str::to_owned)) else { return Kind::Other };
    for (names, rotations) in ROTATIONS {
        if let Some((rotation, angles)) = rest.split_at_checked(names.len())
            && rotation.iter().eq(names)
            && joints::COLUMNS.len() >= angles.len()
            && angles.iter().eq(&joints::COLUMNS[..angles.len()])
        {
            return Kind::Poses { rotations, joints: angles.len() };
        }
    }
    Kind::Other
}

/// The images in the folder and those that pose tables name in folders below it, in natural order.
fn images_of(folder: &Path, tables: &[Found]) -> Vec<PathBuf> {
    let mut images = images::list(folder).unwrap_or_default();
    for table in tables.iter().filter(|table| matches!(table.kind, Kind::Poses { .. })) {
        let named = table.rows.iter().filter_map(|row| resolve(Path::new(""), row.first()?));
        images.extend(named.filter(|path| !leaves(path) && folder.join(path).is_file()));
    }
    images.sort_by(|a, b| natural_order::compare(&a.to_string_lossy(), &b.to_string_lossy()));
    images.dedup();
    images
}

/// Number of images of every size.
fn sizes(folder: &Path, images: &[PathBuf]) -> BTreeMap<(u32, u32), usize> {
    let mut sizes = BTreeMap::new();
    for size in images.iter().filter_map(|image| handeye_images::image_size(&folder.join(image)).ok()) {
        *sizes.entry(size).or_insert(0) += 1;
    }
    sizes
}

#[derive(Default)]
struct Text(String);

impl Text {
    fn line(&mut self, line: impl std::fmt::Display) {
        // Writing to a string cannot fail.
        let _ok = writeln!(self.0, "{line}").is_ok();
    }

    /// A comment is on one line, whatever the name of a file is.
    fn comment(&mut self, comment: impl std::fmt::Display) {
        let comment = handeye_wording::one_line(&comment);
        self.line(format!("# {}", comment.replace(char::is_control, " ")).trim_end());
    }

    fn choices(&mut self, key: &str, choices: &[(&str, &str)]) {
        for (value, means) in choices {
            self.line(format_args!("{CHOICE}{:<32}# {means}", format!("{key} = \"{value}\"")));
        }
    }
}

fn head(text: &mut Text, folder: &Path, images: &[PathBuf], sizes: &BTreeMap<(u32, u32), usize>, tables: &[Found]) {
    text.comment(
        "Description of a data set for handeye, with what was found in the folder. Nothing of it was guessed:",
    );
    text.comment(format!(
        "of the lines that begin with \"{}\" take in those that are true, by removing these signs. \
         docs/reference/dataset.md has all keys.",
        CHOICE.trim_end()
    ));
    text.comment("");
    text.comment(format!("Found in {}:", folder.display()));
    let named = |path: &Path| shown(&path.to_string_lossy());
    match (images.first(), images.last()) {
        (Some(first), Some(last)) => {
            text.comment(format!("  {} images, from {} to {}", images.len(), named(first), named(last)));
        }
        _ => text.comment("  no images here or in the folder images"),
    }
    for ((width, height), count) in sizes {
        text.comment(format!("  {count} of them of {width}×{height} px"));
    }
    let unreadable = images.len() - sizes.values().sum::<usize>();
    if unreadable > 0 {
        text.comment(format!("  {unreadable} of them cannot be read"));
    }
    if sizes.len() > 1 {
        text.comment("  A data set is of one camera: take out the images of the other sizes.");
    }
    for table in tables {
        let what = match table.kind {
            Kind::Poses { .. } => "a pose table",
            Kind::Corners => "a corner table",
            Kind::Other => "not a table of a data set, which begins with image,x,y,z and the columns of a rotation",
        };
        let columns = table.columns.iter().map(|column| shown(column)).take(24).collect::<Vec<_>>().join(",");
        text.comment(format!("  {}: {what}; columns {columns}; rows {}", shown(&table.name), table.rows.len()));
    }
    text.line("");
}

fn target(text: &mut Text, tables: &[Found]) {
    text.comment("Where the camera sits; without [robot] it is not needed.");
    text.choices(
        "mode",
        &[
            ("eye_in_hand", "on the robot, the target stands still"),
            ("eye_to_hand", "stands still, the robot has the target"),
        ],
    );
    text.line("\n[target]");
    text.comment("What was looked at, with the keys of its kind (docs/reference/targets.md).");
    text.choices(
        "kind",
        &[
            ("chessboard", "columns, rows, square_m"),
            ("charuco", "columns, rows, square_m, marker_m, dictionary, layout"),
            ("circles", "columns, rows, square_m"),
            ("asymmetric_circles", "columns, rows, square_m"),
            ("aprilgrid", "columns, rows, tag_m, spacing_m, family"),
            ("apriltag", "tag_m, id, family"),
        ],
    );
    for (key, means) in [
        ("columns", "inner corners, dots or tags along x"),
        ("rows", "inner corners, dots or tags along y"),
        ("square_m", "distance between neighbours, metres"),
    ] {
        text.line(format_args!("{CHOICE}{:<32}# {means}", format!("{key} =")));
    }
    for table in tables.iter().filter(|table| matches!(table.kind, Kind::Corners)) {
        text.line(format_args!("{CHOICE}{:<32}# corners that were found elsewhere", key("corners", &table.name)));
    }
}

fn robot(text: &mut Text, tables: &[Found]) {
    text.line("");
    let mut any = false;
    for table in tables {
        let Kind::Poses { rotations, joints } = &table.kind else { continue };
        if any {
            text.comment("Another pose table. A data set has one: keep this [robot] or the one above.");
        }
        robot_table(text, table, rotations, *joints, !any);
        any = true;
    }
    if !any {
        text.comment("No pose table was found, so that only the camera would be calibrated. With a robot:");
        text.comment("[robot]");
        text.comment("poses = \"poses.csv\" with the columns image,x,y,z and those of a rotation");
    }
}

fn robot_table(text: &mut Text, table: &Found, rotations: &[&str], joints: usize, is_first: bool) {
    // A second table of that name would be no TOML.
    let fact = if is_first { "" } else { CHOICE };
    text.line(format_args!("{fact}[robot]"));
    text.line(format_args!("{fact}{}", key("poses", &table.name)));
    units(text, "length_unit", "x, y, z", [("m", "metres"), ("mm", "millimetres")], table.largest(1..4));
    let columns = table.columns.len() - joints;
    if let [rotation] = rotations {
        text.line(format_args!("{fact}rotation = \"{rotation}\""));
    } else {
        let means = |name: &str| match name {
            "rpy" => "roll, pitch, yaw: R = Rz(yaw)·Ry(pitch)·Rx(roll)",
            _ => "axis times angle",
        };
        let choices: Vec<_> = rotations.iter().map(|name| (*name, means(name))).collect();
        text.choices("rotation", &choices);
    }
    if rotations.iter().any(|name| matches!(*name, "rpy" | "rotation_vector")) {
        units(text, "angle_unit", "the rotation", ANGLES, table.largest(4..columns));
    }
    text.line(format_args!(
        "{CHOICE}{:<32}# how accurate the robot is, millimetres RMS, not its repeatability: for reach errors",
        "accuracy_mm ="
    ));
    text.choices(
        "pose",
        &[
            ("base_from_tip", "the tip as seen from the base, as most controllers show it"),
            ("tip_from_base", "the inverse"),
        ],
    );
    if joints > 0 {
        text.line(format_args!("{fact}joints = {joints}"));
        let all = columns..table.columns.len();
        units(text, "joint_unit", "joint angles", ANGLES, table.largest(all));
    }
}

const ANGLES: [(&str, &str); 2] = [("rad", "radians"), ("deg", "degrees")];

/// The units that numbers may have, and the largest of these, by which a person knows which one it is.
fn units(text: &mut Text, key: &str, of: &str, units: [(&str, &str); 2], largest: Option<f64>) {
    let largest = largest.map_or_else(String::new, |value| format!("; the largest number is {value}"));
    for (unit, name) in units {
        text.choices(key, &[(unit, format!("{of} in {name}{largest}").as_str())]);
    }
}

fn camera(text: &mut Text, sizes: &BTreeMap<(u32, u32), usize>) {
    text.line("");
    text.comment("Only when something is known of the camera; without it the intrinsics are estimated.");
    text.line(format_args!("{CHOICE}[camera]"));
    text.line(format_args!(
        "{CHOICE}{:<32}# true: the numbers below are known; false: the estimate starts there",
        "fixed ="
    ));
    text.line(format_args!(
        "{CHOICE}{:<32}# with fixed = true: how good they are, pixels; exact without it",
        "accuracy_px = 0.5"
    ));
    if let Some(((width, height), _)) = sizes.iter().max_by_key(|(_, count)| **count) {
        text.line(format_args!("{CHOICE}width = {width}"));
        text.line(format_args!("{CHOICE}height = {height}"));
    }
    for name in ["fx", "fy", "cx", "cy"] {
        text.line(format_args!("{CHOICE}{:<32}# pixels", format!("{name} =")));
    }
    text.choices(
        "model",
        &[
            ("none", "distortion = []"),
            ("brown_conrady", "distortion = [k1, k2, p1, p2, k3]"),
            ("rational", "distortion = [k1, k2, p1, p2, k3, k4, k5, k6]"),
            ("fisheye", "distortion = [k1, k2, k3, k4]"),
        ],
    );
}

fn key(key: &str, value: &str) -> String {
    format!("{key} = {}", toml::Value::String(value.to_owned()))
}

#[cfg(test)]
#[path = "template_tests.rs"]
mod tests;
