//! A smooth map from the grid to the image.

use nalgebra::{DMatrix, Matrix3, Vector2};

use crate::detect::order::Ordered;
use crate::geometry::planar_pose::homography::{homography, mapped};

/// Degree of the polynomial that lens and bend of the board may add to a homography.
const DEGREE: usize = 3;

/// Where points of the grid are in the image by what all corners say: a homography, and a polynomial for a lens and a board
/// that is not flat.
pub(super) struct SmoothMap {
    homography: Matrix3<f64>,
    columns: usize,
    rows: usize,
    /// Exponents of the terms.
    terms: Vec<[usize; 2]>,
    /// Orthonormal over the corners: a row for each corner, a column for each term.
    basis: DMatrix<f64>,
    /// The basis from the powers: `basis = powers · to_basis`.
    to_basis: DMatrix<f64>,
    /// What the polynomial adds, by basis function.
    added: Vec<Vector2<f64>>,
}

impl SmoothMap {
    /// `None` where no homography fits.
    pub fn of(found: &Ordered) -> Option<Self> {
        let (columns, rows) = (found.columns, found.rows());
        let place = |index: usize| Vector2::new((index % columns) as f64, (index / columns) as f64);
        let pairs: Vec<_> = found.points.iter().enumerate().map(|(index, px)| (place(index), *px)).collect();
        let homography = homography(&pairs)?;
        let terms: Vec<[usize; 2]> = (0..=DEGREE)
            .flat_map(|sum| (0..=sum).map(move |j| [sum - j, j]))
            .filter(|[i, j]| *i < columns && *j < rows)
            .collect();
        let powers = DMatrix::from_fn(pairs.len(), terms.len(), |row, term| {
            power(unit_place(pairs[row].0, columns, rows), terms[term])
        });
        let qr = powers.qr();
        let to_basis = qr.r().try_inverse()?;
        let mut map = Self { homography, columns, rows, terms, basis: qr.q(), to_basis, added: Vec::new() };
        let left: Vec<Vector2<f64>> = pairs.iter().map(|(place, px)| px - mapped(&homography, *place)).collect();
        map.added = map
            .basis
            .column_iter()
            .map(|column| column.iter().zip(&left).map(|(value, left)| left * *value).sum())
            .collect();
        Some(map)
    }

    /// Where a point of the grid is in the image, pixels. Beyond the corners the polynomial stays what it is at the last:
    /// it is a fit and no law.
    pub fn at(&self, column: f64, row: f64) -> Vector2<f64> {
        let place = Vector2::new(column, row);
        let inside = Vector2::new(column.clamp(0.0, (self.columns - 1) as f64), row.clamp(0.0, (self.rows - 1) as f64));
        let unit = unit_place(inside, self.columns, self.rows);
        let powers = self.terms.iter().map(|term| power(unit, *term));
        let powers = nalgebra::DVector::from_iterator(self.terms.len(), powers);
        let basis = self.to_basis.tr_mul(&powers);
        let added: Vector2<f64> = basis.iter().zip(&self.added).map(|(value, by)| by * *value).sum();
        mapped(&self.homography, place) + added
    }

    /// The mean distance of neighbouring corners, pixels.
    pub fn square_px(&self) -> f64 {
        let (right, bottom) = ((self.columns - 1) as f64, (self.rows - 1) as f64);
        let [a, b, c, d] = [self.at(0.0, 0.0), self.at(right, 0.0), self.at(right, bottom), self.at(0.0, bottom)];
        0.25 * (((b - a).norm() + (c - d).norm()) / right + ((d - a).norm() + (c - b).norm()) / bottom)
    }

    /// Displacements along one axis that the map could have taken up, orthonormal: a row for each corner.
    pub fn smooth_displacements(&self) -> &DMatrix<f64> {
        &self.basis
    }
}

/// Columns and rows from −1 to 1.
fn unit_place(place: Vector2<f64>, columns: usize, rows: usize) -> Vector2<f64> {
    let unit = |value: f64, count: usize| 2.0 * value / (count as f64 - 1.0) - 1.0;
    Vector2::new(unit(place.x, columns), unit(place.y, rows))
}

fn power(at: Vector2<f64>, [i, j]: [usize; 2]) -> f64 {
    at.x.powi(i as i32) * at.y.powi(j as i32)
}
