//! Whether a lens model turns back within the image.

use nalgebra::{Matrix2, Matrix2x3, Vector2, Vector3};

use super::{Distortion, Intrinsics};

/// Directions from the principal point that are followed, in addition to those to the corners of the image. With
/// tangential distortion the place of a fold changes slowly with the direction.
const DIRECTIONS: u32 = 72;
/// Steps from the optical axis to 90° off it; one is a pixel or two of a usual camera.
const STEPS: u32 = 1000;

/// The lens model turns back within the image, so that pixels beyond have no ray, or that of another pixel.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error, handeye_wording::Localized)]
#[error(
    "the {model} distortion {coefficients:?} folds back {radius_px:.0} px from the principal point, inside of the image, which reaches \
     {reach_px:.0} px: that is no lens; check order and signs of the coefficients, focal lengths and image size, or \
     estimate the camera again with corners out to the edges of the image or with a lens model of fewer coefficients",
    model = distortion.name(),
    coefficients = distortion.coefficients()
)]
pub struct FoldsBack {
    /// The model with its coefficients.
    pub distortion: Distortion,
    /// Distance from the principal point at which it folds back, pixels.
    pub radius_px: f64,
    /// Distance of the farthest corner of the image, pixels.
    pub reach_px: f64,
}

impl Intrinsics {
    /// Checks that the lens model is valid all over the image: that the determinant of the derivative of the pixel by the
    /// direction is positive on the way from the optical axis to every edge. A polynomial may turn back
    /// (`d r_distorted / d r ≤ 0`), and then two rays meet in one pixel, and pixels farther out have none.
    ///
    /// Directions 90° and more off the axis are not checked: a fisheye's image is a circle whose edge is not in the
    /// model, and what is beyond is black.
    ///
    /// # Errors
    /// The fold that is nearest to the principal point.
    pub fn check_fold(&self) -> Result<(), FoldsBack> {
        if matches!(self.distortion, Distortion::None) {
            return Ok(());
        }
        let centre = Vector2::new(self.cx, self.cy);
        let (right, bottom) = (f64::from(self.width) - 0.5, f64::from(self.height) - 0.5);
        let corners = [(-0.5, -0.5), (right, -0.5), (-0.5, bottom), (right, bottom)].map(|(u, v)| Vector2::new(u, v));
        let reach_px = corners.iter().map(|corner| (corner - centre).norm()).fold(0.0, f64::max);
        let around = (0..DIRECTIONS).map(|k| std::f64::consts::TAU * f64::from(k) / f64::from(DIRECTIONS));
        let to_corners = corners.iter().map(|c| ((c.y - self.cy) / self.fy).atan2((c.x - self.cx) / self.fx));
        let folds = around.chain(to_corners).filter_map(|azimuth| self.fold_along(azimuth, reach_px));
        let nearest = folds.map(|px| (px - centre).norm()).fold(f64::INFINITY, f64::min);
        if nearest.is_finite() {
            let distortion = self.distortion;
            return Err(FoldsBack { distortion, radius_px: nearest, reach_px });
        }
        Ok(())
    }

