//! OpenCV's refinement of corners, for those whose image our own model does not fit; and the error function.

use image::GrayImage;
use nalgebra::Vector2;
use opencv::core::{Size, TermCriteria, TermCriteria_EPS, TermCriteria_MAX_ITER};

use crate::VisionError;
use crate::bridge::{failed, from_points2f, mat_from_gray, to_points2f};
use crate::order::Ordered;

/// Half window as a part of the distance to the nearest neighbour: pixels further out see the next corner.
const WINDOW_PER_SPACING: f64 = 0.4;
/// Half windows that `cornerSubPix` is given, in pixels: less than 2 has no gradient, more gains nothing.
const WINDOW_PX: (i32, i32) = (2, 10);

/// OpenCV's gradient-orthogonality refinement, with a window matched to the squares around each corner.
pub(crate) fn corner_sub_pix(image: &GrayImage, order: &Ordered) -> Result<Ordered, VisionError> {
    let mat = mat_from_gray(image)?;
    let criteria = TermCriteria { typ: TermCriteria_EPS + TermCriteria_MAX_ITER, max_count: 40, epsilon: 1e-3 };
    let mut out = order.clone();
    let window = |index: usize| {
        let spacing = order.spacing(index % order.columns, index / order.columns);
        ((WINDOW_PER_SPACING * spacing) as i32).clamp(WINDOW_PX.0, WINDOW_PX.1)
    };
    for half in WINDOW_PX.0..=WINDOW_PX.1 {
        let members: Vec<usize> = (0..order.points.len()).filter(|&i| window(i) == half).collect();
        if members.is_empty() {
            continue;
        }
        let points: Vec<Vector2<f64>> = members.iter().map(|&i| order.points[i]).collect();
        let mut refined = to_points2f(&points);
        opencv::imgproc::corner_sub_pix(&mat, &mut refined, Size::new(half, half), Size::new(-1, -1), criteria)
            .map_err(failed("refine corners"))?;
        for (&i, point) in members.iter().zip(from_points2f(&refined)) {
            out.points[i] = point;
        }
    }
    Ok(out)
}

/// erf(x) to 1.5·10⁻⁷ and its derivative. Abramowitz & Stegun 1964, 7.1.26.
pub fn erf_and_slope(x: f64) -> (f64, f64) {
    const A: [f64; 5] = [0.254829592, -0.284496736, 1.421413741, -1.453152027, 1.061405429];
    let gauss = (-x * x).exp();
    let t = 1.0 / (1.0 + 0.3275911 * x.abs());
    let poly = t * (A[0] + t * (A[1] + t * (A[2] + t * (A[3] + t * A[4]))));
    ((1.0 - poly * gauss).copysign(x), gauss * std::f64::consts::FRAC_2_SQRT_PI)
}

#[cfg(test)]
#[path = "subpixel_tests.rs"]
mod tests;
