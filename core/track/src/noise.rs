//! Noise of corners, as far as the images show it.

/// Part of what is known that the next image leaves: some ten images count.
const FORGET: f64 = 0.9;
/// Least noise of a corner [px]: the grey levels are whole numbers.
const MIN_SIGMA_PX: f64 = 0.005;
/// Larger errors of an image's corners than the calibration states are accepted as real when they would occur by chance
/// in less than one of ten thousand images.
const QUANTILE: f64 = 3.72;

/// The variance of one coordinate of a corner: as the calibration states it, or else from the residuals of the last
/// images.
#[derive(Debug, Clone)]
pub(super) struct CornerNoise {
    stated_px2: Option<f64>,
    cost_px2: f64,
    freedom: f64,
}

impl CornerNoise {
    pub fn new(stated_px: Option<f64>) -> Self {
        let usable = stated_px.filter(|sigma| sigma.is_finite() && *sigma > 0.0);
        Self { stated_px2: usable.map(|sigma| sigma * sigma), cost_px2: 0.0, freedom: 0.0 }
    }

    pub fn forget(&mut self) {
        (self.cost_px2, self.freedom) = (0.0, 0.0);
    }

    /// Takes the residuals of an image in (`cost_px2` the sum of their squares over `corners`), and returns the
    /// variance \[px²\] of its corners.
    pub fn variance(&mut self, cost_px2: f64, corners: usize) -> f64 {
        let freedom = (2.0 * corners as f64 - 6.0).max(1.0);
        self.cost_px2 = FORGET * self.cost_px2 + cost_px2;
        self.freedom = FORGET * self.freedom + freedom;
        let least = MIN_SIGMA_PX * MIN_SIGMA_PX;
        let Some(stated) = self.stated_px2 else { return (self.cost_px2 / self.freedom).max(least) };
        let own = cost_px2 / freedom;
        if own > stated * ratio_by_chance(freedom) { own } else { stated.max(least) }
    }
}

/// Value that chi-square over its degrees of freedom hardly ever exceeds. Wilson & Hilferty 1931.
fn ratio_by_chance(freedom: f64) -> f64 {
    let part = 2.0 / (9.0 * freedom);
    (1.0 - part + QUANTILE * part.sqrt()).powi(3)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_stated_noise_counts_until_an_image_contradicts_it() {
        let mut noise = CornerNoise::new(Some(0.1));
        assert_eq!(noise.variance(134.0 * 0.01 * 1.2, 70), 0.1 * 0.1);
        assert_eq!(noise.variance(134.0 * 0.04, 70), 134.0 * 0.04 / 134.0);
    }

    #[test]
    fn without_a_stated_noise_the_residuals_of_many_images_count() {
        let mut noise = CornerNoise::new(None);
        for _ in 0..100 {
            noise.variance(134.0 * 0.01, 70);
        }
        let after_one_odd_image = noise.variance(2.0 * 0.25, 4);
        assert!((after_one_odd_image - 0.01).abs() < 0.001, "{after_one_odd_image}");
    }

    #[test]
    fn the_bound_is_that_of_the_table() {
        // 99.99 % of chi-square with 100 degrees of freedom: 161.319.
        assert!((ratio_by_chance(100.0) * 100.0 - 161.319).abs() < 0.3, "{}", ratio_by_chance(100.0));
    }
}
