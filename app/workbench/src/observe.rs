//! From a dataset folder or a session to observations: loading every image and finding the target in it.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};

use handeye_dataset::{Dataset, DatasetError};
use handeye_detect::{self as detect, DetectOptions, VisionError};
use handeye_estimate::Observations;
use handeye_geometry::progress::CancelToken;
use handeye_geometry::targets::depth_plane::DepthPlane;
use handeye_geometry::targets::observation::{Corner, Corners, Sight};
use handeye_geometry::targets::{AprilTag, Grid, TargetSpec};
use handeye_images::gray_from_rgb;
use handeye_session::{CaptureId, CaptureRecord, Session, SessionError, SessionObservations};
use image::GrayImage;
use rayon::prelude::*;

/// Why a data set or a session could not be observed.
#[derive(Debug, thiserror::Error, handeye_wording::Localized)]
pub enum ObserveError {
    /// An image of a data set could not be read.
    #[error(transparent)]
    Dataset(#[from] DatasetError),
    /// An image of a session could not be read.
    #[error(transparent)]
    Session(#[from] SessionError),
    /// The detector itself failed; a missing target is no failure.
    #[error("image {name:?}: {source}")]
    Vision {
        /// Which image.
        name: String,
        /// What failed.
        source: VisionError,
    },
    /// The images show a chessboard of another size than the one described.
    #[error(
        "{columns} × {rows} inner corners were looked for and found in {found} of {images} images; {seen} of them show a \
         chessboard of {seen_columns} × {seen_rows} inner corners: columns and rows count inner corners, one fewer than \
         squares. Describe the target as it is"
    )]
    OtherChessboard {
        /// Inner corners along x, as described.
        columns: usize,
        /// Inner corners along y, as described.
        rows: usize,
        /// Images that show it, or a part of the other one that looks like it.
        found: usize,
        /// Images searched.
        images: usize,
        /// Images that show the other one.
        seen: usize,
        /// Its inner corners along the longer side.
        seen_columns: usize,
        /// And along the shorter one.
        seen_rows: usize,
    },
    /// The caller asked the work to end.
    #[error("cancelled")]
    Cancelled,
}

/// Share of the images with any grid in sight that must show the same one before it is taken for the target.
const SAME: f64 = 2.0 / 3.0;

/// Images that must show it where none shows the target: what one or two show may be no board.
const LEAST_OTHER: usize = 3;
/// And this many times as many as show the target, if some do: a board that is present is found in more than a fifth of the
/// images in which boards are.
const TIMES_OTHER: usize = 4;

/// Called with the number of images that are done and their total, from the threads that do the work.
pub type Progress<'a> = &'a (dyn Fn(usize, usize) + Sync);

/// Loads every image of a data set and finds the target in it, on all cores.
///
/// # Errors
/// [`ObserveError`]; the first in the order of the pose table.
pub fn observe(dataset: &Dataset, progress: Progress<'_>, cancel: &CancelToken) -> Result<Observations, ObserveError> {
    if let Some(Err(why)) = dataset.arm.as_ref().map(|arm| &arm.placement) {
        tracing::warn!("the joint angles are not used: {why}");
    }
    // A corner table lists what was found in each image.
    let image_of = |index: usize| -> Result<Option<GrayImage>, ObserveError> {
        let entry = &dataset.entries[index];
        let given = entry.corners.is_some() || entry.image_path.is_none();
        Ok(if given { None } else { Some(dataset.load_gray(entry)?) })
    };
    let names: Vec<&str> = dataset.entries.iter().map(|entry| entry.name.as_str()).collect();
    let mut corners = corners_of(&names, image_of, &dataset.target, progress, cancel)?;
    Ok(dataset.observations(|index| corners[index].take()))
}

/// Loads the image of every capture of a session and finds the target in it, on all cores. Also of those that are not in the
/// fit, as when the window opens the session.
///
/// # Errors
/// [`ObserveError`]; the first in the order of the captures.
pub fn observe_session(
    session: &Session,
    progress: Progress<'_>,
    cancel: &CancelToken,
) -> Result<SessionObservations, ObserveError> {
    let image_size = session.image_size()?.unwrap_or_default();
    let (captures, target) = (&session.document.captures, &session.document.meta.target);
    let image_of = |index: usize| Ok(Some(gray_from_rgb(&session.load_rgb(&captures[index])?)));
    let names: Vec<&str> = captures.iter().map(|capture| capture.image.as_str()).collect();
    let corners = corners_of(&names, image_of, target, progress, cancel)?;
    let sight = |(capture, corners): (&CaptureRecord, Option<Corners>)| {
        let corners = corners?;
        let depth = depth_plane(&session.folder, capture, image_size, &corners, target);
        Some((capture.id, Sight { corners, depth }))
    };
    let seen: Vec<_> = captures.iter().zip(corners).collect();
    let sights: BTreeMap<CaptureId, Sight> = seen.into_par_iter().filter_map(sight).collect();
    Ok(session.document.observations(image_size, |id| sights.get(&id).cloned()))
}

