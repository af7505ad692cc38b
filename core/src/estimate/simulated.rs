//! Observations of simulated chains, for tests.

use super::{CameraKnowledge, Observations, ObservedView};
use crate::estimate::handeye::joint::simulated::{BOARD, Trial};
use crate::geometry::camera::Distortion;

impl Trial {
    /// The views as observed, with the camera given or to be estimated without distortion.
    pub fn observations(&self, free_intrinsics: bool) -> Observations {
        let camera = if free_intrinsics {
            CameraKnowledge::Estimate { model: Distortion::None, start: None }
        } else {
            CameraKnowledge::Fixed(self.intrinsics)
        };
        let observed = |view: &crate::targets::observation::View| ObservedView {
            name: view.name.clone(),
            base_from_tip: Some(view.base_from_tip),
            corners: Some(view.corners.clone()),
            tip_by_joint: Vec::new(),
            camera_from_target: None,
            in_fit: true,
        };
        Observations {
            mode: Some(self.mode),
            target: BOARD,
            image_size: (self.intrinsics.width, self.intrinsics.height),
            camera,
            views: self.views.iter().map(observed).collect(),
        }
    }
}
