//! All sides together.
//!
//! The displacements of all corners are Gaussian with the prior of the print, and each side restricts those of its two ends
//! to a polygon. Each polygon is replaced by a Gaussian message such that it changes mean and covariance of its ends, given
//! all other messages, in the same way as the polygon.
//!
//! Reference: Minka 2001, "Expectation propagation for approximate Bayesian inference"; Cunningham, Hennig & Lacoste-Julien 2011,
//! "Gaussian probabilities and expectation propagation" (polyhedra).

use nalgebra::{DMatrix, Matrix2, Vector2};

use super::banded::{Banded, Factor};
use super::polygon::Moments;
use super::side::Edge;

/// Part of the way that a message goes in a round: all change at once.
const DAMPING: f64 = 0.7;

/// Squared distance, in standard deviations of both, from which a side contradicts all others: no corner may be this far
/// within the polygon of its side, so this is another edge, of an object that hides the end of the side or of its shadow.
const CONTRADICTS: f64 = 25.0;

/// Displacements of all corners, pixels.
pub(super) struct Displacements {
    all: Gaussian,
    /// Numbers of the edges that count: those that no others contradict.
    pub kept: Vec<usize>,
}

impl Displacements {
    pub fn moved(&self) -> Vec<Vector2<f64>> {
        self.all
            .mean
            .iter()
            .step_by(2)
            .zip(self.all.mean.iter().skip(1).step_by(2))
            .map(|(x, y)| Vector2::new(*x, *y))
            .collect()
    }

    /// Covariance of x and y of each corner in turn.
    pub fn covariance_px2(&self) -> DMatrix<f64> {
        self.all.factor.inverse() + self.all.open.transpose() * &self.all.open
    }
}

/// The message of a side about the displacements of its ends along its normal, as a Gaussian: precision, and precision
/// times mean. An end that is not a corner is ignored.
struct Message<'a> {
    ends: [Option<usize>; 2],
    edge: &'a Edge,
    number: usize,
    precision: Matrix2<f64>,
    weighted: Vector2<f64>,
}

/// Prior of all corners before any side is used.
pub(super) struct Expected {
    /// Displacements that a map of the board could take up, orthonormal: of them nothing is expected.
    pub smooth: DMatrix<f64>,
    /// Apart from them corners are independent, with this standard deviation per axis.
    pub print_px: f64,
    /// Columns of the grid: corners whose numbers differ by more are not neighbours.
    pub columns: usize,
}

/// The displacements of all corners, x and y of each in turn.
///
/// The precision from sides and print is banded; as smooth displacements have no prior, a matrix of low rank is subtracted from
/// it, which by the Woodbury identity adds one of the same rank to the covariance.
struct Gaussian {
    mean: Vec<f64>,
    /// Factor of the precision before the subtraction.
    factor: Factor,
    /// Its inverse within the band.
    near: DMatrix<f64>,
    /// `Oᵀ O` is added to that inverse.
    open: DMatrix<f64>,
}

/// The displacements that the edges leave; `None` when they leave something open.
pub(super) fn displacements<'a>(
    edges: impl Iterator<Item = ([Option<usize>; 2], &'a Edge)>,
    expected: &Expected,
    rounds: usize,
) -> Option<Displacements> {
    let numbered = edges.enumerate();
    let mut messages: Vec<Message<'_>> =
        numbered.filter_map(|(number, (ends, edge))| Message::first(number, ends, edge)).collect();
    let mut all = Gaussian::of(expected, &messages)?;
    while let Some(worst) = worst(&messages, &all) {
        messages.swap_remove(worst);
        all = Gaussian::of(expected, &messages)?;
    }
    for _ in 0..rounds {
        for message in &mut messages {
            message.hear(&all);
        }
        all = Gaussian::of(expected, &messages)?;
    }
    all.mean
        .iter()
        .all(|v| v.is_finite())
        .then(|| Displacements { kept: messages.iter().map(|message| message.number).collect(), all })
}