    /// The pixel of the image at which the model turns back in a direction from the axis \[rad\].
    fn fold_along(&self, azimuth: f64, reach_px: f64) -> Option<Vector2<f64>> {
        let (across_y, across_x) = azimuth.sin_cos();
        for step in 1..STEPS {
            let (sin, cos) = (std::f64::consts::FRAC_PI_2 * f64::from(step) / f64::from(STEPS)).sin_cos();
            let ray = Vector3::new(across_x * sin, across_y * sin, cos);
            let outward = Vector3::new(across_x * cos, across_y * cos, -sin);
            let around = Vector3::new(-across_y, across_x, 0.0);
            let there = self.linearise(&ray).ok()?;
            let by_point = Matrix2x3::from(there.by_point);
            let px = Vector2::from(there.px);
            // NaN past a pole of the rational model, which is a fold too.
            let slope = Matrix2::from_columns(&[by_point * outward, by_point * around]).determinant();
            if slope.is_nan() || slope <= 0.0 {
                return self.contains(&px).then_some(px);
            }
            if (px - Vector2::new(self.cx, self.cy)).norm() > reach_px {
                return None;
            }
        }
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn camera(distortion: Distortion) -> Intrinsics {
        Intrinsics { distortion, ..Intrinsics::pinhole(640, 480, 400.0) }
    }

    /// Where `r (1 + k r²)` turns back, by hand: `r = 1/√(−3 k)`, there `2/3` of it.
    fn turning_px(k1: f64) -> f64 {
        400.0 * 2.0 / 3.0 / (-3.0 * k1).sqrt()
    }

    #[test]
    fn every_model_that_turns_back_inside_of_the_image_is_refused_with_the_radius_of_its_fold() {
        let k1 = -0.5;
        let folding = [
            Distortion::BrownConrady([k1, 0.0, 0.0, 0.0, 0.0]),
            Distortion::Rational([k1, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]),
            // The same polynomial in the angle.
            Distortion::Fisheye([k1, 0.0, 0.0, 0.0]),
        ];
        for distortion in folding {
            let Err(FoldsBack { radius_px, reach_px, .. }) = camera(distortion).check_fold() else {
                panic!("{distortion:?} folds")
            };
            // A step of the search moves the pixel by less than one where the slope vanishes.
            assert!((radius_px - turning_px(k1)).abs() < 1.0, "{distortion:?}: {radius_px}");
            assert!((reach_px - 400.0).abs() < 1e-9, "{reach_px}");
            let beyond = Vector2::new(camera(distortion).cx + radius_px + 5.0, camera(distortion).cy);
            assert!(camera(distortion).unproject(&beyond).is_err(), "no ray ends beyond the fold");
        }
    }

    #[test]
    fn a_lens_is_refused_from_the_radius_on_that_its_image_reaches() {
        // Corners of the image are 400 px away: a fold just beyond is outside the image, one just inside is not.
        for (fold_px, folds) in [(404.0, false), (396.0, true)] {
            let k1 = -(400.0f64 * 2.0 / 3.0 / fold_px).powi(2) / 3.0;
            let lens = camera(Distortion::BrownConrady([k1, 0.0, 0.0, 0.0, 0.0]));
            assert_eq!(lens.check_fold().is_err(), folds, "{fold_px}");
        }
    }

    #[test]
    fn a_fold_that_turns_out_again_is_one() {
        // k3 > 0 makes the radius grow again: every pixel has a ray, some have three.
        let lens = camera(Distortion::BrownConrady([-1.0, 0.0, 0.0, 0.0, 0.3]));
        assert!(matches!(lens.check_fold(), Err(FoldsBack { .. })));
    }

    #[test]
    fn lenses_of_real_cameras_are_not_refused() {
        for distortion in [
            Distortion::None,
            Distortion::BrownConrady([-0.21, 0.12, 0.001, -0.002, -0.02]),
            Distortion::Rational([0.4, -0.2, 0.0006, -0.0004, 0.03, 0.35, -0.15, 0.02]),
            Distortion::Fisheye([-0.02, 0.004, -0.003, 0.0005]),
        ] {
            assert_eq!(camera(distortion).check_fold(), Ok(()), "{distortion:?}");
        }
        // A fisheye that sees half of all directions and more, in a circle with black corners.
        let wide = Distortion::Fisheye([-0.02, 0.004, -0.003, 0.0005]);
        let circle = Intrinsics { distortion: wide, ..Intrinsics::pinhole(640, 480, 130.0) };
        assert_eq!(circle.check_fold(), Ok(()));
    }

    #[test]
    fn tangential_terms_count() {
        let lens = camera(Distortion::BrownConrady([0.0, 0.0, 0.0, 0.25, 0.0]));
        let Err(FoldsBack { radius_px, .. }) = lens.check_fold() else { panic!("it folds") };
        // Along x, x + 3 p₂ x² turns back where 1 + 6 p₂ x = 0, at x (1 + 3 p₂ x) = x / 2 and x = −1 / (6 p₂); the slope
        // across, 1 + 2 p₂ x, is positive there.
        assert!((radius_px - 400.0 / (12.0 * 0.25)).abs() < 1.0, "{radius_px}");
    }
}
