//! What is seen in one image.

use crate::geometry::view_equations::Whitener;
use crate::targets::observation::Corner;

/// The corners of one view.
#[derive(Debug, Clone, Copy)]
pub struct SeenView<'a> {
    /// At least [`MIN_CORNERS`](crate::geometry::planar_pose::MIN_CORNERS) that do not lie on one line.
    pub corners: &'a [Corner],
    /// How they count.
    pub whitener: &'a Whitener,
}

impl<'a> SeenView<'a> {
    /// A view whose corners all count alike.
    pub fn unweighted(corners: &'a [Corner]) -> Self {
        Self { corners, whitener: &Whitener::Alike }
    }
}
