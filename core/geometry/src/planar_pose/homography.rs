//! The perspective map from a plane to a plane.

use nalgebra::{Matrix2, Matrix3, SMatrix, SymmetricEigen, Vector2, Vector3};

/// Fewest pairs that determine a map: eight numbers, two of each pair.
const MIN_PAIRS: usize = 4;
/// Points do not determine one map when the second smallest eigenvalue of the equations is less than this part of the
/// largest: less than a millionth in the equations themselves, where the rounding of pixels begins.
const MIN_DETERMINED: f64 = 1e-12;

/// The map `H` that takes the first point `p` of every pair to the second one, `q ~ H [p, 1]`, by least squares of the
/// algebraic error; `None` for fewer than four pairs, for pairs on a line, and for numbers that are not finite.
///
/// `H` is scaled such that the third number of `H [p, 1]` is positive in the middle of the first points: it is a depth
/// where the second points are rays.
///
/// # How
/// Each pair gives two equations that are linear in the nine numbers of `H`: `q_x (h₃ · m) = h₁ · m` and
/// `q_y (h₃ · m) = h₂ · m` with `m = [p, 1]` and the rows `h` of `H`. The unit vector that leaves the smallest sum of
/// squares is the eigenvector of the smallest eigenvalue of their normal matrix, which consists of four sums of `m mᵀ`.
/// Both sets of points are moved to their mean and scaled to unit size first, otherwise the numbers would span ten
/// orders; squaring the equations then costs no digits of the eigenvector, since the next eigenvalue is far away.
///
/// # Reference
/// Hartley 1997, "In defense of the eight-point algorithm"; Hartley & Zisserman 2004, algorithm 4.2.
pub fn homography(pairs: &[(Vector2<f64>, Vector2<f64>)]) -> Option<Matrix3<f64>> {
    if pairs.len() < MIN_PAIRS {
        return None;
    }
    let from = Scaling::of(pairs.iter().map(|(p, _)| *p))?;
    let to = Scaling::of(pairs.iter().map(|(_, q)| *q))?;
    let [mut plain, mut by_x, mut by_y, mut by_both] = [Matrix3::zeros(); 4];
    for (p, q) in pairs {
        let (p, q) = (from.scaled(p), to.scaled(q));
        let m = Vector3::new(p.x, p.y, 1.0);
        let square = m * m.transpose();
        plain += square;
        by_x += square * q.x;
        by_y += square * q.y;
        by_both += square * q.norm_squared();
    }
    let mut normal = SMatrix::<f64, 9, 9>::zeros();
    let on_diagonal = [(0, 0, plain), (3, 3, plain), (6, 6, by_both)];
    let beside = [(0, 6, -by_x), (6, 0, -by_x), (3, 6, -by_y), (6, 3, -by_y)];
    for (row, column, block) in on_diagonal.into_iter().chain(beside) {
        normal.fixed_view_mut::<3, 3>(row, column).copy_from(&block);
    }
    if normal.iter().any(|x| !x.is_finite()) {
        return None;
    }
    let eigen = SymmetricEigen::new(normal);
    let least = eigen.eigenvalues.imin();
    let others = eigen.eigenvalues.iter().enumerate().filter(|(i, _)| *i != least).map(|(_, value)| *value);
    if others.fold(f64::INFINITY, f64::min) <= MIN_DETERMINED * eigen.eigenvalues.max() {
        return None;
    }
    let h = eigen.eigenvectors.column(least);
    let scaled = Matrix3::new(h[0], h[1], h[2], h[3], h[4], h[5], h[6], h[7], h[8]);
    let map = to.matrix().try_inverse()? * scaled * from.matrix() * scaled.m33.signum();
    map.iter().all(|x| x.is_finite()).then_some(map)
}

/// Image of a point under the map; infinite for a point of its horizon.
pub fn mapped(map: &Matrix3<f64>, p: Vector2<f64>) -> Vector2<f64> {
    let q = map * Vector3::new(p.x, p.y, 1.0);
    Vector2::new(q.x, q.y) / q.z
}

/// Jacobian of the image of a point by the point.
pub fn jacobian(map: &Matrix3<f64>, p: Vector2<f64>) -> Matrix2<f64> {
    let q = map * Vector3::new(p.x, p.y, 1.0);
    let at = Vector2::new(q.x, q.y) / q.z;
    Matrix2::from_fn(|i, j| (map[(i, j)] - at[i] * map[(2, j)]) / q.z)
}

/// Moves points to their mean and scales them to a mean distance of 1.
struct Scaling {
    mean: Vector2<f64>,
    factor: f64,
}

impl Scaling {
    fn of(points: impl Iterator<Item = Vector2<f64>> + Clone) -> Option<Self> {
        let count = points.clone().count() as f64;
        let mean = points.clone().sum::<Vector2<f64>>() / count;
        let size = points.map(|p| (p - mean).norm()).sum::<f64>() / count;
        (size.is_finite() && size > 0.0).then(|| Self { mean, factor: 1.0 / size })
    }

    fn scaled(&self, p: &Vector2<f64>) -> Vector2<f64> {
        (p - self.mean) * self.factor
    }

    fn matrix(&self) -> Matrix3<f64> {
        let (s, shift) = (self.factor, self.mean * -self.factor);
        Matrix3::new(s, 0.0, shift.x, 0.0, s, shift.y, 0.0, 0.0, 1.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_homography_is_recovered_from_its_points_and_its_slope_is_its_derivative() {
        for sign in [1.0, -1.0] {
            let truth = Matrix3::new(800.0, 30.0, 320.0, -20.0, 760.0, 240.0, 0.4, -0.2, 1.0) * sign;
            for side in [2, 4] {
                let points = (0..side * side).map(|i| Vector2::new(f64::from(i % side), f64::from(i / side)) * 0.03);
                let pairs: Vec<_> = points.map(|p| (p, mapped(&truth, p))).collect();
                let found = homography(&pairs).expect("determined");
                assert!((found / found.m33 - truth / truth.m33).norm() < 1e-9 * truth.norm(), "{side}: {found}");
                assert!(found.m33 > 0.0, "the depth is positive");
                let at = Vector2::new(0.2, -0.1);
                let step = Vector2::new(1e-6, 2e-6);
                let moved = mapped(&truth, at + step) - mapped(&truth, at - step);
                assert!((jacobian(&found, at) * step * 2.0 - moved).norm() < 1e-6 * moved.norm());
            }
        }
    }

    #[test]
    fn points_that_leave_a_choice_give_no_homography() {
        let line: Vec<_> = (0..6).map(|i| Vector2::new(f64::from(i), 2.0 * f64::from(i))).map(|p| (p, p)).collect();
        assert!(homography(&line).is_none());
        assert!(homography(&line[..3]).is_none());
        assert!(homography(&[]).is_none());
        let corner = |x: f64, y: f64| (Vector2::new(x, y), Vector2::new(x, y));
        let three_of_four = [corner(0.0, 0.0), corner(1.0, 0.0), corner(2.0, 0.0), corner(0.0, 1.0)];
        assert!(homography(&three_of_four).is_none(), "three of four on a line");
        let mut broken = [corner(0.0, 0.0), corner(1.0, 0.0), corner(1.0, 1.0), corner(0.0, 1.0)];
        assert!(homography(&broken).is_some());
        for value in [f64::NAN, f64::INFINITY, 1e200] {
            broken[2].1.x = value;
            assert!(homography(&broken).is_none() || value == 1e200, "{value}");
        }
    }
}
