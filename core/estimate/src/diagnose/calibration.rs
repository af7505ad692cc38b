//! A calibration: a fit that was examined.
//!
//! A least-squares fit states the error that its own model has. Whether the data agree with that model it does not know, so a
//! [`Fit`] states no error; looking for what contradicts it does, and yields the [`Calibration`] that states one. There is no
//! other way to one (the feature `testing` has made-up ones).
//!
//! ```
//! use handeye_estimate::diagnose::Calibration;
//! use handeye_estimate::Fit;
//!
//! fn print(calibration: &Calibration) {
//!     let fit: &Fit = calibration;
//!     println!("residual {:?} px, error {:?} m", fit.rms_px, calibration.tip_error_95_m());
//! }
//! ```
//!
//! The fit states no error:
//!
//! ```compile_fail
//! use handeye_estimate::Fit;
//!
//! fn print(fit: &Fit) {
//!     println!("residual {:?} px, error {:?} m", fit.rms_px, fit.tip_error_95_m());
//! }
//! ```

use std::borrow::Cow;
use std::ops::Deref;

use nalgebra::Point3;

use super::diagnosis::Diagnosis;
use crate::handeye::joint::SmallSample;
use crate::reach_error::{Reach, ReachErrors};
use crate::robot_accuracy::ReachByAccuracy;
use crate::stated_uncertainty::{Alternative, StatedUncertainty};
use crate::{Fit, LinkCovariances, resolution};
use handeye_geometry::point_error;

/// A fit, what was found about it, and the error that may be stated for it.
#[derive(Debug, Clone)]
pub struct Calibration {
    pub(super) fit: Fit,
    pub(super) stated: StatedUncertainty,
    pub(super) reach: Option<Reach>,
    /// Set where `reach` is not known and the accuracy of the robot is.
    pub(super) reach_by_accuracy: Option<ReachByAccuracy>,
    /// Reach errors by either of the two at the target, kept because they are often needed.
    pub(super) reach_at_target: Option<ReachErrors>,
    pub(super) diagnosis: Diagnosis,
}

impl Calibration {
    /// What was found.
    pub fn diagnosis(&self) -> &Diagnosis {
        &self.diagnosis
    }

    /// What was found, without the calibration.
    pub fn into_diagnosis(self) -> Diagnosis {
        self.diagnosis
    }

    /// Which error may be stated.
    pub fn stated_uncertainty(&self) -> &StatedUncertainty {
        &self.stated
    }

    /// Expected error of a measured point where the camera saw the target, 95 %, metres: 95 % of errors are below. It
    /// counts the hand-eye transform alone; the noise of a later robot pose or image comes on top. With an arm whose joints are
    /// known it is against the arm as it really is, which is seldom what is wanted: an error that shifts all poses reported in a
    /// part of the workspace shifts the camera equally, and the tool still meets what the camera sees there, see
    /// [`Self::promised`]. With joints that are not known it is against the poses that the robot reports. Of the joint estimate
    /// only, and `None` when the data contradict themselves.
    pub fn tip_error_95_m(&self) -> Option<f64> {
        self.error_95_m(&self.joint.as_ref()?.reference_point)
    }

    /// The same at any `point`, camera coordinates in metres.
    pub fn error_95_m(&self, point: &Point3<f64>) -> Option<f64> {
        let by_poses = self.stated_of_answer().error_95_m(
            self.hand_eye_covariance()?,
            self.joint.as_ref()?.small_sample,
            point,
        )?;
        let by_arm = self.of_links_by_arm().map(|([hand_eye, _], law)| hand_eye.error_95_m(law, point));
        Some(by_arm.map_or(by_poses, |by_arm| by_poses.max(by_arm)))
    }

