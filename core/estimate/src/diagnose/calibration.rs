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
//! The fit has none:
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

use super::doctor::{self, Diagnosis};
use super::findings::FindingOptions;
use crate::handeye::HandEyeError;
use crate::handeye::joint::SmallSample;
use crate::reach_error::{Reach, ReachErrors};
use crate::robot_accuracy::ReachByAccuracy;
use crate::stated_uncertainty::{Alternative, StatedUncertainty};
use crate::{self as estimate, CalibrateError, Fit, LinkCovariances, Method, Observations, Options, resolution};
use handeye_geometry::point_error;
use handeye_geometry::progress::Work;

/// A fit, what was found about it, and the error that may be stated for it.
#[derive(Debug, Clone)]
pub struct Calibration {
    pub(super) fit: Fit,
    pub(super) stated: StatedUncertainty,
    pub(super) reach: Option<Reach>,
    /// Where that is not known and the accuracy of the robot is.
    pub(super) reach_by_accuracy: Option<ReachByAccuracy>,
    /// Of either, at the target: it is asked for often.
    pub(super) reach_at_target: Option<ReachErrors>,
    pub(super) diagnosis: Diagnosis,
}

/// Calibrates from observations, and examines the answer.
///
/// `work` is a `&CancelToken`, or a [`Work`] to follow the progress too. What it needs is said of [`estimate::fit`].
///
/// # Errors
/// [`CalibrateError`] says what is missing and what to do; [`HandEyeError::Cancelled`] inside it when `work` was.
pub fn calibrate<'a>(
    observations: &Observations,
    method: Method,
    work: impl Into<Work<'a>>,
) -> Result<Calibration, CalibrateError> {
    calibrate_with(observations, method, Options::default(), &FindingOptions::default(), work)
}

/// As [`calibrate`], with options and what is wanted of the answer.
///
/// # Errors
/// As [`calibrate`].
pub fn calibrate_with<'a>(
    observations: &Observations,
    method: Method,
    options: Options,
    wanted: &FindingOptions<'_>,
    work: impl Into<Work<'a>>,
) -> Result<Calibration, CalibrateError> {
    let work = work.into();
    let fit = estimate::fit_with(observations, method, options, work)?;
    examine(observations, fit, wanted, work.cancel)
}

/// Examines a fit of these observations: what contradicts it, and which error may be stated in spite of that.
///
/// # Errors
/// [`HandEyeError::Cancelled`]: half an examination states nothing.
pub fn examine<'a>(
    observations: &Observations,
    fit: Fit,
    wanted: &FindingOptions<'_>,
    work: impl Into<Work<'a>>,
) -> Result<Calibration, CalibrateError> {
    let work = work.into();
    let calibration = doctor::examined(observations, fit, wanted, &work);
    if work.is_cancelled() { Err(HandEyeError::Cancelled.into()) } else { Ok(calibration) }
}

impl Calibration {
    /// What was found.
    pub fn diagnosis(&self) -> &Diagnosis {
        &self.diagnosis
    }

    /// What was found, by itself.
    pub fn into_diagnosis(self) -> Diagnosis {
        self.diagnosis
    }

    /// Which error may be stated.
    pub fn stated_uncertainty(&self) -> &StatedUncertainty {
        &self.stated
    }

    /// Expected error of a measured point where the camera saw the target, 95 %, metres: 95 % of errors are below. It
    /// counts the hand-eye transform alone; the noise of a later robot pose or image comes on top. With an arm whose joints are known it
    /// is against the arm as it really is, which beside an arm is seldom what is wanted: what shifts all that the arm reports in a part
    /// of its workspace shifts the camera alike, and its tool meets what the camera sees there, see [`Self::promised`]. With joints that
    /// are not known it is against the poses that the robot reports. Of the joint estimate only, and `None` when the data contradict
    /// themselves.
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

    /// Which error may be stated of the answer by reported poses. What was found is counted from the answer that goes with the errors of
    /// the arm where these are known.
    fn stated_of_answer(&self) -> Cow<'_, StatedUncertainty> {
        match self.fit.arm().zip(self.hand_eye.as_ref()) {
            Some((arm, answer)) => {
                Cow::Owned(self.stated.of_another(&arm.hand_eye.mount_from_camera(), &answer.mount_from_camera()))
            }
            None => Cow::Borrowed(&self.stated),
        }
    }

    /// How near a tool arrives, and how the arm stands; `None` where its joints are not known, or nothing may be stated.
    pub fn reach(&self) -> Option<&Reach> {
        self.reach.as_ref()
    }

    /// How far the errors of the arm put the answer from where the camera really is on it, at a point where it saw the target, metres, where
    /// that is most of the stated error: more views do not lower it.
    pub(crate) fn moved_by_arm_m(&self) -> Option<f64> {
        let ([hand_eye, _], law) = self.of_links_by_arm()?;
        let point = &self.joint.as_ref()?.reference_point;
        let (moved_m, error_m) = (hand_eye.moved_m(point), self.error_95_m(point)?);
        let is_by_arm = hand_eye.error_95_m(law, point) >= error_m;
        (is_by_arm && moved_m > 0.5 * error_m).then_some(moved_m)
    }

    /// What the errors of the arm say of both links, and how their errors are distributed; `None` where its joints are not known, and
    /// where views left out contradict them.
    fn of_links_by_arm(&self) -> Option<([Alternative; 2], SmallSample)> {
        let arm = self.fit.arm()?;
        Some((arm.of_links(self.hand_eye.as_ref()?), arm.small_sample))
    }

    /// Covariances of the two rigid links as they may be stated: those of the fit, or with an arm whose joints are known the mean squares
    /// of what they are off on the arm as it really is, whichever makes the larger error of a measured point.
    pub fn link_covariances(&self) -> Option<LinkCovariances> {
        let by_poses = self.fit.link_covariances?;
        let Some(point) = self.joint.as_ref().map(|joint| joint.reference_point) else { return Some(by_poses) };
        let by_arm = self.of_links_by_arm().map(|(links, _)| links.map(|link| link.mean_square()));
        let by_arm = by_arm.map(|[hand_eye, target]| LinkCovariances { hand_eye, target });
        let size = |links: &LinkCovariances| point_error::covariance(&links.hand_eye, &point).trace();
        Some(by_arm.filter(|by_arm| size(by_arm) > size(&by_poses)).unwrap_or(by_poses))
    }

    /// How far what was found and the answer does not count on would move a point where the camera saw the target, metres: a
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

/// Made up for tests of what is shown of a calibration.
#[cfg(any(test, feature = "testing"))]
mod made_up {
    use std::ops::DerefMut;

    use super::{Calibration, Diagnosis, Fit, StatedUncertainty};

    impl Calibration {
        /// As if nothing had been found.
        pub fn as_modelled(fit: Fit) -> Self {
            let stated = StatedUncertainty::AsModelled;
            let diagnosis = Diagnosis::default();
            Self { fit, stated, reach: None, reach_by_accuracy: None, reach_at_target: None, diagnosis }
        }

        /// With another error that may be stated.
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
