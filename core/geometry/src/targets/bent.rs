//! How a real target differs from its drawing: it bends, and its print may be a little larger or smaller.
//!
//! A point of the drawing at `(x, y, 0)` is really at `scale * (x, y, warp_x (1 − u²) + warp_y (1 − v²))`, where `u` and
//! `v` run from −1 to 1 over the extent of the target along x and y. The two warps are the deflections of the middle
//! against the edges; a target that hangs by its edges has both of one sign. It is the model of mrcal ("calobject warp"),
//! which two real boards and a rendered one were found to follow.

use nalgebra::{Point3, Vector2, Vector3};

/// The shape of a real target.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BoardShape {
    /// Deflection of the middle against the edges along x and along y, metres, positive into the board.
    pub warp_m: [f64; 2],
    /// True size over stated size.
    pub scale: f64,
}

impl BoardShape {
    /// Flat and of the stated size.
    pub const FLAT: Self = Self { warp_m: [0.0, 0.0], scale: 1.0 };
}

impl Default for BoardShape {
    fn default() -> Self {
        Self::FLAT
    }
}

/// The points of a target as drawn, ready to be bent and scaled.
#[derive(Debug, Clone, PartialEq)]
pub struct BoardPoints {
    drawn: Vec<Point3<f64>>,
    /// `1 − u²` and `1 − v²` of every point.
    sag: Vec<[f64; 2]>,
}

impl BoardPoints {
    /// Takes the points of a target in its frame, metres.
    pub fn new(points: &[Point3<f64>]) -> Self {
        let sag_along = |axis: usize| -> Vec<f64> {
            let (middle, half) = middle_and_half(points, axis);
            // A target of one row or column does not bend across it.
            let at = |v: f64| if half > 0.0 { 1.0 - ((v - middle) / half).powi(2) } else { 0.0 };
            points.iter().map(|p| at(p[axis])).collect()
        };
        let sag = sag_along(0).into_iter().zip(sag_along(1)).map(|(x, y)| [x, y]).collect();
        Self { drawn: points.to_vec(), sag }
    }

    /// The same target with its points displaced in its plane by print errors, metres.
    #[must_use]
    pub fn displaced(&self, errors_m: &[Vector2<f64>]) -> Self {
        let moved = |(point, error): (&Point3<f64>, &Vector2<f64>)| point + error.push(0.0);
        Self { drawn: self.drawn.iter().zip(errors_m).map(moved).collect(), sag: self.sag.clone() }
    }

    /// Number of points.
    pub fn len(&self) -> usize {
        self.drawn.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.drawn.is_empty()
    }

    /// Its points as drawn, in target axes, metres.
    pub fn drawn(&self) -> &[Point3<f64>] {
        &self.drawn
    }

    /// The middle of the target as drawn.
    pub fn middle(&self) -> Point3<f64> {
        let [x, y] = [0, 1].map(|axis| middle_and_half(&self.drawn, axis).0);
        Point3::new(x, y, 0.0)
    }

    /// Distance from its first to its last point along the longer side as drawn, metres.
    pub fn longer_side_m(&self) -> f64 {
        let [x, y] = [0, 1].map(|axis| 2.0 * middle_and_half(&self.drawn, axis).1);
        x.max(y)
    }

    /// True place of a point of a target with this shape, metres.
    pub fn point(&self, index: usize, shape: &BoardShape) -> Point3<f64> {
        let [x, y] = self.sag[index];
        let bent = self.drawn[index].coords + Vector3::z() * (shape.warp_m[0] * x + shape.warp_m[1] * y);
        Point3::from(bent * shape.scale)
    }

    /// The true places of all points, metres.
    pub fn points(&self, shape: &BoardShape) -> Vec<Point3<f64>> {
        (0..self.len()).map(|i| self.point(i, shape)).collect()
    }

    /// Derivatives of a point: along z by either warp, and by the scale.
    pub(crate) fn derivatives(&self, index: usize, shape: &BoardShape) -> ([f64; 2], Vector3<f64>) {
        let by_warp = self.sag[index].map(|s| s * shape.scale);
        (by_warp, self.point(index, shape).coords / shape.scale)
    }
}

/// Middle and half length of the extent of points along an axis.
fn middle_and_half(points: &[Point3<f64>], axis: usize) -> (f64, f64) {
    let range = (f64::INFINITY, f64::NEG_INFINITY);
    let (low, high) = points.iter().map(|p| p[axis]).fold(range, |(low, high), v| (low.min(v), high.max(v)));
    (0.5 * (low + high), 0.5 * (high - low))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_middle_sinks_by_both_warps_and_the_ends_stay() {
        let points: Vec<Point3<f64>> =
            (0..9).map(|i| Point3::new(f64::from(i % 3) * 0.1, f64::from(i / 3) * 0.2, 0.0)).collect();
        let board = BoardPoints::new(&points);
        let bent = BoardShape { warp_m: [0.001, 0.002], scale: 1.0 };
        assert!((board.point(4, &bent) - Point3::new(0.1, 0.2, 0.003)).norm() < 1e-15);
        assert_eq!(board.point(0, &bent), points[0]);
        assert!((board.point(1, &bent).z - 0.001).abs() < 1e-15, "halfway along x it sags by the warp of x");
        let large = BoardShape { scale: 1.01, ..bent };
        assert!((board.point(8, &large) - Point3::new(0.202, 0.404, 0.0)).norm() < 1e-15);
    }

    #[test]
    fn derivatives_match_differences() {
        const STEP: f64 = 1e-6;
        let board = BoardPoints::new(&[Point3::origin(), Point3::new(0.1, 0.03, 0.0), Point3::new(0.3, 0.2, 0.0)]);
        let shape = BoardShape { warp_m: [0.004, -0.002], scale: 1.03 };
        let (by_warp, by_scale) = board.derivatives(1, &shape);
        let at = |shape: BoardShape| board.point(1, &shape);
        for (axis, expected) in by_warp.into_iter().enumerate() {
            let mut moved = shape;
            moved.warp_m[axis] += STEP;
            let difference = (at(moved) - at(shape)) / STEP;
            assert!((difference - Vector3::z() * expected).norm() < 1e-8);
        }
        let difference = (at(BoardShape { scale: shape.scale + STEP, ..shape }) - at(shape)) / STEP;
        assert!((difference - by_scale).norm() < 1e-8);
    }
}