/// The plane of the target by the depths of a capture. A depth image that cannot be read is treated as missing: corners are enough
/// for an answer.
pub fn depth_plane(
    folder: &Path,
    capture: &CaptureRecord,
    image_size: (u32, u32),
    corners: &[Corner],
    target: &TargetSpec,
) -> Option<DepthPlane> {
    let depth = capture.load_depth_m(folder).unwrap_or_else(|error| {
        tracing::warn!(%error, "the depth of a capture cannot be read");
        None
    });
    DepthPlane::new(&depth?, image_size, corners, target)
}

/// Finds the target in images that belong to no data set yet, on all cores. One that cannot be read shows nothing.
///
/// # Errors
/// [`ObserveError::OtherChessboard`], [`ObserveError::Vision`], [`ObserveError::Cancelled`].
pub(crate) fn observe_images(
    images: &[PathBuf],
    target: &TargetSpec,
    progress: Progress<'_>,
    cancel: &CancelToken,
) -> Result<Vec<Option<Corners>>, ObserveError> {
    let names: Vec<String> = images.iter().map(|image| image.display().to_string()).collect();
    let names: Vec<&str> = names.iter().map(String::as_str).collect();
    corners_of(&names, |index| Ok(handeye_images::load_gray(&images[index]).ok()), target, progress, cancel)
}

/// The chessboards that images show, by their sides in inner corners, with how many images show each.
///
/// # Errors
/// [`ObserveError::Vision`], [`ObserveError::Cancelled`].
pub(crate) fn chessboards_in_sight(
    images: &[PathBuf],
    progress: Progress<'_>,
    cancel: &CancelToken,
) -> Result<BTreeMap<(usize, usize), usize>, ObserveError> {
    // The target that is looked for only gives how small squares may be.
    const USUAL: Grid = Grid { columns: 9, rows: 6, square_m: 0.02 };
    let look = |index: usize| {
        let Ok(image) = handeye_images::load_gray(&images[index]) else { return Ok(None) };
        let name = images[index].display().to_string();
        detect::chessboard_in_sight(&image, &USUAL, cancel).map_err(|source| match source {
            VisionError::Cancelled => ObserveError::Cancelled,
            source => ObserveError::Vision { name, source },
        })
    };
    let mut seen = BTreeMap::new();
    for sides in of_each(images.len(), progress, cancel, look)?.into_iter().flatten() {
        *seen.entry(sides).or_default() += 1;
    }
    Ok(seen)
}

/// How many images show each number of the tags of a tag's family. An image that cannot be read shows none.
///
/// # Errors
/// [`ObserveError::Vision`], [`ObserveError::Cancelled`].
pub fn tags_in_sight(
    images: &[PathBuf],
    tag: &AprilTag,
    progress: Progress<'_>,
    cancel: &CancelToken,
) -> Result<BTreeMap<usize, usize>, ObserveError> {
    let look = |index: usize| {
        let Ok(image) = handeye_images::load_gray(&images[index]) else { return Ok(Vec::new()) };
        let failed = |source| ObserveError::Vision { name: images[index].display().to_string(), source };
        detect::tags_in_sight(&image, tag).map_err(failed)
    };
    let mut seen = BTreeMap::new();
    for id in of_each(images.len(), progress, cancel, look)?.into_iter().flatten() {
        *seen.entry(id).or_default() += 1;
    }
    Ok(seen)
}

/// The corners of every image that there is, where the target is seen.
fn corners_of(
    names: &[&str],
    image_of: impl Fn(usize) -> Result<Option<GrayImage>, ObserveError> + Sync,
    target: &TargetSpec,
    progress: Progress<'_>,
    cancel: &CancelToken,
) -> Result<Vec<Option<Corners>>, ObserveError> {
    let options = DetectOptions::thorough().cancelled_by(cancel);
    let failed = |index: usize, source| match source {
        VisionError::Cancelled => ObserveError::Cancelled,
        source => ObserveError::Vision { name: names[index].to_owned(), source },
    };
    let look = |index: usize| -> Result<Look, ObserveError> {
        let Some(image) = image_of(index)? else { return Ok(Look::NoImage) };
        let corners = detect::detect_with(&image, target, &options).map_err(|source| failed(index, source))?;
        Ok(match (corners, target) {
            (Some(corners), _) => Look::Found(corners),
            (None, TargetSpec::Chessboard(grid)) => {
                Look::Missed(detect::chessboard_in_sight(&image, grid, cancel).map_err(|source| failed(index, source))?)
            }
            (None, _) => Look::Missed(None),
        })
    };
    let looks = of_each(names.len(), progress, cancel, look)?;
    if let TargetSpec::Chessboard(grid) = target {
        other_chessboard(&looks, grid)?;
    }
    Ok(looks.into_iter().map(Look::corners).collect())
}

