//! industrial_calibration and robot_cal_tools: `cal_data.yaml` lists pairs of files, the pose `{x y z qx qy qz qw}` in one
//! and the image in the other; images are rectified.

use std::path::Path;
use std::sync::Arc;

use super::{File, Format, tree};
use crate::conventions::{Direction, LengthUnit};
use crate::folder;
use crate::formats::reader::Reader;
use crate::recording::{FoundMode, FoundTarget, Known, Role, Sample, Track};
use crate::value::{self, Value};
use handeye_estimate::handeye::Mode;
use handeye_geometry::targets::{Charuco, Dictionary, Grid, TargetSpec};
use handeye_wording::Text;
use handeye_wording::text;

/// Most pairs that are read.
const MOST_PAIRS: usize = 10_000;

pub(super) struct IndustrialCalibration;

impl Format for IndustrialCalibration {
    fn name(&self) -> Text {
        Text::verbatim("industrial_calibration, robot_cal_tools")
    }

    fn sniff(&self, file: &File) -> bool {
        file.value().is_some()
    }

    fn read(&self, file: &File, reader: &mut Reader<'_>) -> bool {
        let (Some(value), name) = (file.value(), file.name()) else { return false };
        if let Some(mode) = mode(value, &file.path) {
            reader.mode(mode);
        }
        let found = target(value).map(|target| FoundTarget { target, file: name.clone(), is_id_open: false });
        reader.recording.targets.extend(found);
        let document = |path: &Path| {
            let path = reader.root.join(path);
            let may_be = !reader.budget.is_spent() && reader.recording.bounds.has(&path);
            let text = may_be.then(|| folder::text(&path).ok()).flatten()?;
            value::yaml(&text).ok()?.into_iter().next()
        };
        let Some(track) = pairs(value, &file.path, document) else { return false };
        let belief = text!("{file} lists poses and images as industrial_calibration does", file = name);
        reader.recording.beliefs.push(belief);
        reader.recording.tracks.push(track);
        true
    }
}

/// The series that a list of pairs names; `None` when the document is not one. `read` returns the document in a file next
/// to it.
fn pairs(value: &Value, file: &Path, read: impl Fn(&Path) -> Option<Value>) -> Option<Track> {
    let list = value.get("data").unwrap_or(value).list();
    let folder = file.parent().unwrap_or(Path::new(""));
    let mut samples = Vec::new();
    let mut pairs = 0;
    for entry in list.iter().take(MOST_PAIRS) {
        let (Some(pose), Some(image)) =
            (entry.get("pose").and_then(Value::text), entry.get("image").and_then(Value::text))
        else {
            continue;
        };
        pairs += 1;
        // A name that leads out of the folder, or to the disk of the person who wrote it, is not followed.
        let name = Path::new(pose);
        let is_inside =
            name.is_relative() && name.components().all(|part| matches!(part, std::path::Component::Normal(_)));
        let Some(document) = is_inside.then(|| read(&folder.join(name))).flatten() else { continue };
        let Some((_, numbers, stated)) = tree::fields(&document).poses.into_iter().next() else { continue };
        let image = folder.join(image).display().to_string();
        let place =
            text!("{pose}, which {file} pairs with {image}", pose = pose, file = file.display(), image = &image);
        let place = Arc::new(place);
        samples.push((Sample { image: Some(image), number: None, place, numbers, joints: Vec::new() }, stated));
    }
    if 2 * samples.len() < pairs {
        return None;
    }
    let stated = samples.first()?.1.clone();
    let samples = samples.into_iter().map(|(sample, _)| sample).collect();
    let mut track = tree::track(file.display().to_string(), "robot", stated, samples)?;
    track.role = Role::Robot;
    track.stated.length = Some(Known::by("industrial_calibration writes metres", LengthUnit::Metre));
    track.stated.direction = Some(Known::by("industrial_calibration writes the tip in the base", Direction::Forward));
    Some(track)
}

/// Where the camera is mounted, if the file states it.
fn mode(value: &Value, file: &Path) -> Option<FoundMode> {
    let key = "static_camera";
    let mode = if value.get(key)?.flag()? { Mode::EyeToHand } else { Mode::EyeInHand };
    Some(FoundMode { value: mode, key, file: file.display().to_string() })
}

/// The target of its `target_finder`.
fn target(value: &Value) -> Option<TargetSpec> {
    let finder = value.get("target_finder").unwrap_or(value);
    let kind = finder.get("type").and_then(Value::text)?.to_lowercase();
    let whole = |key: &str| finder.get(key).and_then(Value::whole).map(|n| n as usize);
    let number = |key: &str| finder.get(key).and_then(Value::number);
    let (columns, rows) = (whole("cols")?, whole("rows")?);
    if kind.contains("circle") {
        return Some(TargetSpec::Circles(Grid { columns, rows, square_m: number("spacing")? }));
    }
    if kind.contains("charuco") {
        // Squares are counted there, inner corners here; 10 is OpenCV's number of the dictionary 6×6 with 250 markers.
        return Some(TargetSpec::Charuco(Charuco {
            columns: columns.checked_sub(1)?,
            rows: rows.checked_sub(1)?,
            square_m: number("chessboard_dim")?,
            marker_m: number("aruco_marker_dim")?,
            dictionary: if whole("dictionary").is_none_or(|n| n == 10) {
                "6x6_250".parse::<Dictionary>().ok()?
            } else {
                return None;
            },
            layout: None,
        }));
    }
    None
}
