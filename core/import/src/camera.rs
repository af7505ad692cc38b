//! Which of the cameras described by files is used.

use super::error::ImportError;
use super::recording::{FoundCamera, Recording};
use super::settings::Settings;
use handeye_wording::Text;
use handeye_wording::text;

/// The camera that is used for images of this size, and the warnings about those that are not.
///
/// A single one is used; of several none is, unless one is named.
///
/// # Errors
/// [`ImportError::BadChoice`] for a name that there is not.
pub fn chosen(
    recording: &Recording,
    size: (u32, u32),
    settings: &Settings,
) -> Result<(Option<FoundCamera>, Option<Text>), ImportError> {
    let fits = |camera: &&FoundCamera| {
        let k = &camera.intrinsics;
        let same = (k.width, k.height) == size;
        let unstated = (k.width, k.height) == (0, 0);
        same || (unstated && k.cx < f64::from(size.0) && k.cy < f64::from(size.1))
    };
    let sized = |camera: &FoundCamera| {
        let mut camera = camera.clone();
        (camera.intrinsics.width, camera.intrinsics.height) = size;
        camera
    };
    let fitting: Vec<FoundCamera> = recording.cameras.iter().filter(fits).map(sized).collect();
    if let Some(name) = settings.camera.as_deref() {
        if name == "none" {
            return Ok((None, None));
        }
        if let Some(camera) = fitting.iter().find(|camera| camera.name == name) {
            return Ok((Some(camera.clone()), None));
        }
        let mut choices: Vec<&str> = fitting.iter().map(|camera| camera.name.as_str()).collect();
        choices.push("none");
        let choices =
            text!("{names} (of {width}×{height} px)", names = choices.join(", "), width = size.0, height = size.1);
        return Err(ImportError::BadChoice { key: "camera".into(), value: name.to_owned(), choices });
    }
    let differ = fitting.iter().any(|camera| camera.intrinsics != fitting[0].intrinsics);
    if differ {
        let names: Vec<&str> = fitting.iter().map(|camera| camera.name.as_str()).collect();
        let note =
            text!("cameras in {names}: none is taken, say which with --set camera=FILE", names = names.join(", "));
        return Ok((None, Some(note)));
    }
    if fitting.is_empty() && !recording.cameras.is_empty() {
        let camera = &recording.cameras[0];
        let (width, height) = (camera.intrinsics.width, camera.intrinsics.height);
        let note = text!(
            "the camera in {name} is of {width}×{height} px and not of these images: it is not used",
            name = &camera.name,
            width = width,
            height = height
        );
        return Ok((None, Some(note)));
    }
    Ok((fitting.into_iter().next(), None))
}
