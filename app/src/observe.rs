//! From a dataset folder to observations: loading every image and finding the target in it.

use std::sync::atomic::{AtomicUsize, Ordering};

use handeye_core::calibrate::{CameraKnowledge, Observations, ObservedView};
use handeye_core::camera::Distortion;
use handeye_core::dataset::{CameraInput, Dataset, DatasetError, Entry};
use handeye_core::observation::Corner;
use handeye_core::progress::CancelToken;
use handeye_core::vision::{self, VisionError};

use crate::parallel::map_in_order;

/// Why a dataset could not be observed.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ObserveError {
    /// An image could not be read.
    #[error(transparent)]
    Dataset(#[from] DatasetError),
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

/// Lens model estimated when a data set names none: what OpenCV estimates by default.
pub const DEFAULT_MODEL: Distortion = Distortion::BrownConrady([0.0; 5]);

/// Loads every image of a data set and finds the target in it, on all cores. `progress` is called with how many of how
/// many are done, from the threads that do the work.
///
/// # Errors
/// [`ObserveError`]; the first in the order of the pose table.
pub fn observe(
    dataset: &Dataset,
    progress: &(dyn Fn(usize, usize) + Sync),
    cancel: &CancelToken,
) -> Result<Observations, ObserveError> {
    if let Some(Err(why)) = dataset.arm.as_ref().map(|arm| &arm.placement) {
        tracing::warn!("the joint angles are not used: {why}");
    }
    let count = dataset.entries.len();
    let done = AtomicUsize::new(0);
    let corners = map_in_order(count, |index| {
        let found = corners_of(dataset, &dataset.entries[index], cancel);
        progress(done.fetch_add(1, Ordering::Relaxed) + 1, count);
        found
    });
    let views = dataset
        .entries
        .iter()
        .zip(corners)
        .map(|(entry, corners)| {
            Ok(ObservedView {
                name: entry.name.clone(),
                base_from_tip: entry.base_from_tip,
                corners: corners.unwrap_or(Err(ObserveError::Cancelled))?,
                tip_by_joint: entry.tip_by_joint.clone(),
                camera_from_target: entry.camera_from_target,
                in_fit: true,
            })
        })
        .collect::<Result<Vec<_>, ObserveError>>()?;
    Ok(Observations {
        mode: dataset.mode,
        target: dataset.target,
        // Only pose pairs come without a size, and they need none.
        image_size: dataset.image_size.unwrap_or_default(),
        camera: camera_knowledge(dataset.camera.as_ref()),
        views,
    })
}

/// What a data set or a session says of its camera, for the solver.
pub fn camera_knowledge(camera: Option<&CameraInput>) -> CameraKnowledge {
    match camera {
        None => CameraKnowledge::Estimate { model: DEFAULT_MODEL, start: None },
        Some(input) => match input.intrinsics {
            Some(intrinsics) if input.fixed => CameraKnowledge::Fixed(intrinsics),
            start => CameraKnowledge::Estimate { model: input.model, start },
        },
    }
}

fn corners_of(dataset: &Dataset, entry: &Entry, cancel: &CancelToken) -> Result<Option<Vec<Corner>>, ObserveError> {
    if cancel.is_cancelled() {
        return Err(ObserveError::Cancelled);
    }
    if let Some(corners) = &entry.corners {
        return Ok((!corners.is_empty()).then(|| corners.clone()));
    }
    if entry.image_path.is_none() {
        return Ok(None);
    }
    let image = dataset.load_gray(entry)?;
    vision::detect(&image, &dataset.target).map_err(|source| ObserveError::Vision { name: entry.name.clone(), source })
}
