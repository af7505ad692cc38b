//! From a dataset folder or a session to observations: loading every image and finding the target in it.

use std::collections::BTreeMap;
use std::sync::atomic::{AtomicUsize, Ordering};

use handeye_core::detect::{self, VisionError};
use handeye_core::estimate::Observations;
use handeye_core::image::GrayImage;
use handeye_core::progress::CancelToken;
use handeye_core::project::dataset::{Dataset, DatasetError, Entry};
use handeye_core::project::files::image_file::gray_from_rgb;
use handeye_core::project::session::{CaptureId, Session, SessionError, SessionObservations};
use handeye_core::targets::TargetSpec;
use handeye_core::targets::observation::Corner;
use rayon::prelude::*;

/// Why a data set or a session could not be observed.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ObserveError {
    /// An image of a data set could not be read.
    #[error(transparent)]
    Dataset(#[from] DatasetError),
    /// An image of a session could not be read.
    #[error(transparent)]
    Session(#[from] SessionError),
    /// The detector itself failed; a target that is not there is no failure.
    #[error("image {name:?}: {source}")]
    Vision {
        /// Which image.
        name: String,
        /// What failed.
        source: VisionError,
    },
    /// The caller asked the work to end.
    #[error("cancelled")]
    Cancelled,
}

/// Called with how many images of how many are done, from the threads that do the work.
pub type Progress<'a> = &'a (dyn Fn(usize, usize) + Sync);

/// Loads every image of a data set and finds the target in it, on all cores.
///
/// # Errors
/// [`ObserveError`]; the first in the order of the pose table.
pub fn observe(dataset: &Dataset, progress: Progress<'_>, cancel: &CancelToken) -> Result<Observations, ObserveError> {
    if let Some(Err(why)) = dataset.arm.as_ref().map(|arm| &arm.placement) {
        tracing::warn!("the joint angles are not used: {why}");
    }
    let mut corners =
        of_each(dataset.entries.len(), progress, cancel, |index| corners_of(dataset, &dataset.entries[index]))?;
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
    let corners = of_each(captures.len(), progress, cancel, |index| {
        let capture = &captures[index];
        detect(&gray_from_rgb(&session.load_rgb(capture)?), target, &capture.image)
    })?;
    let corners: BTreeMap<CaptureId, Vec<Corner>> =
        captures.iter().zip(corners).filter_map(|(capture, corners)| Some((capture.id, corners?))).collect();
    Ok(session.document.observations(image_size, |id| corners.get(&id).cloned()))
}

fn of_each<T: Send>(
    count: usize,
    progress: Progress<'_>,
    cancel: &CancelToken,
    work: impl Fn(usize) -> Result<T, ObserveError> + Sync,
) -> Result<Vec<T>, ObserveError> {
    let done = AtomicUsize::new(0);
    let one = |index| {
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

fn corners_of(dataset: &Dataset, entry: &Entry) -> Result<Option<Vec<Corner>>, ObserveError> {
    // A corner table says what was found in each image.
    if entry.corners.is_some() || entry.image_path.is_none() {
        return Ok(None);
    }
    detect(&dataset.load_gray(entry)?, &dataset.target, &entry.name)
}

fn detect(image: &GrayImage, target: &TargetSpec, name: &str) -> Result<Option<Vec<Corner>>, ObserveError> {
    detect::detect(image, target).map_err(|source| ObserveError::Vision { name: name.to_owned(), source })
}
