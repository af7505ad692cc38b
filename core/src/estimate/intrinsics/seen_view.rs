//! What is seen in one image.

use nalgebra::Matrix2;

use crate::targets::observation::Corner;

/// The corners of one view.
#[derive(Debug, Clone, Copy)]
pub struct SeenView<'a> {
    /// At least [`MIN_CORNERS`](crate::geometry::planar_pose::MIN_CORNERS) that do not lie on one line.
    pub corners: &'a [Corner],
    /// One matrix `W` per corner, whose residual counts as `W r`; empty where all corners count alike.
    pub sqrt_weights: &'a [Matrix2<f64>],
}

impl<'a> SeenView<'a> {
    /// A view whose corners all count alike.
    pub fn unweighted(corners: &'a [Corner]) -> Self {
        Self { corners, sqrt_weights: &[] }
    }
}
