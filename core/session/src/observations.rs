//! The one way from the captures of a session to what a calibration is made from.

use std::collections::BTreeMap;

use nalgebra::Vector6;

use super::capture_id::CaptureId;
use super::document::{Document, Role};
use handeye_dataset::CameraInput;
use handeye_estimate::placement::PlacementError;
use handeye_estimate::{Observations, ObservedView};
use handeye_geometry::targets::observation::{Sight, View};

/// What was observed in a session.
#[derive(Debug, Clone)]
pub struct SessionObservations {
    /// What goes into the fit. Captures that were taken out of it stand in their place, as views that are not in the fit;
    /// those kept for verification are not there.
    pub observations: Observations,
    /// The captures of these views, in the same order.
    pub captures: Vec<CaptureId>,
    /// What verifies: the captures kept for it that were not taken out and in which the target was found.
    pub verification: Vec<(CaptureId, View)>,
}

impl Document {
    /// What was observed in the captures. `sights` gives what the image of a capture shows, `None` when the target was not found in it;
    /// `image_size` is width and height of the images in pixels.
    ///
    /// Joint angles are used where they belong to the poses, see [`Document::tip_by_joint`]; otherwise a line in the log
    /// says why not.
    pub fn observations(
        &self,
        image_size: (u32, u32),
        sights: impl Fn(CaptureId) -> Option<Sight>,
    ) -> SessionObservations {
        let mut tip_by_joint = self.tip_by_joint_or_none();
        let mut seen = SessionObservations {
            observations: Observations {
                mode: self.mode(),
                target: self.meta.target,
                image_size,
                camera: CameraInput::knowledge(self.meta.camera.as_ref()),
                views: Vec::new(),
            },
            captures: Vec::new(),
            verification: Vec::new(),
        };
        for capture in &self.captures {
            let sight = sights(capture.id);
            let tip_by_joint = tip_by_joint.remove(&capture.id).unwrap_or_default();
            match (capture.role, sight) {
                (Role::Calibration, sight) => {
                    let depth = sight.as_ref().and_then(|sight| sight.depth);
                    let corners = sight.map(|sight| sight.corners);
                    seen.captures.push(capture.id);
                    seen.observations.views.push(ObservedView {
                        tip_by_joint,
                        depth,
                        in_fit: capture.is_in_use(),
                        ..ObservedView::new(&capture.image, capture.base_from_tip, corners)
                    });
                }
                (Role::Verification, Some(Sight { corners, depth })) if !capture.excluded => {
                    // A camera by itself is not verified.
                    let Some(base_from_tip) = capture.base_from_tip else { continue };
                    let view = View::new(capture.image.clone(), base_from_tip, corners);
                    seen.verification.push((capture.id, View { tip_by_joint, depth, ..view }));
                }
                (Role::Verification, _) => {}
            }
        }
        seen
    }

    fn tip_by_joint_or_none(&self) -> BTreeMap<CaptureId, Vec<Vector6<f64>>> {
        self.tip_by_joint().unwrap_or_else(|why| {
            // Too few poses to tell where the arm stands are too few for an answer, which says so itself.
            if !matches!(why, PlacementError::NotPlaced(_)) {
                tracing::warn!("the joint angles are not used: {why}");
            }
            BTreeMap::new()
        })
    }
}

#[cfg(test)]
#[path = "observations_tests.rs"]
mod tests;
