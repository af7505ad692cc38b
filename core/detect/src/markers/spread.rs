//! Whether the visible part of a target determines a pose.

use nalgebra::{Matrix2, Point3, Vector2};

use handeye_geometry::targets::observation::Corner;

/// Fewest points of a pose.
const MIN_CORNERS: usize = 4;
/// Points count as on one line when their spread across it is less than this part of that along it: no pose follows from
/// a strip so narrow.
const MIN_WIDTH: f64 = 0.02;

/// Whether there are enough corners, and not all on one line of the target.
pub(crate) fn is_enough(corners: &[Corner], point: impl Fn(usize) -> Point3<f64>) -> bool {
    if corners.len() < MIN_CORNERS {
        return false;
    }
    let points: Vec<Vector2<f64>> = corners.iter().map(|corner| point(corner.index).coords.xy()).collect();
    let mean = points.iter().sum::<Vector2<f64>>() / points.len() as f64;
    let scatter: Matrix2<f64> = points.iter().map(|p| (p - mean) * (p - mean).transpose()).sum();
    let spread = scatter.symmetric_eigenvalues();
    spread.min() > MIN_WIDTH * MIN_WIDTH * spread.max()
}
