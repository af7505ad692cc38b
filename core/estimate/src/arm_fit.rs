//! The arm's own errors within a calibration: their values, and the transforms that belong to them.

use nalgebra::{DMatrix, Matrix6};
use statrs::distribution::{ChiSquared, ContinuousCDF as _};

use crate::ShapeEstimate;
use crate::handeye::joint::{
    self, ArmErrors, Free, JointProblem, JointSolution, Noise, SIZE_SIGMA, ShownEffects, SmallSample, with_shown_field,
};
use crate::handeye::{HandEye, HandEyeError, determined};
use crate::resolution;
use crate::size::LEAST_SCALE;
use crate::stated_uncertainty::Alternative;
use crate::uncertainty::overdispersion::{self, Overdispersion};
use crate::uncertainty::quality::{self, PredictedBy};
use handeye_geometry::camera::Intrinsics;
use handeye_geometry::progress::Work;
use handeye_geometry::se3;
use handeye_geometry::targets::bent::BoardShape;
use handeye_geometry::view_equations::DepthBias;

/// The errors of the robot's arm as the views show them, and the calibration by the tip poses that they make. Both transforms are
/// for corrected poses only: the controller's poses go with the transforms of [`Fit::hand_eye`](crate::Fit::hand_eye).
#[derive(Debug, Clone)]
pub struct ArmFit {
    /// The errors of the joints and links, with covariance and levels.
    pub errors: ArmErrors,
    /// Both rigid links, by corrected tip poses.
    pub hand_eye: HandEye,
    /// What was estimated together with them.
    pub others: OtherEstimates,
    /// Covariance of both links, everything else estimated and, at its end, the errors of the arm, as in
    /// [`JointSolution::covariance`].
    pub covariance: DMatrix<f64>,
    /// How the error of the hand-eye transform is distributed in units of that.
    pub small_sample: SmallSample,
    /// Noise levels, including those of the arm's errors; the noise of the robot is what its links do not explain.
    pub noise: Noise,
    /// By how much the covariance was widened, because the data scatter more than the noise levels explain.
    pub widening: Overdispersion,
    /// RMS of 2-D corner residuals on views left out \[px\], by reported poses as they are and by corrected ones; `None` with too
    /// few views.
    pub heldout_px: Option<[f64; 2]>,
    /// Whether views left out contradict the errors: they are predicted worse by corrected poses than by reported ones, by more
    /// than chance, and worse than the model of the arm itself explains. An exact arm is predicted a little worse by its corrected
    /// poses, as the uncertainty of the errors predicts.
    pub contradicted: bool,
}

/// What was estimated in addition to the errors of an arm and both links.
#[derive(Debug, Clone)]
pub struct OtherEstimates {
    /// The lens, estimated or as given.
    pub intrinsics: Intrinsics,
    /// Shape of the target, estimated or as given.
    pub shape: BoardShape,
    /// Errors of the depths; none where they were not estimated.
    pub depth: DepthBias,
    /// Which of all these were free.
    pub free: Free,
}

/// Gain of minus twice the log-likelihood, integrated over the prior of the size, from which the size of the target is free:
/// reached by chance in one session in a hundred with a target that is as stated (chi-square with one degree of freedom).
const SIZE_GAIN: f64 = 6.63;

/// Standard deviations by which a size has to be off for nothing else to be taken for it: one in a thousand is off by 3.3, and
/// unmodelled effects have made standard deviations three times too small in recorded sessions. Poses that are read while the arm
/// moves from view to view look like a target that is smaller by four of them.
const CERTAIN: f64 = 10.0;

impl ArmFit {
    /// Covariance of the errors, in the order of [`ArmErrors::numbers`].
    pub fn errors_covariance(&self) -> DMatrix<f64> {
        let (count, first) = self.error_places();
        self.covariance.view((first, first), (count, count)).into_owned()
    }