/// What one look at an image gave.
enum Look {
    NoImage,
    Found(Corners),
    /// The target was not found; the sides of the largest chessboard in sight.
    Missed(Option<(usize, usize)>),
}

impl Look {
    fn corners(self) -> Option<Corners> {
        if let Self::Found(corners) = self { Some(corners) } else { None }
    }
}

/// Whether the images show a chessboard of another size, always the same, and the expected one never or seldom: where the
/// border of an image hides a column, a board with one column more looks like it.
fn other_chessboard(looks: &[Look], grid: &Grid) -> Result<(), ObserveError> {
    let found = looks.iter().filter(|look| matches!(look, Look::Found(_))).count();
    let mut seen = BTreeMap::<(usize, usize), usize>::new();
    for look in looks {
        if let Look::Missed(Some(sides)) = look {
            *seen.entry(*sides).or_default() += 1;
        }
    }
    let with_any: usize = seen.values().sum();
    let Some((&(columns, rows), &count)) = seen.iter().max_by_key(|(_, count)| **count) else { return Ok(()) };
    let asked = (grid.columns.max(grid.rows), grid.columns.min(grid.rows));
    let is_more =
        if found == 0 { count >= LEAST_OTHER } else { 2 * count >= looks.len() && count > TIMES_OTHER * found };
    if (columns, rows) == asked || (count as f64) < SAME * with_any as f64 || !is_more {
        return Ok(());
    }
    Err(ObserveError::OtherChessboard {
        columns: grid.columns,
        rows: grid.rows,
        found,
        images: looks.len(),
        seen: count,
        seen_columns: columns,
        seen_rows: rows,
    })
}

fn of_each<T: Send>(
    count: usize,
    progress: Progress<'_>,
    cancel: &CancelToken,
    work: impl Fn(usize) -> Result<T, ObserveError> + Sync,
) -> Result<Vec<T>, ObserveError> {
    let done = AtomicUsize::new(0);
    let one = |index: usize| {
        if cancel.is_cancelled() {
            return Err(ObserveError::Cancelled);
        }
        let result = work(index);
        progress(done.fetch_add(1, Ordering::Relaxed) + 1, count);
        result
    };
    // All of them before the first error: in parallel another one could come first.
    let each: Vec<_> = (0..count).into_par_iter().with_max_len(1).map(one).collect();
    each.into_iter().collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A board of ten columns that is stated to have nine looks like one where the border of an image hides a column.
    #[test]
    fn a_board_with_a_column_more_is_named_although_some_images_hide_it() {
        let grid = Grid { columns: 9, rows: 7, square_m: 0.02 };
        let looks = |found: usize, other: usize, nothing: usize| -> Vec<Look> {
            let found = (0..found).map(|_| Look::Found(Corners::default()));
            let other = (0..other).map(|_| Look::Missed(Some((10, 7))));
            found.chain(other).chain((0..nothing).map(|_| Look::Missed(None))).collect()
        };
        for (found, other, nothing) in [(0, 40, 0), (3, 30, 7), (7, 33, 0), (0, 4, 36)] {
            let why =
                other_chessboard(&looks(found, other, nothing), &grid).expect_err("it is another one").to_string();
            assert!(
                why.contains("9 × 7") && why.contains("10 × 7") && why.contains(&format!("in {found} of")),
                "{why}"
            );
        }
        // The target is there, and another board as well; or hardly anything is.
        for (found, other, nothing) in [(10, 30, 0), (3, 10, 27), (0, 2, 38), (40, 0, 0)] {
            assert!(other_chessboard(&looks(found, other, nothing), &grid).is_ok(), "{found} {other} {nothing}");
        }
        let mixed: Vec<Look> =
            [(8, 5), (8, 6), (10, 7), (9, 6), (7, 7), (10, 7)].map(|sides| Look::Missed(Some(sides))).into();
        assert!(other_chessboard(&mixed, &grid).is_ok(), "no two of them are the same");
    }
}
