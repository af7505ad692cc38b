//! A convex polygon and its moments.

use nalgebra::{Matrix2, Vector2};

/// How far the ends of an edge can be from where they are expected before anything is known, pixels.
const FURTHEST_PX: f64 = 3.0;
/// Resolution of rasterisers, pixels: vertices are rounded to a 256th, and so are coordinates of textures.
const RASTER_PX: f64 = 0.004;

/// Number of standard deviations of a Gaussian that are used.
const WITHIN: f64 = 6.0;
/// Slices are taken in this many parts.
const PANELS: u32 = 3;
/// Gauss's rule of six points from 0 to 1: places and weights.
const GAUSS: [(f64, f64); 6] = [
    (0.033_765_242_898_424, 0.085_662_246_189_585),
    (0.169_395_306_766_868, 0.180_380_786_524_069),
    (0.380_690_406_958_402, 0.233_956_967_286_346),
    (0.619_309_593_041_598, 0.233_956_967_286_346),
    (0.830_604_693_233_132, 0.180_380_786_524_069),
    (0.966_234_757_101_576, 0.085_662_246_189_585),
];

/// The possible places of the two ends of an edge, given the lines that it must pass between.
#[derive(Debug, Clone)]
pub(super) struct Polygon {
    corners: Vec<Vector2<f64>>,
}

/// Mean and covariance of the displacements of both ends.
#[derive(Debug, Clone, Copy)]
pub(super) struct Moments {
    pub mean: Vector2<f64>,
    pub covariance: Matrix2<f64>,
}

impl Polygon {
    pub fn unbounded() -> Self {
        let f = FURTHEST_PX;
        Self { corners: vec![Vector2::new(-f, -f), Vector2::new(f, -f), Vector2::new(f, f), Vector2::new(-f, f)] }
    }

    /// Cuts off all points with `along · point > most` (Sutherland & Hodgman 1974).
    pub fn cut(&mut self, along: Vector2<f64>, most: f64) {
        let beyond: Vec<f64> = self.corners.iter().map(|corner| along.dot(corner) - most).collect();
        if beyond.iter().all(|by| *by <= 0.0) {
            return;
        }
        let mut left = Vec::with_capacity(self.corners.len() + 1);
        for i in 0..self.corners.len() {
            let next = (i + 1) % self.corners.len();
            if beyond[i] <= 0.0 {
                left.push(self.corners[i]);
            }
            if (beyond[i] <= 0.0) != (beyond[next] <= 0.0) {
                let part = beyond[i] / (beyond[i] - beyond[next]);
                left.push(self.corners[i] + (self.corners[next] - self.corners[i]) * part);
            }
        }
        self.corners = left;
    }

    /// Moments of a point that is uniformly distributed in it; `None` when it is empty.
    pub fn moments(&self) -> Option<Moments> {
        let first = *self.corners.first()?;
        let (mut area, mut sum, mut squares) = (0.0, Vector2::zeros(), Matrix2::zeros());
        for pair in self.corners[1..].windows(2) {
            // A fan of triangles; moments about the first corner, which keeps digits.
            let (a, b) = (pair[0] - first, pair[1] - first);
            let twice = a.perp(&b);
            area += twice;
            sum += (a + b) * (twice / 3.0);
            let both = a + b;
            squares += (a * a.transpose() + b * b.transpose() + both * both.transpose()) * (twice / 12.0);
        }
        if area <= 0.0 {
            return None;
        }
        let mean = sum / area;
        let covariance = squares / area - mean * mean.transpose() + Matrix2::identity() * (RASTER_PX * RASTER_PX);
        Some(Moments { mean: first + mean, covariance })
    }

    /// Moments of a Gaussian point that is known to be in it, by Gauss's rule over slices; `None` where the two hardly
    /// overlap.
    pub fn moments_of(&self, gaussian: &Moments) -> Option<Moments> {
        let sigma = gaussian.covariance.m11.sqrt();
        let range = |values: &mut dyn Iterator<Item = f64>| {
            values.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), v| (low.min(v), high.max(v)))
        };
        let (left, right) = range(&mut self.corners.iter().map(|corner| corner.x));
        let (left, right) = (left.max(gaussian.mean.x - WITHIN * sigma), right.min(gaussian.mean.x + WITHIN * sigma));
        if left >= right {
            return None;
        }
        // Along the second axis a Gaussian given the first, cut off by the polygon, has moments in closed form.
        let [along, across] = [gaussian.covariance.m11, gaussian.covariance.m22];
        let slope = gaussian.covariance.m12 / along;
        let given = (across - slope * gaussian.covariance.m12).max(0.0).sqrt();
        let (mut total, mut sum, mut squares) = (0.0, Vector2::zeros(), Matrix2::zeros());
        for panel in 0..PANELS {
            let width = (right - left) / f64::from(PANELS);
            for (node, weight) in GAUSS {
                let x = left + width * (f64::from(panel) + node);
                let off = x - gaussian.mean.x;
                let middle = slope * off;
                let (low, high) = range(&mut self.crossings(x).map(|y| y - gaussian.mean.y));
                let Some(cut) = Cut::new([low, high].map(|end| (end - middle) / given)) else { continue };
                let share = weight * cut.part * (-0.5 * off * off / along).exp();
                let mean = middle + given * cut.mean;
                total += share;
                sum += Vector2::new(off, mean) * share;
                let mixed = off * mean;
                squares += Matrix2::new(off * off, mixed, mixed, mean * mean + given * given * cut.variance) * share;
            }
        }
        if total <= f64::MIN_POSITIVE {
            return None;
        }
        let mean = sum / total;
        let covariance = squares / total - mean * mean.transpose() + Matrix2::identity() * (RASTER_PX * RASTER_PX);
        Some(Moments { mean: gaussian.mean + mean, covariance })
    }

    /// Where its outline has that first coordinate.
    fn crossings(&self, x: f64) -> impl Iterator<Item = f64> + '_ {
        let sides = self.corners.iter().zip(self.corners.iter().cycle().skip(1));
        sides
            .filter(move |(a, b)| (a.x <= x) != (b.x <= x))
            .map(move |(a, b)| a.y + (b.y - a.y) * ((x - a.x) / (b.x - a.x)))
    }
}

