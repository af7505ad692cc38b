//! The captures: where each was taken, what it is for, and its result in the calibration.

use handeye_estimate::{CornerResidual, ViewStatus};
use handeye_geometry::frames::{Base, Camera, Pose, Target};
use handeye_geometry::statistics::median_high;
use handeye_session::{CaptureId, CaptureRecord, Role};

use super::Known;
use crate::solve::state::Solved;

/// A capture whose residual is this many times that of the median one has the worst colour. It is also where a view
/// starts to be named in the findings.
pub const BAD_AT_MEDIANS: f64 = 3.0;

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum CaptureUse {
    /// It enters the fit.
    Fit,
    /// It verifies it.
    Verification,
    /// The user excluded it.
    Excluded,
    /// It is meant to be in the fit, but the answer does not use it.
    Rejected,
}

/// A capture as it is drawn.
#[derive(Debug, Clone, Copy)]
pub struct CaptureItem {
    /// Where its camera was; `None` while the camera's mounting is not known.
    pub base_from_camera: Option<Pose<Base, Camera>>,
    pub used_as: CaptureUse,
    /// RMS of its residuals \[px\].
    pub rms_px: Option<f64>,
    /// The same, as a multiple of the median of the captures with the same purpose.
    pub times_median: Option<f64>,
}

/// The result of a calibration for a capture: of its fit, or of its verification.
#[derive(Debug, Clone, Copy)]
pub struct Outcome<'a> {
    pub residuals: &'a [CornerResidual],
    /// Where its board is according to the calibration.
    pub camera_from_target: Option<Pose<Camera, Target>>,
    rms_px: Option<f64>,
    is_outlier: bool,
    verifies: bool,
}

/// The result of a calibration for a capture; `None` for one that it did not use.
pub fn outcome(solved: &Solved, id: CaptureId) -> Option<Outcome<'_>> {
    if let Some(index) = solved.captures.iter().position(|capture| *capture == id) {
        let view = solved.calibration.views.get(index)?;
        return Some(Outcome {
            residuals: &view.residuals,
            camera_from_target: view.camera_from_target,
            rms_px: view.rms_px,
            is_outlier: view.status == ViewStatus::Outlier,
            verifies: false,
        });
    }
    let index = solved.verified_captures.iter().position(|capture| *capture == id)?;
    let Some(Ok(verification)) = &solved.verification else { return None };
    let check = verification.captures.get(index)?;
    Some(Outcome {
        residuals: &check.residuals,
        camera_from_target: Some(check.predicted_camera_from_target),
        rms_px: Some(check.rms_px),
        is_outlier: false,
        verifies: true,
    })
}

/// All captures, to compare them.
#[derive(Debug, Clone, Copy)]
pub struct Captures<'a> {
    known: &'a Known,
    fit_median_px: Option<f64>,
    verified_median_px: Option<f64>,
}

impl<'a> Captures<'a> {
    /// As they are known.
    pub fn new(known: &'a Known) -> Self {
        let solved = known.solved.as_deref();
        let fit = solved.and_then(|solved| median(solved.calibration.views.iter().filter_map(|view| view.rms_px)));
        let verification = solved.and_then(|solved| solved.verification.as_ref()?.as_ref().ok());
        let verified = verification.and_then(|it| median(it.captures.iter().map(|check| check.rms_px)));
        Self { known, fit_median_px: fit, verified_median_px: verified }
    }

    /// One of them.
    pub fn item(&self, record: &CaptureRecord) -> CaptureItem {
        let outcome = self.known.solved.as_deref().and_then(|solved| outcome(solved, record.id));
        let used_as = match (record.excluded, record.role) {
            (true, _) => CaptureUse::Excluded,
            (false, Role::Verification) => CaptureUse::Verification,
            (false, Role::Calibration) if outcome.is_some_and(|outcome| outcome.is_outlier) => CaptureUse::Rejected,
            (false, Role::Calibration) => CaptureUse::Fit,
        };
        let verifies = outcome.is_some_and(|outcome| outcome.verifies);
        let median_px = if verifies { self.verified_median_px } else { self.fit_median_px };
        let rms_px = outcome.and_then(|outcome| outcome.rms_px);
        CaptureItem {
            base_from_camera: record.base_from_tip.and_then(|tip| self.known.base_from_camera(&tip)),
            used_as,
            rms_px,
            times_median: rms_px.zip(median_px).map(|(rms_px, median_px)| rms_px / median_px),
        }
    }
}

fn median(residuals_px: impl Iterator<Item = f64>) -> Option<f64> {
    median_high(residuals_px).filter(|median| *median > 0.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::sample;

    #[test]
    fn a_capture_is_aside_when_the_estimate_left_it_out_and_excluded_when_a_person_did() {
        let model = sample::with_an_outlier();
        let known = Known::of(&model);
        let captures = Captures::new(&known);
        let record = |id: CaptureId| model.document().capture(id).expect("a capture").clone();
        assert_eq!(captures.item(&record(sample::OUTLIER)).used_as, CaptureUse::Rejected);
        assert_eq!(captures.item(&record(CaptureId(1))).used_as, CaptureUse::Fit);
        let verifying = captures.item(&record(CaptureId(sample::FITTED + 1)));
        assert_eq!(verifying.used_as, CaptureUse::Verification);
        let excluded = CaptureRecord { excluded: true, ..record(sample::OUTLIER) };
        assert_eq!(captures.item(&excluded).used_as, CaptureUse::Excluded, "who took it out by hand knows");
    }

    #[test]
    fn residuals_are_compared_with_the_median_of_captures_that_are_for_the_same() {
        let model = sample::solved();
        let known = Known::of(&model);
        let captures = Captures::new(&known);
        let of = |numbers: std::ops::RangeInclusive<u32>| {
            let items = numbers.map(|n| captures.item(model.document().capture(CaptureId(n)).expect("a capture")));
            let times: Vec<f64> = items.map(|item| item.times_median.expect("solved")).collect();
            times
        };
        for times in [of(1..=sample::FITTED), of(sample::FITTED + 1..=sample::FITTED + sample::VERIFYING)] {
            assert!(times.iter().any(|times| (times - 1.0).abs() < 1e-12), "{times:?}");
        }
    }
}