    /// Which error may be stated of the answer by reported poses. Findings refer to the answer that belongs to the errors of the
    /// arm where these are known.
    fn stated_of_answer(&self) -> Cow<'_, StatedUncertainty> {
        match self.fit.arm().zip(self.hand_eye.as_ref()) {
            Some((arm, answer)) => {
                Cow::Owned(self.stated.of_another(&arm.hand_eye.mount_from_camera(), &answer.mount_from_camera()))
            }
            None => Cow::Borrowed(&self.stated),
        }
    }

    /// How near a tool arrives with this arm; `None` where its joints are not known, or nothing may be stated.
    pub fn reach(&self) -> Option<&Reach> {
        self.reach.as_ref()
    }

    /// Error of the answer due to the errors of the arm, against the true pose of the camera on it, at a point where it saw the
    /// target, metres, where that is most of the stated error: more views do not lower it.
    pub(crate) fn moved_by_arm_m(&self) -> Option<f64> {
        let ([hand_eye, _], law) = self.of_links_by_arm()?;
        let point = &self.joint.as_ref()?.reference_point;
        let (moved_m, error_m) = (hand_eye.moved_m(point), self.error_95_m(point)?);
        let is_by_arm = hand_eye.error_95_m(law, point) >= error_m;
        (is_by_arm && moved_m > 0.5 * error_m).then_some(moved_m)
    }

    /// What the errors of the arm imply for both links, and how their errors are distributed; `None` where its joints are not
    /// known, and where views left out contradict them.
    fn of_links_by_arm(&self) -> Option<([Alternative; 2], SmallSample)> {
        let arm = self.fit.arm()?;
        Some((arm.of_links(self.hand_eye.as_ref()?), arm.small_sample))
    }

    /// Covariances of the two rigid links as they may be stated: those of the fit, or with an arm whose joints are known the mean
    /// squares of their errors on the true arm, whichever makes the larger error of a measured point.
    pub fn link_covariances(&self) -> Option<LinkCovariances> {
        let by_poses = self.fit.link_covariances?;
        let Some(point) = self.joint.as_ref().map(|joint| joint.reference_point) else { return Some(by_poses) };
        let by_arm = self.of_links_by_arm().map(|(links, _)| links.map(|link| link.mean_square()));
        let by_arm = by_arm.map(|[hand_eye, target]| LinkCovariances { hand_eye, target });
        let size = |links: &LinkCovariances| point_error::covariance(&links.hand_eye, &point).trace();
        Some(by_arm.filter(|by_arm| size(by_arm) > size(&by_poses)).unwrap_or(by_poses))
    }

    /// How far findings that the answer does not account for would move a point where the camera saw the target, metres: a
    /// part of [`Self::tip_error_95_m`]. `None` where nothing of the kind was found, or nothing may be stated.
    pub fn moved_m(&self) -> Option<f64> {
        let joint = self.joint.as_ref()?;
        let (covariance, law) = (self.hand_eye_covariance()?, joint.small_sample);
        let (moved_m, _) = self.stated_of_answer().parts_95_m(covariance, law, &joint.reference_point)?;
        (moved_m >= resolution::PLACE_M).then_some(moved_m)
    }

    /// The error where the camera saw the target by the noise alone, as if the model were true whatever was found, 95 %, metres.
    pub fn modelled_error_95_m(&self) -> Option<f64> {
        self.fit.modelled_error_95_m()
    }

    /// The same at any `point`, camera coordinates in metres.
    pub fn modelled_error_95_at(&self, point: &Point3<f64>) -> Option<f64> {
        self.fit.modelled_error_95_at(point)
    }
}

impl Deref for Calibration {
    type Target = Fit;

    fn deref(&self) -> &Fit {
        &self.fit
    }
}

/// Calibrations made up for tests of how they are shown.
#[cfg(any(test, feature = "testing"))]
mod made_up {
    use std::ops::DerefMut;

    use super::{Calibration, Diagnosis, Fit, StatedUncertainty};

    impl Calibration {
        /// A calibration as if nothing had been found.
        pub fn as_modelled(fit: Fit) -> Self {
            let stated = StatedUncertainty::AsModelled;
            let diagnosis = Diagnosis::default();
            Self { fit, stated, reach: None, reach_by_accuracy: None, reach_at_target: None, diagnosis }
        }

        /// The same with another stated uncertainty.
        #[must_use]
        pub fn claiming(self, stated: StatedUncertainty) -> Self {
            Self { stated, ..self }
        }
    }

    impl DerefMut for Calibration {
        fn deref_mut(&mut self) -> &mut Fit {
            &mut self.fit
        }
    }
}
