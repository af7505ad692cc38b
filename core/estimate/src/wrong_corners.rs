//! From where a corner is simply wrong: one rule, for the joint estimate and for the camera alone.

use crate::resolution;
use handeye_geometry::targets::observation::Corners;

/// A corner is wrong beyond this many times the residual that nine in ten corners stay below: seven and a half standard
/// deviations of Gaussian noise.
const TIMES_COMMON: f64 = 3.5;
/// The quantile that residuals are compared with.
const COMMON: f64 = 0.9;
/// Part of a view's corners that has to remain: with fewer the view is wrong, not its corners.
const LEAST_PART: f64 = 0.5;
/// And at least this many of them, which a pose needs.
const LEAST: usize = 4;

/// The length of a residual \[px\] beyond which a corner is wrong, by the lengths of all corners; `None` without any.
pub(super) fn limit(mut lengths: Vec<f64>) -> Option<f64> {
    lengths.sort_by(f64::total_cmp);
    let common = lengths.get((COMMON * lengths.len() as f64) as usize);
    common.map(|common| (TIMES_COMMON * common).max(resolution::FINE_PX))
}

/// Whether the corners of a view that are left are enough.
pub(super) fn enough(left: usize, of: usize) -> bool {
    left as f64 >= LEAST_PART * of as f64 && left >= LEAST
}

/// The corners of a view without some, given by the index of their point, ascending.
pub(super) fn without(corners: &Corners, rejected: &[usize]) -> Corners {
    let mut left = corners.clone();
    left.retain(|corner| rejected.binary_search(&corner.index).is_err());
    left
}
