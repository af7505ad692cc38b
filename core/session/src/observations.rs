//! The one way from the captures of a session to what a calibration is made from.

use std::collections::BTreeMap;

use super::capture_id::CaptureId;
use super::document::{Document, Role};
use handeye_dataset::CameraInput;
use handeye_estimate::placement::{ArmOfViews, Placement, PlacementError};
use handeye_estimate::reach_error::USUAL_TOOL;
use handeye_estimate::robot_accuracy::RobotAccuracy;
use handeye_estimate::{Observations, ObservedView};
use handeye_geometry::targets::observation::{Sight, View};

/// The observations of a session.
#[derive(Debug, Clone)]
pub struct SessionObservations {
    /// Input of the fit. Excluded captures keep their place, as views that are not in the fit; those kept for
    /// verification are not included.
    pub observations: Observations,
    /// The captures of these views, in the same order.
    pub captures: Vec<CaptureId>,
    /// The captures kept for verification that were not excluded and in which the target was found.
    pub verification: Vec<(CaptureId, View)>,
    /// The arm, where the joint angles of the captures are used.
    pub arm: Option<ArmOfViews>,
    /// Accuracy of the robot, where it is stated.
    pub robot_accuracy: Option<RobotAccuracy>,
}

impl Document {
    /// The observations in the captures. `sights` returns what the image of a capture shows, `None` when the target was not found
    /// in it; `image_size` is width and height of the images in pixels.
    ///
    /// Joint angles are used where they belong to the poses, see [`Document::placement`]; otherwise the log states why
    /// not.
    pub fn observations(
        &self,
        image_size: (u32, u32),
        sights: impl Fn(CaptureId) -> Option<Sight>,
    ) -> SessionObservations {
        let placement = self.placement_or_none();
        let mut tip_from_joints =
            placement.as_ref().map_or_else(BTreeMap::new, |placement| self.tip_from_joints(placement));
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
            arm: placement.map(|placement| ArmOfViews {
                placement,
                tool_m: self.meta.tool_m.unwrap_or(USUAL_TOOL),
                joints_rad: Vec::new(),
            }),
            robot_accuracy: self.meta.robot_accuracy_mm.map(|mm| RobotAccuracy::new(mm, self.meta.tool_m)),
        };
        for capture in &self.captures {
            let sight = sights(capture.id);
            let tip_from_joints = tip_from_joints.remove(&capture.id).unwrap_or_default();
            match (capture.role, sight) {
                (Role::Calibration, sight) => {
                    let depth = sight.as_ref().and_then(|sight| sight.depth);
                    let corners = sight.map(|sight| sight.corners);
                    seen.captures.push(capture.id);
                    if let Some(arm) = &mut seen.arm {
                        arm.joints_rad.push(capture.joints_rad.clone());
                    }
                    seen.observations.views.push(ObservedView {
                        tip_from_joints,
                        depth,
                        in_fit: capture.is_in_use(),
                        ..ObservedView::new(&capture.image, capture.base_from_tip, corners)
                    });
                }
                (Role::Verification, Some(Sight { corners, depth })) if !capture.excluded => {
                    // A camera by itself is not verified.
                    let Some(base_from_tip) = capture.base_from_tip else { continue };
                    let view = View::new(capture.image.clone(), base_from_tip, corners);
                    seen.verification.push((capture.id, View { tip_from_joints, depth, ..view }));
                }
                (Role::Verification, _) => {}
            }
        }
        seen
    }

    fn placement_or_none(&self) -> Option<Placement> {
        self.placement().unwrap_or_else(|why| {
            // Too few poses to determine where the arm is are too few for a result, which reports that itself.
            if !matches!(why, PlacementError::NotPlaced(_)) {
                tracing::warn!("the joint angles are not used: {why}");
            }
            None
        })
    }
}

#[cfg(test)]
#[path = "observations_tests.rs"]
mod tests;
