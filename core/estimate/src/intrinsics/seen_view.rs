//! What is seen in one image.

use handeye_geometry::targets::observation::Corner;
use handeye_geometry::view_equations::Whitener;

/// The corners of one view.
#[derive(Debug, Clone, Copy)]
pub struct SeenView<'a> {
    /// At least [`MIN_CORNERS`](handeye_geometry::planar_pose::MIN_CORNERS) that do not lie on one line.
    pub corners: &'a [Corner],
    /// Their weights.
    pub whitener: &'a Whitener,
}

impl<'a> SeenView<'a> {
    /// A view whose corners all have equal weights.
    pub fn unweighted(corners: &'a [Corner]) -> Self {
        Self { corners, whitener: &Whitener::Alike }
    }
}
