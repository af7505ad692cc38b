//! What lies in a folder: which format each file is of, and why it is taken for that.

use std::path::{Path, PathBuf};
use std::time::Duration;

use super::error::ImportError;
use super::folder;
use super::formats::moveit;
use super::nothing;
use super::reader::Reader;
use super::recording::{FoundTarget, Recording, Track};
use handeye_files::bounds::Bounds;
use handeye_files::budget::{Budget, Limits};
use handeye_files::own_folder::{DESCRIPTION, is_session};
use handeye_geometry::progress::CancelToken;

/// Looks at a folder, or at a file and what lies beside it, without a limit of time.
///
/// # Errors
/// [`ImportError`] where the folder cannot be listed, or is a data set already. A file that cannot be understood is named in
/// [`Recording::warnings`].
pub fn open(path: &Path) -> Result<Recording, ImportError> {
    let cancel = CancelToken::default();
    open_within(path, &Bounds::ANYWHERE, &Budget::new(Limits::default(), &|| Duration::ZERO, &cancel))
}

/// As [`open`], where files may name only what is in `bounds`, and reading is stopped where the budget is spent.
///
/// # Errors
/// As [`open`], and [`ImportError::Stopped`].
pub fn open_within(path: &Path, bounds: &Bounds, budget: &Budget<'_>) -> Result<Recording, ImportError> {
    let stopped = |why| ImportError::stopped(path, why);
    if path.join(DESCRIPTION).exists() || is_session(path) {
        return Err(ImportError::AlreadyADataset(path.to_path_buf()));
    }
    let mut recording = Recording { bounds: bounds.clone(), ..Recording::default() };
    let (root, files, named) = folder::list(path, bounds, budget, &mut recording.warnings)?;
    recording.root.clone_from(&root);
    recording.streams = folder::streams(&root, &files, budget, &mut recording.warnings);
    budget.check().map_err(stopped)?;
    for stream in &recording.streams {
        let depth = if stream.is_depth { ", 16 bits in one channel: depth" } else { "" };
        let (first, last) = (stream.images.first(), stream.images.last());
        let ends = first.zip(last).map(|(a, b)| format!(", {} to {}", a.shown(), b.shown())).unwrap_or_default();
        let (width, height) = stream.size;
        recording.beliefs.push(format!(
            "{} images {} of {width}×{height} px{ends}{depth}",
            stream.images.len(),
            stream.name
        ));
    }
    let mut reader = Reader::new(&root, recording, budget);
    let (bags, others): (Vec<PathBuf>, Vec<PathBuf>) =
        files.iter().filter(|file| !folder::is_image(file)).cloned().partition(|file| folder::is_bag(file));
    let (own, beside): (Vec<PathBuf>, Vec<PathBuf>) =
        others.into_iter().partition(|file| named.as_ref().is_none_or(|named| named == file));
    for members in folder::groups(&own, true) {
        reader.group(&members);
    }
    reader.companions(&beside);
    reader.bags(&bags);
    if named.is_some() {
        reader.named_images();
    }
    budget.check().map_err(stopped)?;
    let mut recording = reader.recording;
    (recording.still, recording.tracks) = recording.tracks.into_iter().partition(Track::is_still);
    if moveit::know(&mut recording.tracks) {
        recording.beliefs.push("the poses are samples of MoveIt calibration, by their names".into());
    }
    if recording.tracks.is_empty() && recording.joints.is_empty() && recording.motions.is_empty() {
        recording.nothing = nothing::reasons(&root, &files, budget);
        budget.check().map_err(stopped)?;
    }
    for stream in recording.streams.iter().filter(|stream| stream.points.is_some()) {
        let (width, height) = stream.size;
        let size = if stream.size == (0, 0) {
            "no file says of which size".into()
        } else {
            format!("of {width}×{height} px")
        };
        let points = stream.points.iter().flatten().flatten();
        let (views, most) = (points.clone().count(), points.map(Vec::len).max().unwrap_or(0));
        recording.beliefs.push(format!("up to {most} corners of {views} images ({size}) in {}", stream.name));
    }
    for track in &recording.tracks {
        let joints = track.samples.iter().filter(|s| !s.joints.is_empty()).count();
        let with = if joints > 0 { format!(", {joints} of them with joint values") } else { String::new() };
        let kind = match track.samples[0].numbers {
            super::Numbers::Angles(_) => "six numbers",
            super::Numbers::Quaternion(_) => "translation and quaternion",
            super::Numbers::Matrix(_) => "matrices",
        };
        recording.beliefs.push(format!("{} poses in {}: {kind}{with}", track.samples.len(), track.name));
    }
    for track in &recording.still {
        recording.beliefs.push(format!("{} poses in {} are all the same", track.samples.len(), track.name));
    }
    for series in &recording.joints {
        let names = if series.joints.is_empty() { String::new() } else { format!(" ({})", series.joints.join(", ")) };
        let count = series.samples.len();
        recording
            .beliefs
            .push(format!("{count} rows of joint values in {}{names}: arm=… makes poses of them", series.name));
    }
    for camera in &recording.cameras {
        recording.beliefs.push(format!("a camera in {}: {}", camera.name, camera.why));
    }
    for FoundTarget { target, file, is_id_open } in &recording.targets {
        let open = if *is_id_open { ", which number of its family is not said" } else { "" };
        recording.beliefs.push(format!("a target in {file}: {target}{open}"));
    }
    Ok(recording)
}
