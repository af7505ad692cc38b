//! MoveIt calibration: samples of `effector_wrt_world` and `object_wrt_sensor`, or groups of both as lists.

use super::{File, Format};
use crate::conventions::{Direction, LengthUnit};
use crate::recording::{Known, Recording, Role, Track};
use handeye_wording::Text;
use handeye_wording::text;

pub(super) struct MoveIt;

impl Format for MoveIt {
    fn name(&self) -> Text {
        text!("MoveIt calibration")
    }

    /// Its files are documents that only the names of the series identify.
    fn sniff(&self, _file: &File) -> bool {
        false
    }

    fn finish(&self, recording: &mut Recording) {
        if know(&mut recording.tracks) {
            recording.beliefs.push(text!("the poses are samples of MoveIt calibration, by their names"));
        }
    }
}

/// Says what is known of series that have MoveIt's names or its form; whether there are any.
fn know(tracks: &mut [Track]) -> bool {
    let ends = |track: &Track, with: &str| track.name.ends_with(with);
    let named =
        tracks.iter().any(|t| ends(t, "effector_wrt_world")) && tracks.iter().any(|t| ends(t, "object_wrt_sensor"));
    // The file that comes with its tests has the two without names.
    let grouped = tracks.len() == 2 && tracks.iter().all(|t| t.name.contains("pose_samples.json:["));
    if !named && !grouped {
        return false;
    }
    for track in tracks {
        let is_robot = ends(track, "effector_wrt_world") || ends(track, ":[0]");
        if !is_robot && !ends(track, "object_wrt_sensor") && !ends(track, ":[1]") {
            continue;
        }
        track.role = if is_robot { Role::Robot } else { Role::Target };
        track.stated.length = Some(Known::by("MoveIt writes metres", LengthUnit::Metre));
        let what =
            if is_robot { "MoveIt writes the effector in the world" } else { "MoveIt writes the object in the sensor" };
        track.stated.direction = Some(Known::by(what, Direction::Forward));
    }
    true
}
