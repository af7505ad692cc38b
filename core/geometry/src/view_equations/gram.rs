//! The inner products of all columns of a tall matrix, summed as its rows arrive.

/// What one corner contributes to a column: its derivative along x and along y in the image.
pub type Pair = [f64; 2];

/// Corners that are multiplied in one batch: their columns stay in the innermost cache, and the sums in registers.
const AT_ONCE: usize = 16;

/// `JᵀJ` of a matrix with two rows per corner and `4 QUADS` columns.
///
/// The two rows are summed in parallel until the end, so that two products take one instruction on any processor, and
/// always in the same order.
pub struct Gram<const QUADS: usize> {
    corners: [[[Pair; 4]; QUADS]; AT_ONCE],
    waiting: usize,
    sums: [[[[Pair; 4]; 4]; QUADS]; QUADS],
}

impl<const QUADS: usize> Gram<QUADS> {
    pub fn new() -> Self {
        Self { corners: [[[[0.0; 2]; 4]; QUADS]; AT_ONCE], waiting: 0, sums: [[[[[0.0; 2]; 4]; 4]; QUADS]; QUADS] }
    }

    /// The columns of the next corner, to be filled in full: they hold those of an earlier one.
    pub fn next(&mut self) -> &mut [Pair] {
        if self.waiting == AT_ONCE {
            self.multiply();
        }
        self.waiting += 1;
        self.corners[self.waiting - 1].as_flattened_mut()
    }

    fn multiply(&mut self) {
        let corners = &self.corners[..self.waiting];
        for a in 0..QUADS {
            for b in a..QUADS {
                for half in [0, 2] {
                    let mut sums = [self.sums[a][b][half], self.sums[a][b][half + 1]];
                    for corner in corners {
                        let (left, right) = (&corner[a], &corner[b]);
                        for (i, sums) in sums.iter_mut().enumerate() {
                            let [x, y] = left[half + i];
                            for (sum, [u, v]) in sums.iter_mut().zip(right) {
                                sum[0] += x * u;
                                sum[1] += y * v;
                            }
                        }
                    }
                    [self.sums[a][b][half], self.sums[a][b][half + 1]] = sums;
                }
            }
        }
        self.waiting = 0;
    }

    /// Ends the sum.
    pub fn finish(&mut self) -> Products<'_, QUADS> {
        self.multiply();
        Products(&self.sums)
    }
}

/// The finished products, referenced in place: they are some kilobytes, too slow to copy for every view.
pub struct Products<'a, const QUADS: usize>(&'a [[[[Pair; 4]; 4]; QUADS]; QUADS]);

impl<const QUADS: usize> Products<'_, QUADS> {
    /// Product of two columns.
    pub fn at(&self, i: usize, j: usize) -> f64 {
        let (i, j) = (i.min(j), i.max(j));
        let [x, y] = self.0[i / 4][j / 4][i % 4][j % 4];
        x + y
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_product_is_that_of_its_two_columns() {
        // Whole numbers, so that sums are exact in any order; 37 corners are two full batches and a rest.
        let entry = |corner: usize, column: usize, row: usize| ((corner * 7 + column * 5 + row * 3) % 11) as f64 - 5.0;
        let mut gram = Gram::<3>::new();
        for corner in 0..37 {
            for (column, pair) in gram.next().iter_mut().enumerate() {
                *pair = [entry(corner, column, 0), entry(corner, column, 1)];
            }
        }
        let products = gram.finish();
        for i in 0..12 {
            for j in 0..12 {
                let expected: f64 = (0..37)
                    .flat_map(|corner| (0..2).map(move |row| entry(corner, i, row) * entry(corner, j, row)))
                    .sum();
                assert_eq!(products.at(i, j), expected, "{i} {j}");
            }
        }
    }
}
