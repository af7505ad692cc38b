//! Residual distortion of a lens beyond its model: a smooth field of displacements over the image.
//!
//! `measured = project(point) + field(measured)`, where both components of the field are polynomials of one total degree,
//! products of Legendre polynomials in the two coordinates of the image, each from −1 to 1 and of mean square one.

use nalgebra::Vector2;

/// Displacement of an image point that the lens model does not describe.
#[derive(Debug, Clone, PartialEq)]
pub struct ResidualDistortion {
    /// Width and height of the image, pixels.
    size: (u32, u32),
    degree: usize,
    /// Coefficients of each function along x, and then along y, pixels.
    coefficients: Vec<f64>,
}

/// Highest degree that is read from a file.
pub const MOST_DEGREES: usize = 100;

/// Number of polynomials of two variables up to a total degree.
pub const fn functions(degree: usize) -> usize {
    (degree + 1) * (degree + 2) / 2
}

/// The polynomials up to a degree at a place of the image, by increasing total degree: those of a lower degree come
/// first. Beyond the image they have the values at its edge.
pub fn basis(size: (u32, u32), degree: usize, px: &Vector2<f64>) -> Vec<f64> {
    let along = |at: f64, length: u32| {
        // Pixel centres are whole numbers.
        let half = f64::from(length) / 2.0;
        legendre(degree, ((at + 0.5 - half) / half).clamp(-1.0, 1.0))
    };
    let (x, y) = (along(px.x, size.0), along(px.y, size.1));
    (0..=degree).flat_map(|total| (0..=total).map(move |i| (i, total - i))).map(|(i, j)| x[i] * y[j]).collect()
}

/// Legendre polynomials up to a degree, of mean square one from −1 to 1.
fn legendre(degree: usize, x: f64) -> Vec<f64> {
    let mut plain = vec![1.0, x];
    for n in 1..degree {
        let k = n as f64;
        plain.push(((2.0 * k + 1.0) * x * plain[n] - k * plain[n - 1]) / (k + 1.0));
    }
    plain.truncate(degree + 1);
    plain.iter().enumerate().map(|(n, p)| p * (2.0 * n as f64 + 1.0).sqrt()).collect()
}

impl ResidualDistortion {
    /// A field with these coefficients \[px\]: those of the displacement along x of every function, and then those
    /// along y.
    pub fn new(size: (u32, u32), degree: usize, coefficients: Vec<f64>) -> Self {
        Self { size, degree, coefficients }
    }

    /// Total degree of the polynomials.
    pub fn degree(&self) -> usize {
        self.degree
    }

    /// Coefficients of each function along x, and then along y, pixels.
    pub fn coefficients(&self) -> &[f64] {
        &self.coefficients
    }

    /// Displacement of a point that is measured at `px` from its place by the lens model, pixels.
    pub fn at(&self, px: &Vector2<f64>) -> Vector2<f64> {
        let basis = basis(self.size, self.degree, px);
        let (along_x, along_y) = self.coefficients.split_at(basis.len());
        let sum = |coefficients: &[f64]| basis.iter().zip(coefficients).map(|(b, c)| b * c).sum();
        Vector2::new(sum(along_x), sum(along_y))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_functions_are_orthogonal_over_the_image_and_those_of_a_lower_degree_come_first() {
        let (size, degree) = ((160, 120), 5);
        let count = functions(degree);
        let mut products = vec![0.0; count * count];
        for (x, y) in (0..160).flat_map(|x| (0..120).map(move |y| (x, y))) {
            let at = basis(size, degree, &Vector2::new(f64::from(x), f64::from(y)));
            assert_eq!(at[..functions(3)], basis(size, 3, &Vector2::new(f64::from(x), f64::from(y))));
            for (k, product) in products.iter_mut().enumerate() {
                *product += at[k / count] * at[k % count] / (160.0 * 120.0);
            }
        }
        for (k, product) in products.iter().enumerate() {
            let wanted = if k / count == k % count { 1.0 } else { 0.0 };
            // The mean over pixels is not the integral: off by the square of 1 / 120 times the slope of a product.
            assert!((product - wanted).abs() < 0.02, "{k}: {product}");
        }
    }

    #[test]
    fn a_field_is_the_documented_sum() {
        let field = ResidualDistortion::new((640, 480), 1, vec![0.1, 0.2, 0.3, -0.1, 0.0, 0.5]);
        let px = Vector2::new(100.0, 400.0);
        let (a, b) = ((100.5) / 320.0 - 1.0, 400.5 / 240.0 - 1.0);
        let root = 3.0f64.sqrt();
        let wanted = Vector2::new(0.1 + 0.2 * root * b + 0.3 * root * a, -0.1 + 0.5 * root * a);
        assert!((field.at(&px) - wanted).norm() < 1e-14);
        assert_eq!(field.at(&Vector2::new(-50.0, 239.5)), field.at(&Vector2::new(-0.5, 239.5)), "as at the edge");
    }
}
