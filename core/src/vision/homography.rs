//! Homographies of a plane from points of it.

use nalgebra::{DMatrix, Matrix2, Matrix3, Vector2, Vector3};

/// The map of the plane that takes the first point of every pair to the second, by least squares of the algebraic
/// error; `None` for fewer than four pairs, or when they lie on a line.
///
/// Both sets are moved to their mean and scaled to unit size before, without which the numbers would span ten orders.
/// Reference: Hartley 1997, "In defense of the eight-point algorithm"; Hartley & Zisserman 2004, algorithm 4.2.
pub(super) fn homography(pairs: &[(Vector2<f64>, Vector2<f64>)]) -> Option<Matrix3<f64>> {
    if pairs.len() < 4 {
        return None;
    }
    let from = normalising(pairs.iter().map(|(a, _)| *a))?;
    let to = normalising(pairs.iter().map(|(_, b)| *b))?;
    let mut rows = DMatrix::<f64>::zeros((2 * pairs.len()).max(9), 9);
    for (i, (a, b)) in pairs.iter().enumerate() {
        let (a, b) = (mapped(&from, *a), mapped(&to, *b));
        let row = [a.x, a.y, 1.0];
        for k in 0..3 {
            rows[(2 * i, k)] = row[k];
            rows[(2 * i, 6 + k)] = -b.x * row[k];
            rows[(2 * i + 1, 3 + k)] = row[k];
            rows[(2 * i + 1, 6 + k)] = -b.y * row[k];
        }
    }
    let svd = rows.svd(false, true);
    let least = svd.singular_values.imin();
    // The second smallest is zero when the points leave more than one map.
    let second = svd.singular_values.iter().enumerate().filter(|(i, _)| *i != least).map(|(_, s)| *s);
    if second.fold(f64::INFINITY, f64::min) < 1e-6 {
        return None;
    }
    let h = svd.v_t?.row(least).transpose();
    let normalised = Matrix3::new(h[0], h[1], h[2], h[3], h[4], h[5], h[6], h[7], h[8]);
    let map = to.try_inverse()? * normalised * from;
    map.iter().all(|x| x.is_finite()).then_some(map)
}

/// Where the map takes a point; infinite for a point of its horizon.
pub(super) fn mapped(map: &Matrix3<f64>, p: Vector2<f64>) -> Vector2<f64> {
    let q = map * Vector3::new(p.x, p.y, 1.0);
    Vector2::new(q.x, q.y) / q.z
}

/// How the image of a point moves with the point.
pub(super) fn jacobian(map: &Matrix3<f64>, p: Vector2<f64>) -> Matrix2<f64> {
    let q = map * Vector3::new(p.x, p.y, 1.0);
    let at = Vector2::new(q.x, q.y) / q.z;
    Matrix2::from_fn(|i, j| (map[(i, j)] - at[i] * map[(2, j)]) / q.z)
}

/// The best map without perspective: steadier than [`homography`] where few noisy points lead far outside of them.
pub(super) fn affinity(pairs: &[(Vector2<f64>, Vector2<f64>)]) -> Option<Matrix3<f64>> {
    let mut normal = Matrix3::zeros();
    let mut rhs = [Vector3::zeros(); 2];
    for (a, b) in pairs {
        let row = Vector3::new(a.x, a.y, 1.0);
        normal += row * row.transpose();
        for axis in 0..2 {
            rhs[axis] += row * b[axis];
        }
    }
    let inverse = normal.try_inverse()?;
    let (u, v) = (inverse * rhs[0], inverse * rhs[1]);
    Some(Matrix3::new(u.x, u.y, u.z, v.x, v.y, v.z, 0.0, 0.0, 1.0))
}

/// Moves points to their mean and scales them to a mean distance of 1.
fn normalising(points: impl Iterator<Item = Vector2<f64>> + Clone) -> Option<Matrix3<f64>> {
    let n = points.clone().count() as f64;
    let mean = points.clone().sum::<Vector2<f64>>() / n;
    let size = points.map(|p| (p - mean).norm()).sum::<f64>() / n;
    let usable = size.is_finite() && size > 0.0;
    let s = 1.0 / size;
    usable.then(|| Matrix3::new(s, 0.0, -s * mean.x, 0.0, s, -s * mean.y, 0.0, 0.0, 1.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_homography_is_recovered_from_its_points_and_its_slope_is_its_derivative() {
        let truth = Matrix3::new(800.0, 30.0, 320.0, -20.0, 760.0, 240.0, 0.4, -0.2, 1.0);
        let points = (0..12).map(|i| Vector2::new(f64::from(i % 4) * 0.03, f64::from(i / 4) * 0.03));
        let pairs: Vec<_> = points.map(|p| (p, mapped(&truth, p))).collect();
        let found = homography(&pairs).expect("determined");
        let at = Vector2::new(0.2, -0.1);
        assert!((mapped(&found, at) - mapped(&truth, at)).norm() < 1e-6);
        let step = Vector2::new(1e-6, 2e-6);
        let moved = mapped(&truth, at + step) - mapped(&truth, at - step);
        assert!((jacobian(&found, at) * step * 2.0 - moved).norm() < 1e-3 * moved.norm());
    }

    #[test]
    fn points_on_a_line_give_no_homography() {
        let pairs: Vec<_> = (0..6).map(|i| Vector2::new(f64::from(i), 2.0 * f64::from(i))).map(|p| (p, p)).collect();
        assert!(homography(&pairs).is_none());
        assert!(homography(&pairs[..3]).is_none());
    }
}
