//! The seven closed-form solvers behind one trait.
//!
//! Five solve `A X = X B` over the relative motions of all pairs of views, two solve `A X = Z B` over the views
//! themselves; [`all`] lists them. They follow the variants that OpenCV's `calibrateHandEye` and
//! `calibrateRobotWorldHandEye` use and agree with version 4.14 to 1e-9; where a file here departs from OpenCV, it is
//! in a case that OpenCV answers wrongly or not at all, and its documentation states that.
//!
//! None of them weights its data, so none is the final estimate: they start the joint estimation, and their
//! disagreement shows how well the views determine the answer. With exact data all are exact. With noise, most depend
//! on choices that should not matter: on the choice of the origin or the axes of a frame, and the methods over pairs,
//! which take each pair in one direction only, on the order of the views:
//!
//! | method | anchor | mount | camera | target | order of views |
//! | --- | --- | --- | --- | --- | --- |
//! | `tsai_lenz` | free | origin and axes matter | origin and axes matter | free | matters for the translation |
//! | `park_martin` | free | free | origin matters | free | matters for the translation |
//! | `horaud` | free | free | origin matters | free | matters for the translation |
//! | `andreff` | free | free | origin matters | free | matters |
//! | `daniilidis` | free | origin and axes matter | origin and axes matter | free | free |
//! | `shah` | origin matters | free | free | free | free |
//! | `li` | origin matters | origin matters | free | free | free |
//!
//! `andreff`, `daniilidis` and `li` also depend on the unit of length, which is the metre here.

mod andreff;
mod daniilidis;
mod horaud;
mod li;
mod linear;
mod pairing;
mod park_martin;
mod shah;
mod tsai_lenz;

pub use andreff::Andreff;
pub use daniilidis::Daniilidis;
pub use horaud::Horaud;
pub use li::Li;
pub use park_martin::ParkMartin;
pub use shah::Shah;
pub use tsai_lenz::TsaiLenz;

use super::{HandEyeError, PosePair, motion};
use handeye_geometry::frames::{Anchor, Camera, Mount, Pose, Target};
use handeye_geometry::se3;

/// Result of a closed form.
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
    /// Those of [`motion::analyse`] and [`HandEyeError::NotFinite`] for a target pose, before anything is solved;
    /// [`HandEyeError::NoSolution`] when the method fails although the robot poses are sufficient, see each method.
    fn solve(&self, pairs: &[PosePair]) -> Result<ClosedFormSolution, HandEyeError>;
}

/// The seven methods, those for `A X = X B` first.
pub fn all() -> [&'static dyn ClosedForm; 7] {
    [&TsaiLenz, &ParkMartin, &Horaud, &Andreff, &Daniilidis, &Shah, &Li]
}

/// The method with that [name](ClosedForm::name), for instance `"park_martin"`; `None` when there is none.
pub fn by_name(name: &str) -> Option<&'static dyn ClosedForm> {
    all().into_iter().find(|method| method.name() == name)
}

/// Checks the views of a closed form; the first step of every method.
fn check(views: &[PosePair]) -> Result<(), HandEyeError> {
    let anchor_from_mount: Vec<_> = views.iter().map(|view| view.anchor_from_mount).collect();
    motion::analyse(&anchor_from_mount)?;
    match views.iter().position(|view| !view.camera_from_target.is_finite()) {
        Some(index) => Err(HandEyeError::NotFinite { index }),
        None => Ok(()),
    }
}

/// Completes `mount_from_camera` with the mean over the views of where it puts the target.
fn with_mean_target(
    method: &Method,
    views: &[PosePair],
    mount_from_camera: Pose<Mount, Camera>,
) -> Result<ClosedFormSolution, HandEyeError> {
    let anchor_from_target: Vec<_> = views
        .iter()
        .map(|view| *(view.anchor_from_mount * mount_from_camera * view.camera_from_target).isometry())
        .collect();
    let mean = se3::mean_pose(&anchor_from_target).ok_or_else(|| method.fails("there are no views"))?;
    method.finite(ClosedFormSolution { mount_from_camera, anchor_from_target: Pose::from_isometry(mean) })
}

/// Name of the method and number of views, for its errors.
struct Method {
    name: &'static str,
    views: usize,
}

impl Method {
    fn fails(&self, reason: &'static str) -> HandEyeError {
        HandEyeError::NoSolution { method: self.name, views: self.views, reason }
    }

    /// Returns a solution unless it overflowed.
    fn finite(&self, solution: ClosedFormSolution) -> Result<ClosedFormSolution, HandEyeError> {
        if solution.mount_from_camera.is_finite() && solution.anchor_from_target.is_finite() {
            Ok(solution)
        } else {
            Err(self.fails("the numbers overflow, check the length unit of the poses"))
        }
    }
}

#[cfg(test)]
mod tests;
