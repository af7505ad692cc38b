//! The seven closed-form solvers behind one trait.

use super::{HandEyeError, PosePair};
use crate::frames::{Anchor, Camera, Mount, Pose, Target};

/// What a closed form finds.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ClosedFormSolution {
    /// The hand-eye transform.
    pub mount_from_camera: Pose<Mount, Camera>,
    /// The target's place. Solved for by the robot-world methods, the mean over the views for the others.
    pub anchor_from_target: Pose<Anchor, Target>,
}

/// A solver from pose pairs alone: no corners, no weights, no iteration over the data.
pub trait ClosedForm: Send + Sync {
    /// Name on the command line and in results, `snake_case`.
    fn name(&self) -> &'static str;

    /// Estimates both rigid links.
    ///
    /// # Errors
    /// [`HandEyeError`] when the views do not determine an answer.
    fn solve(&self, pairs: &[PosePair]) -> Result<ClosedFormSolution, HandEyeError>;
}
