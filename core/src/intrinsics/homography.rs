//! The perspective map from a plane to a plane.

use nalgebra::{Matrix2, Matrix3, Matrix3x2, Vector2, Vector3};

/// Middle and mean distance from it.
#[derive(Debug, Clone, Copy)]
struct Extent {
    middle: Vector2<f64>,
    size: f64,
}

impl Extent {
    fn of(points: impl Iterator<Item = Vector2<f64>> + Clone) -> Option<Self> {
        let count = points.clone().count() as f64;
        let middle = points.clone().sum::<Vector2<f64>>() / count;
        let size = (points.map(|p| (p - middle).norm_squared()).sum::<f64>() / count).sqrt();
        (size.is_finite() && size > 0.0).then_some(Self { middle, size })
    }

    fn scaled(&self, p: &Vector2<f64>) -> Vector2<f64> {
        (p - self.middle) / self.size
    }
}

/// Fits `H` with `image ~ H [on_target, 1]` by least squares on the algebraic error. The depth that `H` gives the middle
/// of the points is positive. `None` where the points determine none.
///
/// With the origin in the middle of the points on either side, `H` has 1 in its last corner and eight unknowns. Those of
/// the first two rows are eliminated, which leaves two equations for the perspective.
pub(super) fn fit(pairs: &[(Vector2<f64>, Vector2<f64>)]) -> Option<Matrix3<f64>> {
    let from = Extent::of(pairs.iter().map(|(p, _)| *p))?;
    let to = Extent::of(pairs.iter().map(|(_, p)| *p))?;
    let mut square = Matrix3::zeros();
    let (mut along, mut down) = (Matrix3x2::zeros(), Matrix3x2::zeros());
    let (mut u_sum, mut v_sum) = (Vector3::zeros(), Vector3::zeros());
    let (mut perspective, mut weight) = (Matrix2::zeros(), Vector2::zeros());
    for (p, image) in pairs {
        let (q, uv) = (from.scaled(p), to.scaled(image));
        let m = Vector3::new(q.x, q.y, 1.0);
        let mq = m * q.transpose();
        let w = uv.norm_squared();
        square += m * m.transpose();
        along += mq * uv.x;
        down += mq * uv.y;
        u_sum += m * uv.x;
        v_sum += m * uv.y;
        perspective += q * q.transpose() * w;
        weight += q * w;
    }
    let inverse = square.try_inverse()?;
    let (to_u, to_v) = (inverse * along, inverse * down);
    let left = perspective - along.transpose() * to_u - down.transpose() * to_v;
    let right = to_u.transpose() * u_sum + to_v.transpose() * v_sum - weight;
    let last = left.try_inverse()? * right;
    let first = inverse * u_sum + to_u * last;
    let second = inverse * v_sum + to_v * last;
    let scaled =
        Matrix3::from_rows(&[first.transpose(), second.transpose(), nalgebra::RowVector3::new(last.x, last.y, 1.0)]);
    let shrink = 1.0 / from.size;
    let into = Matrix3::new(shrink, 0.0, -from.middle.x * shrink, 0.0, shrink, -from.middle.y * shrink, 0.0, 0.0, 1.0);
    let back = Matrix3::new(to.size, 0.0, to.middle.x, 0.0, to.size, to.middle.y, 0.0, 0.0, 1.0);
    let all = back * scaled * into;
    all.iter().all(|v| v.is_finite()).then_some(all)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_perspective_map_is_found_from_what_it_does_to_points() {
        let truth = Matrix3::new(300.0, -40.0, 210.0, 25.0, 280.0, 190.0, 0.3, -0.2, 0.9);
        for side in [2, 3] {
            let pairs: Vec<_> = (0..side * side)
                .map(|i| {
                    let p = Vector2::new(f64::from(i % side) * 0.1 + 0.3, f64::from(i / side) * 0.13);
                    let image = truth * Vector3::new(p.x, p.y, 1.0);
                    (p, image.xy() / image.z)
                })
                .collect();
            let found = fit(&pairs).expect("determined");
            let scale = truth.m33 / found.m33;
            assert!(((found * scale) - truth).norm() < 1e-9 * truth.norm(), "{side}: {found}");
        }
    }

    #[test]
    fn points_on_one_line_determine_nothing_or_nothing_usable() {
        let pairs: Vec<_> =
            (0..6).map(|i| (Vector2::new(f64::from(i), 0.0), Vector2::new(f64::from(i), 1.0))).collect();
        assert!(fit(&pairs).is_none());
        assert!(fit(&[]).is_none());
    }
}