/// A standard normal number known to be between two ends.
struct Cut {
    /// The part of all that is there.
    part: f64,
    mean: f64,
    variance: f64,
}

impl Cut {
    /// `None` where next to nothing is there.
    fn new([low, high]: [f64; 2]) -> Option<Self> {
        if low >= high || low.is_nan() || high.is_nan() {
            return None;
        }
        // From the side on which the tail is, where differences keep their digits.
        if low > 0.0 {
            let Self { part, mean, variance } = Self::new([-high, -low])?;
            return Some(Self { part, mean: -mean, variance });
        }
        let below = |end: f64| 0.5 * libm::erfc(-end * std::f64::consts::FRAC_1_SQRT_2);
        let part = below(high) - below(low);
        if part <= f64::MIN_POSITIVE {
            return None;
        }
        let density = |end: f64| {
            if end.is_finite() { (-0.5 * end * end).exp() / (2.0 * std::f64::consts::PI).sqrt() } else { 0.0 }
        };
        let (at_low, at_high) = (density(low), density(high));
        let mean = (at_low - at_high) / part;
        let weighted = |end: f64, density: f64| if density > 0.0 { end * density } else { 0.0 };
        let variance = 1.0 + (weighted(low, at_low) - weighted(high, at_high)) / part - mean * mean;
        // Between ends that are close it is all rounding: uniform.
        let narrow = (high - low) * (high - low) / 12.0;
        let (mean, variance) = if high - low < 1e-3 { (0.5 * (low + high), narrow) } else { (mean, variance.max(0.0)) };
        Some(Self { part, mean, variance })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Against sums over a fine lattice.
    #[test]
    fn moments_of_a_gaussian_in_a_polygon_are_those_of_sums_over_a_lattice() {
        let mut polygon = Polygon::unbounded();
        polygon.cut(Vector2::new(0.8, 0.2), 0.4);
        polygon.cut(Vector2::new(-0.3, -0.7), 0.35);
        polygon.cut(Vector2::new(0.1, 0.9), 0.3);
        for (mean, sigma, correlation) in [
            ([0.0, 0.0], [0.5, 0.4], 0.0),
            // Much narrower than the polygon, in its middle and cut off.
            ([0.1, 0.05], [0.03, 0.02], 0.9),
            ([0.2, 0.3], [0.04, 0.03], -0.5),
            // Wider, and strongly correlated.
            ([-0.5, 0.6], [0.6, 0.6], -0.98),
        ] {
            let mixed: f64 = correlation * sigma[0] * sigma[1];
            let covariance = Matrix2::new(sigma[0].powi(2), mixed, mixed, sigma[1].powi(2));
            let gaussian = Moments { mean: Vector2::from(mean), covariance };
            let precision = covariance.try_inverse().expect("regular");
            let (mut total, mut sum, mut squares) = (0.0, Vector2::zeros(), Matrix2::zeros());
            let inside = |at: &Vector2<f64>| {
                at.amax() < FURTHEST_PX
                    && 0.8 * at.x + 0.2 * at.y < 0.4
                    && -0.3 * at.x - 0.7 * at.y < 0.35
                    && 0.1 * at.x + 0.9 * at.y < 0.3
            };
            for i in 0..900 {
                for j in 0..900 {
                    let unit = Vector2::new(f64::from(i) - 449.5, f64::from(j) - 449.5) / 75.0;
                    let off = unit.component_mul(&Vector2::from(sigma));
                    if inside(&(gaussian.mean + off)) {
                        let share = (-0.5 * off.dot(&(precision * off))).exp();
                        total += share;
                        sum += off * share;
                        squares += off * off.transpose() * share;
                    }
                }
            }
            let mean = sum / total;
            let expected = squares / total - mean * mean.transpose();
            let found = polygon.moments_of(&gaussian).expect("they meet");
            let raster = Matrix2::identity() * RASTER_PX * RASTER_PX;
            let off = (found.mean - gaussian.mean - mean).norm();
            assert!(off < 0.02 * expected.trace().sqrt(), "{off} of {expected}");
            let off = (found.covariance - raster - expected).norm() / expected.norm();
            assert!(off < 0.05, "{off} of {expected}");
        }
    }
}
