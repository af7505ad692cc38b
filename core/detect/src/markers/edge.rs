//! An edge of a black square, and the pixels on both sides of it.

use image::GrayImage;
use nalgebra::{Matrix3, Vector2, Vector3};

use handeye_geometry::statistics::median_high;

/// Part of the steepest step from which on a step counts.
const STEEP: f64 = 0.3;
/// Least difference between both sides \[grey levels\].
const MIN_CONTRAST: f64 = 15.0;
/// Part of the crossings that must lie on the curve; the others may be covered.
pub(super) const MIN_KEPT: f64 = 0.6;

/// A curve `across = c₀ + c₁ s + c₂ s²` with `s = (along − middle) / half`.
#[derive(Debug, Clone, Copy)]
pub(super) struct Edge {
    /// The coordinate that runs along it: 0 for u, 1 for v.
    pub axis: usize,
    pub middle: f64,
    pub half: f64,
    pub curve: Vector3<f64>,
    pub covariance: Matrix3<f64>,
    /// Cosine of the angle to its axis.
    pub cos: f64,
    /// Usual difference between both sides \[grey levels\].
    pub contrast: f64,
}

impl Edge {
    /// Curvature in 1/px by its second coefficient.
    pub fn curvature_by_c2(&self) -> f64 {
        2.0 * self.cos.powi(3) / (self.half * self.half)
    }

    pub fn terms(&self, along: f64) -> Vector3<f64> {
        let s = (along - self.middle) / self.half;
        Vector3::new(1.0, s, s * s)
    }

    pub fn across(&self, along: f64) -> f64 {
        self.curve.dot(&self.terms(along))
    }

    /// Distance from the curve across it, and its gradient.
    pub fn distance(&self, p: &Vector2<f64>) -> (f64, Vector2<f64>) {
        let (along, across) = (p[self.axis], p[1 - self.axis]);
        let s = (along - self.middle) / self.half;
        let slope = (self.curve.y + 2.0 * self.curve.z * s) / self.half;
        let mut gradient = Vector2::zeros();
        gradient[self.axis] = -slope;
        gradient[1 - self.axis] = 1.0;
        (across - self.across(along), gradient)
    }

    pub fn variance(&self, p: &Vector2<f64>) -> f64 {
        let terms = self.terms(p[self.axis]);
        (self.covariance * terms).dot(&terms)
    }
}

/// The pixels on both sides of an edge.
pub(super) struct Scan<'a> {
    pub image: &'a GrayImage,
    pub first: i64,
    pub last: i64,
    /// Pixels across, on either side.
    pub reach: f64,
    /// Whether the dark side is the one of the larger coordinate.
    pub dark_beyond: bool,
}

impl Scan<'_> {
    pub fn grey(&self, axis: usize, along: i64, across: i64) -> Option<f64> {
        let (u, v) = if axis == 0 { (along, across) } else { (across, along) };
        let (u, v) = (u32::try_from(u).ok()?, u32::try_from(v).ok()?);
        self.image.get_pixel_checked(u, v).map(|p| f64::from(p.0[0]))
    }

    /// The pixels across the edge, line by line: where along, from where across, and their levels.
    fn lines(&self, edge: &Edge) -> Option<Vec<(f64, f64, Vec<f64>)>> {
        let steps = self.reach.round() as i64;
        let line = |along: i64| {
            let start = edge.across(along as f64).round() as i64 - steps;
            let levels: Option<Vec<f64>> = (0..=2 * steps).map(|k| self.grey(edge.axis, along, start + k)).collect();
            levels.map(|levels| (along as f64, start as f64, levels))
        };
        (self.first..=self.last).map(line).collect()
    }

    /// The median difference between both sides.
    pub fn contrast(&self, edge: &Edge) -> Option<f64> {
        let lines = self.lines(edge)?;
        let difference = |levels: &[f64]| Some((levels.last()? - levels.first()?).abs());
        median_high(lines.iter().filter_map(|(_, _, levels)| difference(levels)))
    }

    /// The steepest steps of the right sign on every line of pixels: along and across.
    pub fn steps(&self, edge: &Edge) -> Option<Vec<Vector2<f64>>> {
        let sign = if self.dark_beyond { -1.0 } else { 1.0 };
        let lines = self.lines(edge)?;
        let places = lines.iter().filter_map(|(along, start, levels)| {
            let steps: Vec<f64> = levels.windows(2).map(|pair| (sign * (pair[1] - pair[0])).max(0.0)).collect();
            let steepest = steps.iter().copied().fold(0.0, f64::max);
            let (mut sum, mut weight) = (0.0, 0.0);
            for (k, step) in steps.iter().enumerate().filter(|(_, step)| **step >= STEEP * steepest) {
                sum += step * (k as f64 + 0.5);
                weight += step;
            }
            (weight > 0.0).then(|| Vector2::new(*along, start + sum / weight))
        });
        Some(places.collect())
    }

    /// The crossing of the edge by the sum of every line of pixels: along and across.
    pub fn crossings(&self, edge: &Edge) -> Option<Vec<Vector2<f64>>> {
        let lines = self.lines(edge)?;
        let side = |pick: &dyn Fn(&[f64]) -> Option<f64>| {
            let values = lines.iter().filter_map(|(along, _, levels)| Some((edge.terms(*along).y, pick(levels)?)));
            Trend::of(values)
        };
        let near = side(&|levels| levels.first().copied())?;
        let beyond = side(&|levels| levels.last().copied())?;
        let crossings = lines.iter().map(|(along, start, levels)| {
            let s = edge.terms(*along).y;
            let (before, after) = (near.at(s), beyond.at(s));
            let step = before - after;
            let enough = if self.dark_beyond { step >= MIN_CONTRAST } else { -step >= MIN_CONTRAST };
            let count: f64 = levels.iter().map(|level| (level - after) / step).sum();
            enough.then(|| Vector2::new(*along, start - 0.5 + count))
        });
        let crossings: Vec<Vector2<f64>> = crossings.flatten().collect();
        (crossings.len() as f64 >= MIN_KEPT * lines.len() as f64).then_some(crossings)
    }
}

/// A level that changes evenly along an edge.
struct Trend {
    level: f64,
    slope: f64,
}

impl Trend {
    fn of(values: impl Iterator<Item = (f64, f64)> + Clone) -> Option<Self> {
        let n = values.clone().count() as f64;
        let mean_s = values.clone().map(|(s, _)| s).sum::<f64>() / n;
        let mean = values.clone().map(|(_, y)| y).sum::<f64>() / n;
        let (mut sxx, mut sxy) = (0.0, 0.0);
        for (s, y) in values {
            sxx += (s - mean_s).powi(2);
            sxy += (s - mean_s) * (y - mean);
        }
        let slope = sxy / sxx;
        slope.is_finite().then_some(Self { level: mean - slope * mean_s, slope })
    }

    fn at(&self, s: f64) -> f64 {
        self.level + self.slope * s
    }
}
