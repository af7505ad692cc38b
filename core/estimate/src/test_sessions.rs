//! What tests of the estimate need from a simulated session.

use handeye_geometry::se3;
use handeye_geometry::targets::bent::BoardShape;
use handeye_simulate::session::Session;
use nalgebra::Vector6;

use crate::handeye::joint::{Free, JointProblem, JointSolution, JointStart, Noise};

/// The joint estimate of a session whose links are known.
pub(crate) trait Estimated {
    /// The joint estimate's problem.
    fn problem(&self, free_intrinsics: bool, noise: Option<Noise>) -> JointProblem<'_>;
    /// A start as far off as a poor closed form: millimetres and tenths of a degree.
    fn start(&self) -> JointStart;
    /// Twist from the true link of the camera to the estimated one.
    fn hand_eye_error(&self, solution: &JointSolution) -> Vector6<f64>;
}

impl Estimated for Session {
    fn problem(&self, free_intrinsics: bool, noise: Option<Noise>) -> JointProblem<'_> {
        let free = Free { intrinsics: free_intrinsics, ..Free::default() };
        JointProblem { free, noise, ..JointProblem::new(self.mode, &self.board, &self.views) }
    }

    fn start(&self) -> JointStart {
        let off = Vector6::new(0.004, -0.003, 0.005, 0.01, -0.008, 0.006);
        JointStart {
            mount_from_camera: self.mount_from_camera.perturbed(&off),
            anchor_from_target: self.anchor_from_target.perturbed(&(-off)),
            intrinsics: self.intrinsics,
            shape: BoardShape::default(),
            noise: None,
        }
    }

    fn hand_eye_error(&self, solution: &JointSolution) -> Vector6<f64> {
        let estimated = solution.hand_eye.mount_from_camera();
        se3::log((self.mount_from_camera.inverse() * estimated).isometry())
    }
}

/// Errors of the links of a usual arm, by another convention than the estimator's: `a`, `d` \[m\], `alpha`, zero \[rad\].
pub(crate) const OFF_LINKS: [[f64; 4]; 6] = [
    [1e-4, -2e-4, 4e-4, 0.0],
    [-3e-4, 0.0, -9e-4, 1.2e-3],
    [4e-4, 1e-4, 6e-4, -8e-4],
    [0.0, 5e-4, -7e-4, 1.5e-3],
    [1e-4, -1e-4, 5e-4, -1e-3],
    [0.0, 2e-4, 0.0, 0.0],
];
