//! Sub-pixel place of a chessboard corner as the saddle point of its intensities.
//!
//! Around a corner the image of four squares is unchanged by half a turn, whatever the perspective and the blur: both
//! edges are lines through the corner. A quadratic fitted with weights centred on the corner therefore has its
//! stationary point exactly there, and fitting again with the weights moved to the last answer converges to it.
//!
//! It knows no profile of an edge, and so it serves where blur is less than a pixel's own width and the profile is that
//! of the pixel grid.
//!
//! Reference: Lucchese & Mitra 2002, "Using saddle points for subpixel feature detection in camera calibration targets".

use image::GrayImage;
use nalgebra::{SMatrix, SVector, Vector2};

/// Weights fall to one standard deviation at this part of the distance to the next corner.
const SIGMA_PER_SPACING: f64 = 0.16;
/// Below this many pixels the fit has too few samples, above it sees mostly the flat inside of the squares.
const SIGMA_PX: (f64, f64) = (1.1, 3.0);
/// The window reaches this many standard deviations.
const REACH: f64 = 2.5;
/// Most fits per corner.
const FITS: usize = 12;
/// A fit that moves less than this has converged.
const CONVERGED_PX: f64 = 1e-5;
/// A corner that ends further than this part of the spacing from its start was no saddle.
const FURTHEST: f64 = 0.12;

/// The saddle point near `start`, for a corner whose nearest neighbour is `spacing` pixels away; `None` where there is
/// no saddle.
pub fn refine(image: &GrayImage, start: &Vector2<f64>, spacing: f64) -> Option<Vector2<f64>> {
    let sigma = (SIGMA_PER_SPACING * spacing).clamp(SIGMA_PX.0, SIGMA_PX.1);
    let mut at = *start;
    for _ in 0..FITS {
        let step = saddle_of(image.as_raw(), image.dimensions(), &at, sigma)?;
        at += step;
        if (at - start).norm() > (FURTHEST * spacing).max(0.5) {
            return None;
        }
        if step.norm() < CONVERGED_PX {
            break;
        }
    }
    Some(at)
}

/// Offset from `at` to the saddle of `f = a x² + b xy + c y² + d x + e y + g`, fitted by weighted least squares.
fn saddle_of(pixels: &[u8], (width, height): (u32, u32), at: &Vector2<f64>, sigma: f64) -> Option<Vector2<f64>> {
    let reach = REACH * sigma;
    let (left, top) = ((at.x - reach).ceil(), (at.y - reach).ceil());
    let (right, bottom) = ((at.x + reach).floor(), (at.y + reach).floor());
    let inside = left >= 0.0 && top >= 0.0 && right < f64::from(width) && bottom < f64::from(height);
    if !inside {
        return None;
    }
    let mut normal = SMatrix::<f64, 6, 6>::zeros();
    let mut rhs = SVector::<f64, 6>::zeros();
    for v in top as usize..=bottom as usize {
        let line = pixels.get(v * width as usize..(v + 1) * width as usize)?;
        for (u, level) in line.iter().enumerate().take(right as usize + 1).skip(left as usize) {
            let (x, y) = (u as f64 - at.x, v as f64 - at.y);
            let r2 = x * x + y * y;
            if r2 > reach * reach {
                continue;
            }
            let weight = (-0.5 * r2 / (sigma * sigma)).exp();
            let row = SVector::<f64, 6>::new(x * x, x * y, y * y, x, y, 1.0);
            normal.ger(weight, &row, &row, 1.0);
            rhs.axpy(weight * f64::from(*level), &row, 1.0);
        }
    }
    let f = normal.cholesky()?.solve(&rhs);
    let (a, b, c, d, e) = (f[0], f[1], f[2], f[3], f[4]);
    let determinant = 4.0 * a * c - b * b;
    // A saddle curves up one way and down the other.
    (determinant < 0.0).then(|| Vector2::new(b * e - 2.0 * c * d, b * d - 2.0 * a * e) / determinant)
}
