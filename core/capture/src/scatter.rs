//! Scatter of corners from image to image.

use std::collections::BTreeMap;

use nalgebra::Vector2;

use handeye_geometry::targets::observation::Corner;

/// Collects the corners of several images of a scene at rest.
#[derive(Debug, Clone, Default)]
pub struct Scatter {
    images: u32,
    /// Count, mean, and sum of squared distances to the mean per axis. Welford 1962, "Note on a method for calculating
    /// corrected sums of squares and products".
    corners: BTreeMap<usize, (u32, Vector2<f64>, Vector2<f64>)>,
}

impl Scatter {
    /// Number of images below which a scatter is not meaningful.
    pub const LEAST_IMAGES: u32 = 3;

    /// Adds the corners of an image.
    pub fn add(&mut self, corners: &[Corner]) {
        self.images += 1;
        for corner in corners {
            let (count, mean, squares) = self.corners.entry(corner.index).or_default();
            *count += 1;
            let before = corner.px - *mean;
            *mean += before / f64::from(*count);
            *squares += before.component_mul(&(corner.px - *mean));
        }
    }

    /// Estimates the standard deviation of a corner in one image \[px\], per axis and pooled over corners and axes:
    ///
    /// `σ² = Σ (u − ū)² / Σ (n − 1)`
    ///
    /// with the sums over all corners and both axes, the mean of each corner and axis of its own, and `n` the images
    /// that the corner was found in. The variance is unbiased; its relative error is about √(2 / Σ (n − 1)). It covers
    /// differences from image to image (noise, vibration), not errors that are common to all of them. `None` with fewer
    /// than three images.
    pub fn sigma_px(&self) -> Option<f64> {
        let freedom: u32 = self.corners.values().map(|(count, ..)| 2 * (count - 1)).sum();
        let squares: f64 = self.corners.values().map(|(.., squares)| squares.sum()).sum();
        (self.images >= Self::LEAST_IMAGES && freedom > 0).then(|| (squares / f64::from(freedom)).sqrt())
    }
}
