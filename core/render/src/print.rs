//! A print with displaced corners.

/// Displacements of the nodes of a chessboard from the grid: the inner corners, and around them those on the outline of
/// the print. Between nodes the print is stretched bilinearly, so that the sides of squares are straight from corner to
/// corner.
#[derive(Debug, Clone, PartialEq)]
pub struct PrintErrors {
    columns: usize,
    rows: usize,
    /// Printed minus ideal place in squares, row by row, nodes −1 to `columns` and −1 to `rows`.
    by_node: Vec<[f64; 2]>,
}

impl PrintErrors {
    /// The displacement of each node in squares, along the columns and along the rows. `at` is called for the nodes
    /// (−1, −1) to (`columns`, `rows`); the first inner corner is (0, 0).
    pub fn new(columns: usize, rows: usize, at: impl Fn(i64, i64) -> [f64; 2]) -> Self {
        let nodes = (-1..=rows as i64).flat_map(|row| (-1..=columns as i64).map(move |column| (column, row)));
        Self { columns, rows, by_node: nodes.map(|(column, row)| at(column, row)).collect() }
    }

    /// Printed minus ideal place of an inner corner, in squares.
    pub fn of_corner(&self, column: usize, row: usize) -> [f64; 2] {
        self.by_node[(row + 1) * (self.columns + 2) + column + 1]
    }

    /// The point of the grid that was printed at a place. Displacements are hundredths of a square and change from node
    /// to node by as much, so that three insertions leave a millionth.
    pub(super) fn on_grid(&self, place: [f64; 2]) -> [f64; 2] {
        let mut point = place;
        for _ in 0..3 {
            let [ds, dr] = self.between_nodes(point);
            point = [place[0] - ds, place[1] - dr];
        }
        point
    }

    /// The displacement of a point of the grid; beyond the outline that of the outline.
    fn between_nodes(&self, [s, r]: [f64; 2]) -> [f64; 2] {
        let (s, column) = cell(s, self.columns);
        let (r, row) = cell(r, self.rows);
        let width = self.columns + 2;
        let node = |down: usize, right: usize| self.by_node[(row + down) * width + column + right];
        let [a, b, c, d] = [node(0, 0), node(0, 1), node(1, 0), node(1, 1)];
        std::array::from_fn(|i| (1.0 - r) * ((1.0 - s) * a[i] + s * b[i]) + r * ((1.0 - s) * c[i] + s * d[i]))
    }
}

/// The place between two nodes, 0 to 1, and the index of the first of them, for nodes −1 to `last`.
fn cell(value: f64, last: usize) -> (f64, usize) {
    let from_first = (value + 1.0).clamp(0.0, (last + 1) as f64);
    let index = (from_first as usize).min(last);
    (from_first - index as f64, index)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_node_is_found_where_it_was_printed_and_points_between_on_straight_sides() {
        let off =
            |c: i64, r: i64| [0.01 * (3.0 * c as f64 + r as f64).sin(), 0.008 * (c as f64 - 2.0 * r as f64).cos()];
        let errors = PrintErrors::new(4, 3, off);
        for (c, r) in [(-1, -1), (0, 0), (2, 1), (3, 2), (4, 3)] {
            let [ds, dr] = off(c, r);
            let [s, t] = errors.on_grid([c as f64 + ds, r as f64 + dr]);
            assert!((s - c as f64).abs() < 1e-6 && (t - r as f64).abs() < 1e-6, "node {c} {r} at {s} {t}");
        }
        assert_eq!(errors.of_corner(2, 1), off(2, 1));
        let [[as_, ar], [bs, br]] = [off(1, 1), off(2, 1)];
        let middle = errors.on_grid([1.5 + 0.5 * (as_ + bs), 1.0 + 0.5 * (ar + br)]);
        assert!((middle[0] - 1.5).abs() < 1e-6 && (middle[1] - 1.0).abs() < 1e-6, "{middle:?}");
    }
}
