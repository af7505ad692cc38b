//! Findings on a lens that was given.

use super::{Finding, FindingCode, Severity};
use crate::RefutedLens;
use crate::diagnose::Calibration;
use crate::resolution;
use handeye_wording::{shown, text};

pub fn findings(calibration: &Calibration) -> impl Iterator<Item = Finding> {
    taken_as_exact(calibration).into_iter().chain(beyond_accuracy(calibration))
}

/// Ratio of the error with a lens that is good to half a pixel to the stated one, from which the latter depends on the lens: its
/// square is then doubled.
const MUCH: f64 = std::f64::consts::SQRT_2;

/// The stated error depends on the lens.
fn taken_as_exact(calibration: &Calibration) -> Option<Finding> {
    let joint = calibration.joint.as_ref()?;
    let (at_half_m, stated_m) = (joint.error_at_half_a_pixel_95_m?, calibration.error_95_m(&joint.reference_point)?);
    if at_half_m < MUCH * stated_m || !resolution::is_resolved(at_half_m, 0.0) {
        return None;
    }
    let text = text!(
        "The lens given is taken as exact. If each of its parameters is good to half a pixel, as those of data sheets and other \
         programs are, the expected error is {error} mm. Say how good it is (`accuracy_px` in `[camera]`, *Accuracy* of the intrinsics), or let it be estimated.",
        error = shown(at_half_m * 1e3, 2)
    );
    let finding = Finding::new(FindingCode::LensTakenAsExact, Severity::Info, text);
    Some(finding.with("expected_error_at_half_a_pixel", at_half_m * 1e3, "mm"))
}

/// The lens that fits is farther from the one given than its stated accuracy.
fn beyond_accuracy(calibration: &Calibration) -> Option<Finding> {
    let RefutedLens { accuracy_px, off_px } = calibration.joint.as_ref()?.refuted_lens?;
    let text = text!(
        "The lens given is said to be good to {accuracy} px, and the one that fits displaces points of the image by {off} px, RMS: the answer \
         is by the lens that the views alone show. Give that of this camera at this image size, or let it be estimated.",
        accuracy = shown(accuracy_px, 2),
        off = shown(off_px, 2)
    );
    let finding = Finding::new(FindingCode::WrongIntrinsics, Severity::Warning, text);
    Some(finding.with("lens_accuracy", accuracy_px, "px").with("lens_off", off_px, "px"))
}
