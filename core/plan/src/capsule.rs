//! Capsules: the shapes that arms and their attachments are made of, and their distances from each other and from boxes.

use nalgebra::{Isometry3, Point3};

use super::surroundings::Obstacle;

/// Halvings, by the golden section, of the place along a capsule that is nearest to a box: to a 2000th of its length.
const SECTIONS: usize = 16;
/// The golden section.
const GOLDEN: f64 = 0.618_033_988_749_894_8;

/// All points within a radius of a line segment.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Capsule {
    /// One end.
    pub from: Point3<f64>,
    /// The other.
    pub to: Point3<f64>,
    /// Radius, metres.
    pub radius_m: f64,
}

impl Capsule {
    /// The same in another frame.
    #[must_use]
    pub(crate) fn moved(&self, to_frame: &Isometry3<f64>) -> Self {
        Self { from: to_frame * self.from, to: to_frame * self.to, radius_m: self.radius_m }
    }

    /// Length between its ends, metres.
    pub(crate) fn length_m(&self) -> f64 {
        (self.to - self.from).norm()
    }

    /// Distance of the surfaces, metres; below zero where they overlap.
    pub(crate) fn distance_to(&self, other: &Self) -> f64 {
        segment_distance([self.from, self.to], [other.from, other.to]) - self.radius_m - other.radius_m
    }

    /// Distance from a box, metres, with the capsule in the base; below zero where they overlap, by the depth of the overlap.
    /// Accurate to a millimetre for a link of a metre, and never too small by more than rounding.
    pub(crate) fn distance_to_box(&self, obstacle: &Obstacle) -> f64 {
        // The distance from something convex is convex along a line, so its least value is found by sections.
        let at = |part: f64| obstacle.distance_to(&(self.from + (self.to - self.from) * part));
        let (mut low, mut high) = (0.0, 1.0);
        let (mut a, mut b) = (1.0 - GOLDEN, GOLDEN);
        let (mut at_a, mut at_b) = (at(a), at(b));
        let mut least = at(0.0).min(at(1.0)).min(at_a).min(at_b);
        for _ in 0..SECTIONS {
            if at_a < at_b {
                (high, b, at_b) = (b, a, at_a);
                a = high - GOLDEN * (high - low);
                at_a = at(a);
                least = least.min(at_a);
            } else {
                (low, a, at_a) = (a, b, at_b);
                b = low + GOLDEN * (high - low);
                at_b = at(b);
                least = least.min(at_b);
            }
        }
        least - self.radius_m
    }

    /// A lower bound of [`Self::distance_to_box`], too small by no more than the length, from one evaluation: most
    /// boxes are far away.
    pub(crate) fn at_least_from_box(&self, obstacle: &Obstacle) -> f64 {
        let middle = nalgebra::center(&self.from, &self.to);
        obstacle.distance_to(&middle) - 0.5 * self.length_m() - self.radius_m
    }
}

/// Shortest distance of two line segments.
///
/// Reference: Ericson 2005, "Real-time collision detection", section 5.1.9.
fn segment_distance(first: [Point3<f64>; 2], second: [Point3<f64>; 2]) -> f64 {
    let d1 = first[1] - first[0];
    let d2 = second[1] - second[0];
    let r = first[0] - second[0];
    let (a, e, f) = (d1.norm_squared(), d2.norm_squared(), d2.dot(&r));
    // A segment of no length is a point: its parameter does not matter.
    let clamp = |numerator: f64, denominator: f64| {
        if denominator > 1e-12 { (numerator / denominator).clamp(0.0, 1.0) } else { 0.0 }
    };
    let (b, c) = (d1.dot(&d2), d1.dot(&r));
    let mut s = clamp(b * f - c * e, a * e - b * b);
    let mut t = clamp(b * s + f, e);
    s = clamp(b * t - c, a);
    t = clamp(b * s + f, e);
    ((first[0] + d1 * s) - (second[0] + d2 * t)).norm()
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;

    use super::*;

    #[test]
    fn distances_of_segments_agree_with_a_dense_search() {
        let p = |x: f64, y: f64, z: f64| Point3::new(x, y, z);
        let cases = [
            [p(0.0, 0.0, 0.0), p(1.0, 0.0, 0.0), p(0.5, 1.0, -1.0), p(0.5, 1.0, 1.0)],
            [p(0.0, 0.0, 0.0), p(1.0, 0.0, 0.0), p(2.0, 1.0, 0.0), p(3.0, 1.0, 0.0)],
            [p(0.0, 0.0, 0.0), p(1.0, 0.0, 0.0), p(0.2, 0.3, 0.0), p(0.8, 0.3, 0.0)],
            [p(0.0, 0.0, 0.0), p(0.0, 0.0, 0.0), p(0.2, 0.3, 0.0), p(0.8, -0.3, 0.4)],
            [p(0.1, 0.2, 0.3), p(-0.4, 0.5, 0.9), p(0.7, -0.6, 0.2), p(0.3, 0.8, -0.5)],
        ];
        for [a, b, c, d] in cases {
            let mut dense = f64::INFINITY;
            for i in 0..=400 {
                for j in 0..=400 {
                    let first = a + (b - a) * (f64::from(i) / 400.0);
                    let second = c + (d - c) * (f64::from(j) / 400.0);
                    dense = dense.min((first - second).norm());
                }
            }
            let exact = segment_distance([a, b], [c, d]);
            // The grid misses the nearest points by at most half its pitch on each segment.
            assert!(exact <= dense + 1e-12 && exact > dense - 0.004, "{exact} is not {dense}");
        }
    }

    #[test]
    fn distances_from_a_box_agree_with_a_dense_search_also_inside() {
        let turned = Isometry3::new(Vector3::new(0.1, 0.2, 0.3), Vector3::new(0.4, -0.7, 0.2));
        let obstacle = Obstacle::new("box", turned, [0.3, 0.2, 0.05]);
        let p = |x: f64, y: f64, z: f64| Point3::new(x, y, z);
        for [from, to] in [
            [p(0.5, 0.5, 0.5), p(-0.5, 0.4, 0.4)],
            [p(0.5, 0.5, 0.5), p(0.5, 0.5, 0.5)],
            [p(0.1, 0.2, 0.3), p(0.6, 0.2, 0.3)],
            [p(-0.4, -0.2, 0.9), p(0.2, 0.3, -0.5)],
        ] {
            let capsule = Capsule { from, to, radius_m: 0.04 };
            let dense = (0..=5000)
                .map(|k| obstacle.distance_to(&(from + (to - from) * (f64::from(k) / 5000.0))))
                .fold(f64::INFINITY, f64::min)
                - 0.04;
            let found = capsule.distance_to_box(&obstacle);
            assert!((found - dense).abs() < 1e-3, "{found} is not {dense}");
            let bound = capsule.at_least_from_box(&obstacle);
            assert!(bound <= dense + 1e-9 && bound > dense - capsule.length_m() - 1e-9);
        }
    }
}
