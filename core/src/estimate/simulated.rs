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
        Observations {
            mode: Some(self.mode),
            target: BOARD,
            image_size: (self.intrinsics.width, self.intrinsics.height),
            camera,
            views: self.views.iter().map(ObservedView::from).collect(),
        }
    }
}
