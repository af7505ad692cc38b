//! All sides together.
//!
//! The displacements of all corners are Gaussian with what is expected of the print, and each side says of those of its two
//! ends that they are in a polygon. Each polygon is replaced by a Gaussian message such that mean and covariance of what
//! all other messages leave of its ends are those that the polygon leaves of it.
//!
//! Reference: Minka 2001, "Expectation propagation for approximate Bayesian inference"; Cunningham, Hennig & Lacoste-Julien 2011,
//! "Gaussian probabilities and expectation propagation" (polyhedra).

use nalgebra::{DMatrix, DVector, Matrix2, Vector2};

use super::polygon::Moments;
use super::side::Edge;
use crate::targets::corner_covariance::lower_inverse;

/// Part of the way that a message goes in a round: all change at once.
const DAMPING: f64 = 0.7;

/// Squared distance, in standard deviations of both, from which what a side says contradicts all others: no corner may be so
/// far within the polygon of its side, so this is another edge, of what hides the end of the side or of its shadow.
const CONTRADICTS: f64 = 25.0;

/// Displacements of all corners, pixels.
pub(super) struct Displacements {
    pub moved: Vec<Vector2<f64>>,
    /// Of x and y of each in turn.
    pub covariance_px2: DMatrix<f64>,
}

/// What a side says of the displacements of its ends along its normal, as a Gaussian: precision, and precision times mean.
/// Of an end that is no corner nothing is asked.
struct Message<'a> {
    ends: [Option<usize>; 2],
    edge: &'a Edge,
    precision: Matrix2<f64>,
    weighted: Vector2<f64>,
}

/// The displacements of all corners, x and y of each in turn.
struct Gaussian {
    mean: DVector<f64>,
    covariance: DMatrix<f64>,
}

/// The displacements that the edges leave. `smooth` are those that a map of the board could take up, orthonormal; besides them
/// corners are expected to be independent, `print_px` off in each axis.
///
/// `None` when they leave something open.
pub(super) fn displacements<'a>(
    edges: impl Iterator<Item = ([Option<usize>; 2], &'a Edge)>,
    smooth: &DMatrix<f64>,
    print_px: f64,
    rounds: usize,
) -> Option<Displacements> {
    let weight = print_px.powi(-2);
    let numbers = smooth.nrows();
    let expected = (DMatrix::identity(numbers, numbers) - smooth * smooth.transpose()) * weight;
    let mut messages: Vec<Message<'_>> = edges.filter_map(|(ends, edge)| Message::first(ends, edge)).collect();
    let mut all = Gaussian::of(&expected, &messages)?;
    while let Some(worst) = worst(&messages, &all) {
        messages.swap_remove(worst);
        all = Gaussian::of(&expected, &messages)?;
    }
    for _ in 0..rounds {
        for message in &mut messages {
            message.hear(&all);
        }
        all = Gaussian::of(&expected, &messages)?;
    }
    let Gaussian { mean, covariance } = all;
    let is_sound = covariance.iter().all(|v| v.is_finite()) && covariance.diagonal().iter().all(|v| *v > 0.0);
    let moved = (0..numbers / 2).map(|i| Vector2::new(mean[2 * i], mean[2 * i + 1])).collect();
    is_sound.then_some(Displacements { moved, covariance_px2: covariance })
}

/// The message that contradicts all others most, if one does.
fn worst(messages: &[Message<'_>], all: &Gaussian) -> Option<usize> {
    let off = messages.iter().map(|message| message.contradiction(all).unwrap_or(0.0));
    let (worst, off) = off.enumerate().max_by(|(_, a), (_, b)| a.total_cmp(b))?;
    (off > CONTRADICTS).then_some(worst)
}

impl<'a> Message<'a> {
    /// By the polygon alone.
    fn first(ends: [Option<usize>; 2], edge: &'a Edge) -> Option<Self> {
        let Moments { mean, covariance } = edge.moments;
        let precision = match ends {
            [Some(_), Some(_)] => covariance.try_inverse()?,
            [Some(_), None] => Matrix2::new(1.0 / covariance.m11, 0.0, 0.0, 0.0),
            [None, Some(_)] => Matrix2::new(0.0, 0.0, 0.0, 1.0 / covariance.m22),
            [None, None] => return None,
        };
        Some(Self { ends, edge, precision, weighted: precision * mean })
    }

    /// Squared distance of what it says from what all others say, in standard deviations of the difference.
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
            let (precision, said) = (1.0 / of_all.covariance.m11, self.precision[(end, end)]);
            let variance = 1.0 / (precision - said);
            let mean = variance * (precision * of_all.mean.x - self.weighted[end]);
            let off = mean - self.edge.moments.mean[end];
            Some(off * off / (variance + 1.0 / said))
        };
        match self.ends {
            [Some(a), Some(b)] => both(&along([a, b])),
            [Some(a), None] => one(0, a),
            [None, Some(b)] => one(1, b),
            [None, None] => None,
        }
    }

    /// By the polygon and what all others say of both ends. It stays as it is where they contradict it.
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
        // What cuts a Gaussian off makes it no wider; rounding may.
        let mut eigen = (both_precision - others_precision).symmetric_eigen();
        eigen.eigenvalues.apply(|value| *value = value.max(0.0));
        Some((eigen.recompose(), both_precision * both.mean - others_weighted))
    }
}

impl Gaussian {
    fn of(expected: &DMatrix<f64>, messages: &[Message<'_>]) -> Option<Self> {
        let mut precision = expected.clone();
        let mut weighted = DVector::zeros(expected.nrows());
        for Message { ends, edge, precision: of_ends, weighted: of_means } in messages {
            let normal = &edge.normal;
            for (a, corner) in ends.iter().enumerate() {
                let Some(corner) = corner else { continue };
                for i in 0..2 {
                    weighted[2 * corner + i] += normal[i] * of_means[a];
                }
                for (b, other) in ends.iter().enumerate() {
                    let Some(other) = other else { continue };
                    for (i, j) in [(0, 0), (0, 1), (1, 0), (1, 1)] {
                        precision[(2 * corner + i, 2 * other + j)] += normal[i] * normal[j] * of_ends[(a, b)];
                    }
                }
            }
        }
        let factor = precision.cholesky()?;
        let half = lower_inverse(factor.l_dirty())?;
        Some(Self { mean: factor.solve(&weighted), covariance: half.transpose() * &half })
    }

    /// The displacements of two corners along a direction.
    fn along(&self, corners: [usize; 2], direction: &Vector2<f64>) -> Moments {
        let mean = corners.map(|corner| direction.dot(&self.mean.fixed_rows::<2>(2 * corner)));
        let of = |a: usize, b: usize| {
            let block = self.covariance.fixed_view::<2, 2>(2 * corners[a], 2 * corners[b]);
            direction.dot(&(block * direction))
        };
        Moments { mean: mean.into(), covariance: Matrix2::from_fn(of) }
    }
}