    /// Covariance of `[mount_from_camera (6), anchor_from_target (6), errors of the arm]`, metres and radians; right perturbations.
    /// The uncertainty of the lens and of everything else that is estimated is in it.
    pub(crate) fn links_and_errors_covariance(&self) -> DMatrix<f64> {
        let (count, first) = self.error_places();
        let kept: Vec<usize> = (0..12).chain(first..first + count).collect();
        self.covariance.select_rows(&kept).select_columns(&kept)
    }

    /// How many errors there are, and where they begin in the covariance.
    fn error_places(&self) -> (usize, usize) {
        let count = self.errors.number_count();
        (count, self.covariance.nrows() - count)
    }

    /// Standard deviations of the errors of links and joints, in the order of [`arm_parameters`](joint::arm_parameters).
    pub fn sigma(&self) -> Vec<f64> {
        (self.covariance.nrows() - self.errors.values().len()..self.covariance.nrows())
            .map(|i| self.deviation(i))
            .collect()
    }

    /// Standard deviations of the lens that belongs to them, in the order of [`Intrinsics::parameters`]; empty when it was
    /// given.
    pub fn intrinsics_sigma(&self) -> Vec<f64> {
        let lens = 12..12 + self.others.free.form().warp_at(&self.others.intrinsics);
        lens.map(|i| self.deviation(i)).collect()
    }

    /// The shape of the target that belongs to them; `None` when it was given.
    pub fn shape(&self) -> Option<ShapeEstimate> {
        let OtherEstimates { intrinsics, shape, free, .. } = &self.others;
        let form = free.form();
        let warp = 12 + form.warp_at(intrinsics);
        let scale_sigma = free.scale.then(|| self.deviation(12 + form.scale_at(intrinsics)));
        let warp_sigma_m = free.warp.then(|| [self.deviation(warp), self.deviation(warp + 1)]);
        (free.warp || free.scale).then_some(ShapeEstimate { shape: *shape, warp_sigma_m, scale_sigma })
    }

    fn deviation(&self, index: usize) -> f64 {
        self.covariance[(index, index)].max(0.0).sqrt()
    }

    /// What it implies for both links of a calibration by reported poses, which does not model the arm's errors: the camera on its
    /// mount, and the target.
    pub fn of_links(&self, answer: &HandEye) -> [Alternative; 2] {
        let shifts = [
            se3::log((answer.mount_from_camera().inverse() * self.hand_eye.mount_from_camera()).isometry()),
            se3::log((answer.anchor_from_target().inverse() * self.hand_eye.anchor_from_target()).isometry()),
        ];
        let covariance = |at: usize| -> Matrix6<f64> { self.covariance.fixed_view::<6, 6>(at, at).into_owned() };
        std::array::from_fn(|link| Alternative { shift: shifts[link], covariance: covariance(6 * link) })
    }
}

/// The same with the size of the target free, where the views require it: a target that is some thousandths larger than stated
/// makes an arm look as much longer, by more than its own errors. Some real arms are longer in all links by a thousandth or two,
/// which no view distinguishes from such a target: a size that is off by less than prints may be is left as stated.
fn with_shown_size<'a>(
    stated: &JointProblem<'a>,
    fit: JointSolution,
    work: &Work<'_>,
) -> Result<(JointProblem<'a>, JointSolution), HandEyeError> {
    let sized = JointProblem { free: Free { scale: true, ..stated.free }, ..*stated };
    let by_size = if stated.free.scale { None } else { determined(joint::fit(&sized, &fit.as_start(), *work))? };
    let by_size = by_size.filter(|by_size| {
        // The prior of the size is among the equations, except for its constant.
        let both = by_size.deviance.zip(fit.deviance);
        let is_likelier = both.is_some_and(|(sized, stated)| stated - (sized + 2.0 * SIZE_SIGMA.ln()) > SIZE_GAIN);
        is_likelier && (by_size.shape.scale - 1.0).abs() >= LEAST_SCALE
    });
    Ok(by_size.map_or((*stated, fit), |by_size| (sized, by_size)))
}

