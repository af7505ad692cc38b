//! easy_handeye2: `.samples` beside `.calib`. With the camera beside the robot its samples hold the robot's pose the other
//! way round (effector to base), and only the `.calib` says which of the two it is.

use std::path::Path;

use super::tree;
use crate::conventions::{Direction, LengthUnit, RotationForm};
use crate::recording::{FoundMode, Known, Role, Track};
use crate::value::Value;
use handeye_estimate::handeye::Mode;

/// The series of a file of samples; `None` when it is none.
pub(crate) fn samples(value: &Value, file: &str) -> Option<Vec<Track>> {
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

/// Where the camera sits by a `.calib` of easy_handeye2, or a result of easy_handeye.
pub(crate) fn mode(value: &Value, file: &Path) -> Option<FoundMode> {
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
