//! easy_handeye2: `.samples` next to `.calib`. With the camera next to the robot (eye to hand) its samples hold the
//! robot's pose the other way round (effector to base), and only the `.calib` states which of the two it is.

use std::path::Path;

use super::{Encoding, File, Format, tree};
use crate::conventions::{Direction, LengthUnit, RotationForm};
use crate::folder;
use crate::formats::nothing::Likely;
use crate::formats::reader::Reader;
use crate::recording::{FoundMode, Known, Role, Track};
use crate::value::Value;
use handeye_estimate::handeye::Mode;
use handeye_wording::Text;
use handeye_wording::text;

pub(super) struct EasyHandeye;

impl Format for EasyHandeye {
    fn name(&self) -> Text {
        Text::verbatim("easy_handeye2")
    }

    fn endings(&self) -> &'static [(&'static str, Encoding)] {
        &[("samples", Encoding::Yaml), ("calib", Encoding::Yaml)]
    }

    fn is_companion(&self, file: &Path, named: &Path) -> bool {
        is_calib(file) && file.file_stem() == named.file_stem()
    }

    fn sniff(&self, file: &File) -> bool {
        file.value().is_some_and(|value| value.get("samples").or(value.get("parameters")).is_some())
    }

    fn read(&self, file: &File, reader: &mut Reader<'_>) -> bool {
        let (Some(value), name) = (file.value(), file.name()) else { return false };
        if let Some(mode) = mode(value, &file.path) {
            // Each of several recordings in a folder has its own.
            let beside = reader.root.join(file.path.with_extension("samples"));
            if !is_calib(&file.path) || beside.is_file() {
                reader.mode(mode);
            }
        }
        let tracks = samples(value, &name);
        let is_so = tracks.is_some();
        if is_so {
            reader.recording.beliefs.push(text!("{file} has samples of easy_handeye2", file = name));
        }
        reader.recording.tracks.extend(tracks.unwrap_or_default());
        is_so
    }

    fn instead(&self, file: &File, _reader: &Reader<'_>) -> Option<(Likely, Text)> {
        file.value().filter(|_| !is_calib(&file.path)).map(tree::instead)
    }
}

fn is_calib(file: &Path) -> bool {
    folder::ending(file) == "calib"
}

/// The series of a file of samples; `None` when it is not one.
fn samples(value: &Value, file: &str) -> Option<Vec<Track>> {
    let first = value.get("samples")?.list().first()?;
    first.get("robot")?;
    first.get("tracking").or_else(|| first.get("optical"))?;
    let mut tracks = tree::series(value, file);
    let why = |what: &str| format!("easy_handeye2 writes {what}");
    for track in &mut tracks {
        track.stated.length = Some(Known::by(why("metres"), LengthUnit::Metre));
        track.stated.rotation = Some(Known::by(why("x y z w"), vec![RotationForm::Xyzw]));
        if track.name.ends_with("robot") {
            track.role = Role::Robot;
            track.stated.direction_in = Some(Known::by(
                why(
                    "the tip in the base with the camera on the robot, and the base in the tip with the camera beside it",
                ),
                [(Mode::EyeInHand, Direction::Forward), (Mode::EyeToHand, Direction::Inverse)],
            ));
        } else {
            track.role = Role::Target;
            track.stated.direction = Some(Known::by(why("the target in the camera"), Direction::Forward));
        }
    }
    (tracks.len() >= 2).then_some(tracks)
}

/// Where the camera is mounted by a `.calib` of easy_handeye2, or a result of easy_handeye.
fn mode(value: &Value, file: &Path) -> Option<FoundMode> {
    let parameters = value.get("parameters")?;
    let by = |key: &'static str, value: Mode| FoundMode { value, key, file: file.display().to_string() };
    if let Some(kind) = parameters.get("calibration_type").and_then(Value::text) {
        return match kind {
            "eye_in_hand" => Some(by("calibration_type", Mode::EyeInHand)),
            "eye_on_base" => Some(by("calibration_type", Mode::EyeToHand)),
            _ => None,
        };
    }
    let on_hand = parameters.get("eye_on_hand")?.flag()?;
    Some(by("eye_on_hand", if on_hand { Mode::EyeInHand } else { Mode::EyeToHand }))
}
