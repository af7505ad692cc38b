//! ViSP: a `vpPoseVector` to a file (three translations, then the rotation vector, metres and radians), a camera in XML, and
//! the target as text.

use super::{File, Format, pose_files, tree};
use crate::conventions::{AngleUnit, Direction, LengthUnit, RotationForm};
use crate::folder;
use crate::formats::reader::Reader;
use crate::recording::{FoundCamera, FoundTarget, Known, Role, Stated, Track};
use crate::value::Value;
use handeye_geometry::camera::{Distortion, Intrinsics};
use handeye_geometry::targets::{AprilTag, Dictionary, Grid, TargetSpec};
use handeye_wording::Text;

pub(super) struct Visp;

impl Format for Visp {
    fn name(&self) -> Text {
        Text::verbatim("ViSP")
    }

    fn is_of_poses(&self) -> bool {
        false
    }

    fn sniff(&self, file: &File) -> bool {
        file.value().is_some() || file.text().is_some()
    }

    fn read_together(&self, files: &[File], reader: &mut Reader<'_>) -> bool {
        let vectors = files.iter().filter_map(File::value).filter(|value| is_pose(value)).count();
        if files.len() < tree::LEAST_POSES || 2 * vectors <= files.len() {
            return false;
        }
        let mut tracks = pose_files::tracks(files, reader);
        tracks.iter_mut().for_each(know);
        let is_so = !tracks.is_empty();
        reader.recording.tracks.extend(tracks);
        is_so
    }

    fn read(&self, file: &File, reader: &mut Reader<'_>) -> bool {
        let name = file.name();
        reader.recording.targets.extend(file.text().and_then(|text| target(text, &name)));
        let xml = file.value().filter(|_| folder::ending(&file.path) == "xml");
        reader.recording.cameras.extend(xml.and_then(|value| camera(value, &name)));
        false
    }
}

/// Whether a document is a vector of six numbers as ViSP saves it.
fn is_pose(value: &Value) -> bool {
    value.get("rows").and_then(Value::whole) == Some(6)
        && value.get("cols").and_then(Value::whole) == Some(1)
        && value.numbers(6).is_some_and(|numbers| numbers.len() == 6)
}

/// Adds what is known about a series of such files.
fn know(track: &mut Track) {
    let by = |what: &str| format!("ViSP's pose vectors are {what}");
    track.stated = Stated {
        length: Some(Known::by(by("in metres"), LengthUnit::Metre)),
        angle: Some(Known::by(by("in radians"), AngleUnit::Radian)),
        rotation: Some(Known::by(by("translation and rotation vector"), vec![RotationForm::Vector])),
        ..Stated::default()
    };
    track.role = tree::role(&track.name);
    // aPb is the pose of b in a.
    if track.name.contains("rPe") || track.name.contains("wPe") || track.name.contains("fPe") {
        track.role = Role::Robot;
        track.stated.direction =
            Some(Known::by("rPe is ViSP's name of the effector in the reference", Direction::Forward));
    } else if track.name.contains("cPo") {
        track.role = Role::Target;
        track.stated.direction = Some(Known::by("cPo is ViSP's name of the object in the camera", Direction::Forward));
    }
}

/// The first value with a name, anywhere in the tree.
fn first<'a>(value: &'a Value, name: &str) -> Option<&'a Value> {
    match value {
        Value::Map(entries) => {
            let within = |(key, inner): &'a (String, Value)| if key == name { Some(inner) } else { first(inner, name) };
            entries.iter().find_map(within)
        }
        Value::List(items) => items.iter().find_map(|item| first(item, name)),
        _ => None,
    }
}

/// A camera from ViSP's XML.
fn camera(value: &Value, file: &str) -> Option<FoundCamera> {
    let camera = first(value, "camera")?;
    let number = |name: &str| first(camera, name)?.number();
    let (width, height) = (number("image_width").unwrap_or(0.0), number("image_height").unwrap_or(0.0));
    let kud = number("kud").unwrap_or(0.0);
    let distortion = if kud == 0.0 { Distortion::None } else { Distortion::BrownConrady([kud, 0.0, 0.0, 0.0, 0.0]) };
    Some(FoundCamera {
        name: file.to_owned(),
        intrinsics: Intrinsics {
            width: width as u32,
            height: height as u32,
            fx: number("px")?,
            fy: number("py")?,
            cx: number("u0")?,
            cy: number("v0")?,
            distortion,
        },
        why: "a camera of ViSP",
    })
}

/// A target from the note next to ViSP's data: `Chessboard`, `9 x 6`, `square size: 0.0236 m`, or the family of a tag and its
/// size, without its number.
fn target(text: &str, file: &str) -> Option<FoundTarget> {
    let lower = text.to_lowercase();
    let size = |key: &str| -> Option<f64> {
        let rest = lower.split_once(key)?.1;
        let mut words = rest.split_whitespace();
        let value: f64 = words.next()?.parse().ok()?;
        match words.next() {
            Some("m") => Some(value),
            Some("mm") => Some(value * 1e-3),
            _ => None,
        }
    };
    let found = |target: TargetSpec, is_id_open: bool| FoundTarget { target, file: file.to_owned(), is_id_open };
    if lower.contains("36h11") {
        let family = "apriltag_36h11".parse::<Dictionary>().ok()?;
        let tag = AprilTag { tag_m: size("size:")?, id: 0, family, border_bits: Some(1) };
        return Some(found(TargetSpec::AprilTag(tag), true));
    }
    if !lower.contains("chessboard") {
        return None;
    }
    let words: Vec<&str> = lower.split_whitespace().collect();
    let (columns, rows) = words.windows(3).find_map(|w| match w {
        [columns, "x", rows] => Some((columns.parse().ok()?, rows.parse().ok()?)),
        _ => None,
    })?;
    Some(found(TargetSpec::Chessboard(Grid { columns, rows, square_m: size("size:")? }), false))
}