/// The message that contradicts all others most, if one does.
fn worst(messages: &[Message<'_>], all: &Gaussian) -> Option<usize> {
    let off = messages.iter().map(|message| message.contradiction(all).unwrap_or(0.0));
    let (worst, off) = off.enumerate().max_by(|(_, a), (_, b)| a.total_cmp(b))?;
    (off > CONTRADICTS).then_some(worst)
}

impl<'a> Message<'a> {
    /// From the polygon alone.
    fn first(number: usize, ends: [Option<usize>; 2], edge: &'a Edge) -> Option<Self> {
        let Moments { mean, covariance } = edge.moments;
        let precision = match ends {
            [Some(_), Some(_)] => covariance.try_inverse()?,
            [Some(_), None] => Matrix2::new(1.0 / covariance.m11, 0.0, 0.0, 0.0),
            [None, Some(_)] => Matrix2::new(0.0, 0.0, 0.0, 1.0 / covariance.m22),
            [None, None] => return None,
        };
        Some(Self { ends, edge, number, precision, weighted: precision * mean })
    }

    /// Squared distance between its message and that of all others, in standard deviations of the difference.
    fn contradiction(&self, all: &Gaussian) -> Option<f64> {
        let along = |corners: [usize; 2]| all.along(corners, &self.edge.normal);
        let both = |of_all: &Moments| {
            let others = of_all.covariance.try_inverse()? - self.precision;
            let covariance = others.try_inverse()?;
            let mean = covariance * (of_all.covariance.try_inverse()? * of_all.mean - self.weighted);
            let off = mean - self.edge.moments.mean;
            Some(off.dot(&((covariance + self.edge.moments.covariance).try_inverse()? * off)))
        };
        let one = |end: usize, corner: usize| {
            let of_all = along([corner, corner]);
            let (precision, reported) = (1.0 / of_all.covariance.m11, self.precision[(end, end)]);
            let variance = 1.0 / (precision - reported);
            let mean = variance * (precision * of_all.mean.x - self.weighted[end]);
            let off = mean - self.edge.moments.mean[end];
            Some(off * off / (variance + 1.0 / reported))
        };
        match self.ends {
            [Some(a), Some(b)] => both(&along([a, b])),
            [Some(a), None] => one(0, a),
            [None, Some(b)] => one(1, b),
            [None, None] => None,
        }
    }

    /// Updates the message from the polygon and all others about both ends. It is kept where they contradict it.
    fn hear(&mut self, all: &Gaussian) {
        let [Some(a), Some(b)] = self.ends else { return };
        let Some((precision, weighted)) = self.heard(&all.along([a, b], &self.edge.normal)) else { return };
        self.precision += (precision - self.precision) * DAMPING;
        self.weighted += (weighted - self.weighted) * DAMPING;
    }

    fn heard(&self, of_all: &Moments) -> Option<(Matrix2<f64>, Vector2<f64>)> {
        let of_all_precision = of_all.covariance.try_inverse()?;
        let others_precision = of_all_precision - self.precision;
        let others_covariance = others_precision.cholesky()?.inverse();
        let others_weighted = of_all_precision * of_all.mean - self.weighted;
        let others = Moments { mean: others_covariance * others_weighted, covariance: others_covariance };
        let both = self.edge.polygon.moments_of(&others)?;
        let both_precision = both.covariance.try_inverse()?;
        // Truncating a Gaussian does not widen it; rounding may.
        let mut eigen = (both_precision - others_precision).symmetric_eigen();
        eigen.eigenvalues.apply(|value| *value = value.max(0.0));
        Some((eigen.recompose(), both_precision * both.mean - others_weighted))
    }
}

impl Gaussian {
    fn of(expected: &Expected, messages: &[Message<'_>]) -> Option<Self> {
        let Expected { smooth, print_px, columns } = expected;
        let numbers = smooth.nrows();
        let weight = print_px.powi(-2);
        let mut precision = Banded::zeros(numbers, 2 * columns + 1);
        for i in 0..numbers {
            *precision.at_mut(i, i) = weight;
        }
        let mut weighted = DMatrix::zeros(numbers, 1);
        for Message { ends, edge, precision: of_ends, weighted: of_means, .. } in messages {
            let normal = &edge.normal;
            for (a, corner) in ends.iter().enumerate() {
                let Some(corner) = corner else { continue };
                for i in 0..2 {
                    weighted[2 * corner + i] += normal[i] * of_means[a];
                }
                for (b, other) in ends.iter().enumerate() {
                    let Some(other) = other else { continue };
                    for (i, j) in [(0, 0), (0, 1), (1, 0), (1, 1)] {
                        let (row, column) = (2 * corner + i, 2 * other + j);
                        if row >= column {
                            *precision.at_mut(row, column) += normal[i] * normal[j] * of_ends[(a, b)];
                        }
                    }
                }
            }
        }
        let factor = precision.cholesky()?;
        let spread = factor.solve(smooth.clone());
        let taken = DMatrix::identity(smooth.ncols(), smooth.ncols()) / weight - smooth.tr_mul(&spread);
        let mut open = spread.transpose();
        if !taken.cholesky()?.l_dirty().solve_lower_triangular_mut(&mut open) {
            return None;
        }
        let mean = factor.solve(weighted.clone()) + open.tr_mul(&(&open * &weighted));
        Some(Self { mean: mean.as_slice().to_vec(), near: factor.inverse_in_band(), factor, open })
    }

    /// Covariance of two numbers of the same corner or of neighbours.
    fn covariance(&self, i: usize, j: usize) -> f64 {
        self.near[(i, j)] + self.open.column(i).dot(&self.open.column(j))
    }

    /// The displacements of two corners along a direction, the same corner or neighbours.
    fn along(&self, corners: [usize; 2], direction: &Vector2<f64>) -> Moments {
        let mean = corners.map(|corner| direction.x * self.mean[2 * corner] + direction.y * self.mean[2 * corner + 1]);
        let of = |a: usize, b: usize| {
            let block = Matrix2::from_fn(|i, j| self.covariance(2 * corners[a] + i, 2 * corners[b] + j));
            direction.dot(&(block * direction))
        };
        Moments { mean: mean.into(), covariance: Matrix2::from_fn(of) }
    }
}