/// The covariance where the estimated size is not certain: it and the stated one are equally likely, and half the square of their
/// difference is added to its variance, with what depends on it.
fn with_uncertain_size(fit: &JointSolution) -> Option<DMatrix<f64>> {
    let sigma = fit.scale_sigma()?;
    let off = (fit.shape.scale - 1.0).abs() / sigma;
    let at = 12 + fit.free.form().scale_at(&fit.intrinsics);
    (off < CERTAIN).then(|| overdispersion::with_less_known(&fit.covariance, at..at + 1, 1.0 + 0.5 * off * off))
}

/// Factor by which the RMS residual of this many views exceeds its expectation by chance, once in twenty: a pose error has six
/// numbers, and they make up most of it.
fn by_chance(views: usize) -> f64 {
    let numbers = 6.0 * views as f64;
    ChiSquared::new(numbers).map_or(f64::INFINITY, |law| (law.inverse_cdf(0.95) / numbers).sqrt())
}

/// The errors of the arm by the views of a joint estimate; `None` where the views have no joint values, where the noise levels
/// are given, and where there is no answer with them.
pub(crate) fn arm_fit(
    problem: &JointProblem<'_>,
    solution: &JointSolution,
    shown: ShownEffects<'_>,
    work: &Work<'_>,
) -> Result<Option<ArmFit>, HandEyeError> {
    let with = JointProblem { free: Free { arm: true, field: false, ..problem.free }, ..*problem };
    if with.arm().is_none() || problem.noise.is_some() {
        return Ok(None);
    }
    let Some(fit) = determined(joint::fit(&with, &solution.as_start(), *work))? else { return Ok(None) };
    // A requested size is not the stated one.
    let is_asked = with.free.scale;
    let (with, fit) = with_shown_size(&with, fit, work)?;
    let (with, fit) = match with_shown_field(&with, with.views, &fit, *work)? {
        Some(with_field) => (JointProblem { free: with_field.free, ..with }, with_field),
        None => (with, fit),
    };
    let Some(fit) = determined(joint::with_stated_error(&with, fit, work.cancel))? else { return Ok(None) };
    // With a lens shared by several sessions, its residual distortion is as uncertain here as by the views of this
    // session.
    let stated = determined(shown.with_their_error(&with, fit, work.cancel))?;
    let Some((mut fit, _)) = stated else { return Ok(None) };
    let Some(errors) = fit.arm.clone() else { return Ok(None) };
    let heldout = quality::compared((problem, solution), (&with, &fit), PredictedBy::Links, work.cancel)?;
    let contradicted = match heldout.filter(|heldout| heldout.is_worse) {
        None => false,
        Some(heldout) => {
            let expected = determined(joint::prediction::expected_residuals(&with, &fit, *work))?;
            expected.is_none_or(|expected| {
                let by_chance_px = expected.prediction_px * by_chance(with.views.len());
                heldout.after_px > by_chance_px.max(resolution::FINE_PX)
            })
        }
    };
    // Views left out are judged by the model as it is, and what they disagree about counts after that.
    let widening = determined(overdispersion::check(&with, &fit, shown, work.cancel))?;
    let Some(widening) = widening else { return Ok(None) };
    fit.widen(&widening);
    if !is_asked && let Some(covariance) = with_uncertain_size(&fit) {
        fit.covariance = covariance;
    }
    let others = OtherEstimates { intrinsics: fit.intrinsics, shape: fit.shape, depth: fit.depth, free: fit.free };
    Ok(Some(ArmFit {
        errors,
        hand_eye: fit.hand_eye,
        others,
        covariance: fit.covariance,
        small_sample: fit.small_sample,
        noise: fit.noise,
        widening,
        heldout_px: heldout.map(|heldout| [heldout.before_px, heldout.after_px]),
        contradicted,
    }))
}

#[cfg(test)]
#[path = "arm_fit_tests.rs"]
mod tests;
