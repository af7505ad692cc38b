//! Which hypothesis of every kind is worth a fit of its own, by tests with the present noise levels.

use nalgebra::{DMatrix, DVector};

use super::effect::Effect;
use super::model::{Fit, Model, State, inverse};

/// Most effects taken in; more than two faults at once are rare.
const MOST_EFFECTS: usize = 3;

/// What is tested.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Candidate {
    Effect(Effect),
    /// These views contradict the others.
    Views(Vec<usize>),
}

/// The most promising hypothesis of every kind, by a test with the present noise levels.
pub(super) fn screened(model: &Model<'_>, state: &State, fit: &Fit, room: usize) -> Vec<Candidate> {
    let count = model.sight.views.len();
    let mut found: Vec<Candidate> = Vec::new();
    if state.effects.len() < MOST_EFFECTS {
        let mut singles = vec![Effect::Scale];
        if model.sight.intrinsics.is_some() {
            singles.push(Effect::Warp);
            // The centre is one of all parameters: with one of the two in the model the other has nothing left to
            // explain.
            if !model.sight.lens_free && !state.effects.iter().any(|effect| effect.is_of_lens()) {
                singles.extend([Effect::Lens, Effect::Centre]);
            }
        }
        found.extend(singles.into_iter().filter(|e| !state.effects.contains(e)).map(Candidate::Effect));
        let taken = |e: &Effect| state.effects.contains(e);
        let joints = (0..model.sight.joints()).map(Effect::Joint).filter_map(|e| {
            let mut score = Score::new(1, fit.width());
            (0..count).filter(|i| !state.rejected.contains(i)).for_each(|i| score.add(fit, i, &e.columns(model, i)));
            Some((e, score.statistic(fit)?))
        });
        for family in [
            joints.collect(),
            moves(model, state, fit, Effect::BoardMoved),
            moves(model, state, fit, Effect::CameraMoved),
        ] {
            let best = family.into_iter().filter(|(e, _)| !taken(e)).max_by(|a, b| a.1.total_cmp(&b.1));
            found.extend(best.map(|(e, _)| Candidate::Effect(e)));
        }
    }
    if room > 0 {
        let worst = (0..count)
            .filter(|i| !state.rejected.contains(i))
            .filter_map(|i| Some((i, view_score(fit, i)?)))
            .max_by(|a, b| a.1.total_cmp(&b.1));
        found.extend(worst.map(|(i, _)| Candidate::Views(vec![i])));
    }
    found
}

/// Rao's score statistic of an effect: sums over the views that it concerns.
struct Score {
    own: DMatrix<f64>,
    shared: DMatrix<f64>,
    gradient: DVector<f64>,
}

impl Score {
    fn new(numbers: usize, width: usize) -> Self {
        Self {
            own: DMatrix::zeros(numbers, numbers),
            shared: DMatrix::zeros(width, numbers),
            gradient: DVector::zeros(numbers),
        }
    }

    fn add(&mut self, fit: &Fit, view: usize, columns: &DMatrix<f64>) {
        let weighted = fit.weights[view] * columns;
        self.own.gemm_tr(1.0, columns, &weighted, 1.0);
        self.shared.gemm_tr(1.0, &fit.designs[view], &weighted, 1.0);
        self.gradient.gemv_tr(1.0, &weighted, &fit.residuals[view], 1.0);
    }

    fn statistic(&self, fit: &Fit) -> Option<f64> {
        let left = &self.own - self.shared.transpose() * &fit.covariance * &self.shared;
        // An effect that the other unknowns fully absorb cannot be seen: the zero of the first and of the last joint, for
        // instance.
        if (0..left.nrows()).any(|k| left[(k, k)] <= 1e-6 * self.own[(k, k)]) {
            return None;
        }
        Some(self.gradient.dot(&(inverse(&left)? * &self.gradient)))
    }
}

/// The statistics of a move before every view, summed from the last view on. Two views on either side are the least.
fn moves(model: &Model<'_>, state: &State, fit: &Fit, of: fn(usize) -> Effect) -> Vec<(Effect, f64)> {
    let count = model.rows.len();
    let mut score = Score::new(6, fit.width());
    let mut found = Vec::new();
    for from in (2..count).rev() {
        if !state.rejected.contains(&from) {
            score.add(fit, from, &of(from).columns(model, from));
        }
        if from + 2 <= count {
            found.extend(score.statistic(fit).map(|s| (of(from), s)));
        }
    }
    found
}

/// The statistic of a view against the fit that it is in.
pub(super) fn view_score(fit: &Fit, view: usize) -> Option<f64> {
    let own = fit.weights[view].try_inverse()?;
    let shared = &fit.designs[view] * &fit.covariance * fit.designs[view].transpose();
    let covariance = DMatrix::from_fn(6, 6, |i, j| own[(i, j)] - shared[(i, j)]);
    let residual = DVector::from_iterator(6, fit.residuals[view].iter().copied());
    Some(residual.dot(&(inverse(&covariance)? * &residual)))
}
