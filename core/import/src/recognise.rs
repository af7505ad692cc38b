//! Contents of a folder: the format of each file, and how it was recognised.

use std::path::{Path, PathBuf};
use std::time::Duration;

use super::error::ImportError;
use super::folder;
use super::formats::nothing;
use super::formats::reader::Reader;
use super::formats::{ALL, Encoding, of_ending};
use super::recording::{FoundCamera, FoundTarget, JointSeries, Recording, Stream, Track};
use handeye_files::bounds::Bounds;
use handeye_files::budget::{Budget, Limits};
use handeye_files::own_folder::{DESCRIPTION, is_session};
use handeye_geometry::progress::CancelToken;
use handeye_wording::Text;
use handeye_wording::text;

/// Reads a folder, or a file and those next to it, without a time limit.
///
/// # Errors
/// [`ImportError`] where the folder cannot be listed, or is a data set already. A file that cannot be understood is named in
/// [`Recording::warnings`].
pub fn open(path: &Path) -> Result<Recording, ImportError> {
    let cancel = CancelToken::default();
    open_within(path, &Bounds::ANYWHERE, &Budget::new(Limits::default(), &|| Duration::ZERO, &cancel))
}

/// As [`open`], where files may name only what is in `bounds`, and reading stops when the budget is spent.
///
/// # Errors
/// As [`open`], and [`ImportError::Stopped`].
pub fn open_within(path: &Path, bounds: &Bounds, budget: &Budget<'_>) -> Result<Recording, ImportError> {
    let stopped = |why| ImportError::stopped(path, why);
    if path.join(DESCRIPTION).exists() || is_session(path) {
        return Err(ImportError::AlreadyADataset(path.to_path_buf()));
    }
    let mut recording = Recording { bounds: bounds.clone(), ..Recording::default() };
    let belongs_to =
        |file: &Path, named: &Path| of_ending(file).is_none_or(|(format, _)| format.is_companion(file, named));
    let (root, files, named) = folder::list(path, belongs_to, bounds, budget, &mut recording.warnings)?;
    recording.root.clone_from(&root);
    recording.streams = folder::streams(&root, &files, budget, &mut recording.warnings);
    budget.check().map_err(stopped)?;
    recording.beliefs.extend(recording.streams.iter().map(Stream::text));
    let mut reader = Reader::new(&root, recording, budget);
    let is_bag = |file: &PathBuf| of_ending(file).is_some_and(|(_, encoding)| encoding == Encoding::Bag);
    let (bags, others): (Vec<PathBuf>, Vec<PathBuf>) =
        files.iter().filter(|file| !folder::is_image(file)).cloned().partition(is_bag);
    let (own, beside): (Vec<PathBuf>, Vec<PathBuf>) =
        others.into_iter().partition(|file| named.as_ref().is_none_or(|named| named == file));
    for members in folder::groups(&own, true) {
        reader.group(&members);
    }
    reader.companions(&beside);
    reader.group(&bags.into_iter().map(|bag| (bag, None)).collect::<Vec<_>>());
    if named.is_some() {
        reader.named_images();
    }
    budget.check().map_err(stopped)?;
    let found = &mut reader.recording;
    (found.still, found.tracks) = std::mem::take(&mut found.tracks).into_iter().partition(Track::is_still);
    for format in ALL {
        format.finish(found);
    }
    if found.tracks.is_empty() && found.joints.is_empty() && found.motions.is_empty() {
        reader.recording.nothing = nothing::reasons(&reader, &files);
        budget.check().map_err(stopped)?;
    }
    let mut recording = reader.recording;
    let with_points = recording.streams.iter().filter(|stream| stream.points.is_some());
    let still = recording.still.iter().map(|track| {
        text!("{count} poses in {name} are all the same", count = track.samples.len(), name = &track.name)
    });
    let beliefs = with_points
        .map(Stream::text)
        .chain(recording.tracks.iter().map(Track::text))
        .chain(still)
        .chain(recording.joints.iter().map(JointSeries::text))
        .chain(recording.cameras.iter().map(FoundCamera::text))
        .chain(recording.targets.iter().map(FoundTarget::text));
    let beliefs: Vec<Text> = beliefs.collect();
    recording.beliefs.extend(beliefs);
    Ok(recording)
}
