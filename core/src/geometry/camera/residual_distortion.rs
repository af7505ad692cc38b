//! What a lens does beyond its model: a smooth field of displacements over the image.
//!
//! `measured = project(point) + field(measured)`, where both components of the field are polynomials of one total degree,
//! products of Legendre polynomials in the two coordinates of the image, each from −1 to 1 and of mean square one.

use nalgebra::Vector2;

/// Displacement of an image point by what the lens model does not follow.
#[derive(Debug, Clone, PartialEq)]
pub struct ResidualDistortion {
    /// Width and height of the image, pixels.
    size: (u32, u32),
    degree: usize,
    /// Of each function along x, and then along y, pixels.
    coefficients: Vec<f64>,
}

/// Highest degree that is read from a file.
pub const MOST_DEGREES: usize = 100;

/// Number of polynomials of two variables up to a total degree.
pub const fn functions(degree: usize) -> usize {
    (degree + 1) * (degree + 2) / 2
}

/// The polynomials up to a degree at a place of the image, in rising total degree: those of a lower degree come first.
/// Beyond the image they are what they are at its edge.
pub(crate) fn basis(size: (u32, u32), degree: usize, px: &Vector2<f64>) -> Vec<f64> {
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
    /// By its coefficients \[px\]: those of the displacement along x of every function, and then those along y.
    pub(crate) fn new(size: (u32, u32), degree: usize, coefficients: Vec<f64>) -> Self {
        Self { size, degree, coefficients }
    }

    /// Total degree of the polynomials.
    pub fn degree(&self) -> usize {
        self.degree
    }

    /// Of each function along x, and then along y, pixels.
    pub fn coefficients(&self) -> &[f64] {
        &self.coefficients
    }

    /// How far a point that is measured at `px` lies from where the lens model puts it, pixels.
    pub fn at(&self, px: &Vector2<f64>) -> Vector2<f64> {
        let basis = basis(self.size, self.degree, px);
        let (along_x, along_y) = self.coefficients.split_at(basis.len());
        let sum = |coefficients: &[f64]| basis.iter().zip(coefficients).map(|(b, c)| b * c).sum();
        Vector2::new(sum(along_x), sum(along_y))
    }
}
