//! A smooth map from the grid to the image.

use nalgebra::{DMatrix, DVector, Matrix3, Vector2, Vector3};

use crate::order::Ordered;
use handeye_geometry::planar_pose::homography::{homography, mapped};

/// Degree of the polynomial that lens and bend of the board may add to a homography.
const DEGREE: usize = 3;

/// Positions of the grid's points in the image, from all corners: a homography, and a polynomial for a lens and a board
/// that is not flat where they show one.
pub(super) struct SmoothMap {
    homography: Matrix3<f64>,
    columns: usize,
    rows: usize,
    polynomial: Option<Polynomial>,
}

/// The term that is added to the homography.
struct Polynomial {
    /// Exponents of the terms.
    terms: Vec<[usize; 2]>,
    /// Orthonormal over the corners: a row for each corner, a column for each term.
    basis: DMatrix<f64>,
    /// The basis from the powers: `basis = powers · to_basis`.
    to_basis: DMatrix<f64>,
    /// Added displacement by basis function.
    added: Vec<Vector2<f64>>,
}

impl SmoothMap {
    /// `None` where no homography fits. What a polynomial would add counts from `least_squares` on, RMS per axis in squares.
    pub fn of(found: &Ordered, least_squares: f64) -> Option<Self> {
        let (columns, rows) = (found.columns, found.rows());
        let places: Vec<Vector2<f64>> = (0..found.points.len()).map(|index| place(index, columns)).collect();
        let pairs: Vec<_> = places.iter().copied().zip(found.points.iter().copied()).collect();
        let homography = homography(&pairs)?;
        let terms: Vec<[usize; 2]> = (0..=DEGREE)
            .flat_map(|sum| (0..=sum).map(move |j| [sum - j, j]))
            .filter(|[i, j]| *i < columns && *j < rows)
            .collect();
        let powers = DMatrix::from_fn(places.len(), terms.len(), |row, term| {
            power(unit_place(places[row], columns, rows), terms[term])
        });
        let qr = powers.qr();
        let (basis, to_basis) = (qr.q(), qr.r().try_inverse()?);
        let left: Vec<Vector2<f64>> = pairs.iter().map(|(place, px)| px - mapped(&homography, *place)).collect();
        let along =
            |column: nalgebra::DVectorView<'_, f64>| column.iter().zip(&left).map(|(value, left)| left * *value).sum();
        let added: Vec<Vector2<f64>> = basis.column_iter().map(along).collect();
        let squares_px2: f64 = added.iter().map(Vector2::norm_squared).sum();
        let mut map = Self { homography, columns, rows, polynomial: None };
        if (squares_px2 / (2 * places.len()) as f64).sqrt() > least_squares * map.square_px() {
            map.polynomial = Some(Polynomial { terms, basis, to_basis, added });
        }
        Some(map)
    }

    /// Where a point of the grid is in the image, pixels. Beyond the corners the polynomial keeps its value at the last
    /// one: it is a fit, not a physical model.
    pub fn at(&self, column: f64, row: f64) -> Vector2<f64> {
        let place = Vector2::new(column, row);
        let at = mapped(&self.homography, place);
        let Some(polynomial) = &self.polynomial else { return at };
        let inside = Vector2::new(column.clamp(0.0, (self.columns - 1) as f64), row.clamp(0.0, (self.rows - 1) as f64));
        at + polynomial.at(unit_place(inside, self.columns, self.rows))
    }

    /// The mean distance of neighbouring corners, pixels.
    pub fn square_px(&self) -> f64 {
        let (right, bottom) = ((self.columns - 1) as f64, (self.rows - 1) as f64);
        let [a, b, c, d] = [self.at(0.0, 0.0), self.at(right, 0.0), self.at(right, bottom), self.at(0.0, bottom)];
        0.25 * (((b - a).norm() + (c - d).norm()) / right + ((d - a).norm() + (c - b).norm()) / bottom)
    }

    /// Displacements of all corners that another map of the kind would make, orthonormal: two rows for each corner, its x and
    /// its y.
    pub fn smooth_displacements(&self) -> DMatrix<f64> {
        let corners = self.columns * self.rows;
        if let Some(Polynomial { basis, .. }) = &self.polynomial {
            let of_axis =
                |row: usize, column: usize| if row % 2 == column % 2 { basis[(row / 2, column / 2)] } else { 0.0 };
            return DMatrix::from_fn(2 * corners, 2 * basis.ncols(), of_axis);
        }
        // The derivatives by the numbers of the homography but one.
        let by_number = DMatrix::from_fn(2 * corners, 8, |row, number| {
            let at = place(row / 2, self.columns);
            let px = mapped(&self.homography, at);
            let unit = unit_place(at, self.columns, self.rows);
            let depth = (self.homography * Vector3::new(at.x, at.y, 1.0)).z;
            let weight = [unit.x, unit.y, 1.0][number % 3] / depth;
            match number / 3 {
                2 => -weight * px[row % 2],
                axis if axis == row % 2 => weight,
                _ => 0.0,
            }
        });
        by_number.qr().q()
    }
}

impl Polynomial {
    fn at(&self, unit: Vector2<f64>) -> Vector2<f64> {
        let powers = DVector::from_iterator(self.terms.len(), self.terms.iter().map(|term| power(unit, *term)));
        self.to_basis.tr_mul(&powers).iter().zip(&self.added).map(|(value, by)| by * *value).sum()
    }
}

/// Column and row of a corner.
fn place(index: usize, columns: usize) -> Vector2<f64> {
    Vector2::new((index % columns) as f64, (index / columns) as f64)
}

/// Columns and rows from −1 to 1.
fn unit_place(place: Vector2<f64>, columns: usize, rows: usize) -> Vector2<f64> {
    let unit = |value: f64, count: usize| 2.0 * value / (count as f64 - 1.0) - 1.0;
    Vector2::new(unit(place.x, columns), unit(place.y, rows))
}

fn power(at: Vector2<f64>, [i, j]: [usize; 2]) -> f64 {
    at.x.powi(i as i32) * at.y.powi(j as i32)
}
