//! A convex polygon and its moments.

use nalgebra::{Matrix2, Vector2};

/// How far the ends of an edge can be from where they are expected before anything is known, pixels.
const FURTHEST_PX: f64 = 3.0;
/// What no rasteriser resolves, pixels: vertices are rounded to a 256th, and so are coordinates of textures.
const RASTER_PX: f64 = 0.004;

/// How many standard deviations of a Gaussian count.
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

/// What is left of the places of two ends of an edge by lines that it must pass between.
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

    /// Those of a point that is anywhere in it with equal probability; `None` when nothing is left.
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

    /// Those of a point that is Gaussian and known to be in it, by Gauss's rule in slices; `None` where the two have next
    /// to nothing in common.
    pub fn moments_of(&self, gaussian: &Moments) -> Option<Moments> {
        let precision = gaussian.covariance.try_inverse()?;
        let sigma = [gaussian.covariance.m11, gaussian.covariance.m22].map(f64::sqrt);
        let range = |values: &mut dyn Iterator<Item = f64>| {
            values.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), v| (low.min(v), high.max(v)))
        };
        let within = |(low, high): (f64, f64), axis: usize| {
            let (mean, reach) = (gaussian.mean[axis], WITHIN * sigma[axis]);
            (low.max(mean - reach), high.min(mean + reach))
        };
        let (left, right) = within(range(&mut self.corners.iter().map(|corner| corner.x)), 0);
        if left >= right {
            return None;
        }
        let (mut total, mut sum, mut squares) = (0.0, Vector2::zeros(), Matrix2::zeros());
        for panel in 0..PANELS {
            let width = (right - left) / f64::from(PANELS);
            for (node, weight) in GAUSS {
                let x = left + width * (f64::from(panel) + node);
                let (low, high) = within(range(&mut self.crossings(x)), 1);
                if low >= high {
                    continue;
                }
                for (inner, inner_weight) in GAUSS {
                    let point = Vector2::new(x, low + (high - low) * inner);
                    let off = point - gaussian.mean;
                    let share = weight * inner_weight * (high - low) * (-0.5 * off.dot(&(precision * off))).exp();
                    total += share;
                    sum += off * share;
                    squares += off * off.transpose() * share;
                }
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
