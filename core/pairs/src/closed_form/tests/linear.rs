//! The linear algebra under the methods, on matrices whose answers are known.

use nalgebra::{DMatrix, SMatrix};
use proptest::prelude::*;

use super::super::linear::{Rows, singular};

/// Rounding of sums of a few hundred numbers around 1, through a condition number of up to 100.
const ROUNDING: f64 = 1e-12;

fn rows_of(matrix: &DMatrix<f64>) -> Rows<4> {
    let mut rows = Rows::new();
    for row in matrix.row_iter() {
        rows.push(&SMatrix::<f64, 1, 4>::from_fn(|_, column| row[column]));
    }
    rows
}

proptest! {
    #[test]
    fn singular_vectors_rebuild_the_matrix_and_are_orthonormal(
        elements in prop::collection::vec(-1.0..1.0f64, 64),
        rank in 0..=8usize,
    ) {
        let mut matrix = DMatrix::from_vec(8, 8, elements);
        for column in rank..8 {
            let copy = matrix.column(column / 2) * 0.5;
            matrix.set_column(column, &copy);
        }
        let found = singular(&matrix).expect("finite");
        let right = DMatrix::from_columns(&found.right);
        let rebuilt = DMatrix::from_columns(&found.scaled_left) * right.transpose();
        prop_assert!((rebuilt - &matrix).norm() < ROUNDING);
        prop_assert!((right.transpose() * &right - DMatrix::identity(8, 8)).norm() < ROUNDING);
        prop_assert!(found.values.is_sorted_by(|a, b| a >= b));
    }

    /// Several times as many rows as are folded at once.
    #[test]
    fn least_squares_leave_a_residual_orthogonal_to_the_columns(seed in any::<u64>(), count in 3..900usize) {
        use rand::{RngExt as _, SeedableRng as _};
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(seed);
        let mut matrix = DMatrix::from_fn(count, 4, |_, _| rng.random_range(-1.0..1.0));
        for k in 0..3 {
            matrix[(k, k)] += 10.0;
        }
        let x = rows_of(&matrix).least_squares().expect("independent columns");
        let columns = matrix.columns(0, 3);
        let residual = columns * x - matrix.column(3);
        prop_assert!((columns.transpose() * residual).norm() < 1e3 * ROUNDING);
    }
}

#[test]
fn dependent_columns_and_missing_rows_have_no_least_squares_solution() {
    let dependent = DMatrix::from_fn(20, 4, |row, column| [1.0, row as f64, 2.0 * row as f64 + 3.0, 0.5][column]);
    assert!(rows_of(&dependent).least_squares().is_none());
    assert!(rows_of(&dependent.rows(0, 2).into_owned()).least_squares().is_none());
    assert!(rows_of(&DMatrix::zeros(0, 4)).least_squares().is_none());
    let huge = DMatrix::from_fn(20, 4, |row, column| f64::MAX / (1 + row * column) as f64);
    assert!(rows_of(&huge).least_squares().is_none());
}
