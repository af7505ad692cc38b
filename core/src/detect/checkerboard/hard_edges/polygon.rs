//! A convex polygon and its moments.

use nalgebra::{Matrix2, Vector2};

/// How far the ends of an edge can be from where they are expected before anything is known, pixels.
const FURTHEST_PX: f64 = 3.0;
/// What no rasteriser resolves, pixels: vertices are rounded to a 256th, and so are coordinates of textures.
const RASTER_PX: f64 = 0.004;

/// What is left of the places of two ends of an edge by lines that it must pass between.
#[derive(Debug, Clone)]
pub(super) struct Polygon {
    corners: Vec<Vector2<f64>>,
}

/// Mean and covariance of a point that is anywhere in a polygon with equal probability.
#[derive(Debug, Clone, Copy)]
pub(super) struct Moments {
    /// The direction in which both ends move, in the image.
    pub normal: Vector2<f64>,
    /// The axis along which the edge was looked for: 0 along rows, 1 along columns.
    pub cross: usize,
    /// Of both ends along it, pixels.
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

    /// `None` when nothing is left.
    pub fn moments(&self, normal: Vector2<f64>, cross: usize) -> Option<Moments> {
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
        Some(Moments { normal, cross, mean: first + mean, covariance })
    }
}
