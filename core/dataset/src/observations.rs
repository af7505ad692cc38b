//! The one way from a dataset folder to what a calibration is made from.

use super::{CameraInput, Dataset};
use handeye_estimate::{CameraKnowledge, KnownLens, Observations, ObservedView};
use handeye_geometry::targets::observation::Corners;

impl CameraInput {
    /// Knowledge of the camera of a data set or a session with this table, or without one.
    pub fn knowledge(camera: Option<&Self>) -> CameraKnowledge {
        match camera {
            None => CameraKnowledge::NOTHING,
            Some(input) => match input.intrinsics {
                Some(intrinsics) if input.fixed => match input.accuracy_px {
                    None => CameraKnowledge::Fixed(intrinsics),
                    Some(accuracy_px) => CameraKnowledge::Near(KnownLens { intrinsics, accuracy_px }),
                },
                start => CameraKnowledge::Estimate { model: input.model, start },
            },
        }
    }
}

impl Dataset {
    /// The observations. Where the data set has a corner table, its corners are used; elsewhere `detected` gives those
    /// of an entry by its index, `None` when the target was not found in its image.
    pub fn observations(&self, mut detected: impl FnMut(usize) -> Option<Corners>) -> Observations {
        let views = self.entries.iter().enumerate().map(|(index, entry)| {
            let corners = match &entry.corners {
                Some(listed) => Some(listed.clone().into()).filter(|corners: &Corners| !corners.is_empty()),
                None => detected(index),
            };
            ObservedView {
                tip_from_joints: entry.tip_from_joints.clone(),
                camera_from_target: entry.camera_from_target,
                ..ObservedView::new(&entry.name, entry.base_from_tip, corners)
            }
        });
        Observations {
            mode: self.mode,
            target: self.target,
            // Only pose pairs come without a size, and they need none.
            image_size: self.image_size.unwrap_or_default(),
            camera: CameraInput::knowledge(self.camera.as_ref()),
            views: views.collect(),
        }
    }
}
