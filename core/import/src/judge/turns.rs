//! Which cases the [turns](handeye_estimate::diagnose::hypotheses::turns) rule out.

use std::collections::HashMap;

use super::cases::Case;
use super::trial::Judge;
use crate::conventions::{AngleUnit, Reading, RotationForm};
use handeye_estimate::diagnose::hypotheses::turns::{limit_rad, unlike_rad};

/// The parts of a reading that rotations depend on. Units of length, directions and places of the camera have the same.
type Rotations = (RotationForm, AngleUnit);

/// Keeps the cases with similar rotations of robot and target, the most similar where there are more than `most`; returns how
/// many are left out for that alone.
pub(super) fn keep_alike(judge: &Judge<'_>, cases: &mut Vec<Case>, most: usize) -> usize {
    let rotations = |reading: &Reading| (reading.rotation, reading.angle);
    let mut known: HashMap<(usize, Rotations, Option<Rotations>), f64> = HashMap::new();
    for case in cases.iter_mut() {
        if judge.cancel.is_cancelled() {
            return 0;
        }
        let target = case.target_reading.as_ref().map(|(reading, _)| rotations(reading));
        let key = (case.pairing, rotations(&case.reading), target);
        let unlike =
            || judge.trial(case, judge.pairing_of(case)).and_then(|it| unlike_rad(&it)).unwrap_or(f64::INFINITY);
        let unlike = *known.entry(key).or_insert_with(unlike);
        case.unlike_rad = unlike;
    }
    let limit = limit_rad(cases.iter().map(|case| case.unlike_rad).fold(f64::INFINITY, f64::min));
    cases.retain(|case| case.unlike_rad <= limit);
    let left_out = cases.len().saturating_sub(most);
    if left_out > 0 {
        cases.sort_by(|a, b| a.unlike_rad.total_cmp(&b.unlike_rad));
        cases.truncate(most);
    }
    left_out
}
