//! What is counted over the trials of a cell.

use handeye_estimate::handeye::closed_form;
use nalgebra::{Isometry3, Matrix6, Vector6};
use statrs::distribution::{ChiSquared, ContinuousCDF as _, FisherSnedecor};

use super::answer::{self, Answer};
use super::bound::{self, Normals};
use super::level_scatter::level_scatter;
use super::scene::{Cell, Trial};

/// Components of a hand-eye transform.
const COMPONENTS: f64 = 6.0;
const PROBABILITY: f64 = 0.95;
/// Degrees of freedom that count as infinite: quantiles differ by less than one part in a thousand.
const MANY: f64 = 1e4;
/// Multiple of the bound beyond which an error cannot be due to noise.
const FAR: f64 = 8.0;

/// How far an answer is from the truth, and the error it states.
#[derive(Debug, Clone, Copy)]
pub struct Deviation {
    /// Squared translation error, m².
    pub metres2: f64,
    /// Squared rotation error, rad².
    pub radians2: f64,
}

impl Deviation {
    fn new(truth: &Isometry3<f64>, estimate: &Isometry3<f64>) -> Self {
        let e = bound::error_twist(truth, estimate);
        Self { metres2: e.fixed_rows::<3>(0).norm_squared(), radians2: e.fixed_rows::<3>(3).norm_squared() }
    }
}

/// One estimate compared with the truth.
#[derive(Debug, Clone, Copy)]
pub struct Judged {
    pub deviation: Deviation,
    /// Squared length of the error weighted by the stated covariance; 6 on average if that is correct.
    pub mahalanobis2: f64,
    /// Whether the stated 95 % region contains the truth.
    pub covered: bool,
    /// Whether the stated tip error is not exceeded.
    pub tip_covered: bool,
    /// Outlier views, minus those that are wrong.
    pub outliers: f64,
    /// Estimated over true noise levels: corner, robot in translation and in rotation; the levels themselves in µm and
    /// millidegrees if the robot is exact.
    pub noise: [f64; 3],
}

/// `eᵀ C⁻¹ e`; `None` when the covariance is singular.
fn mahalanobis2(covariance: &Matrix6<f64>, error: &Vector6<f64>) -> Option<f64> {
    let scale = covariance.diagonal().map(|d: f64| d.sqrt().recip());
    let scaled = Matrix6::from_fn(|i, j| covariance[(i, j)] * scale[i] * scale[j]);
    let scaled_error = error.component_mul(&scale);
    Some(scaled_error.dot(&scaled.cholesky()?.solve(&scaled_error)))
}

impl Judged {
    fn new(trial: &Trial, answer: &Answer) -> Option<Self> {
        let (truth, estimate) = (trial.links.mount_from_camera.isometry(), answer.mount_from_camera.isometry());
        let error = bound::error_twist(truth, estimate);
        let mahalanobis2 = mahalanobis2(&answer.covariance, &error)?;
        let at_point = truth.inverse() * estimate * answer.reference_point - answer.reference_point;
        let level = |found: f64, truth: f64, unit: f64| if truth > 0.0 { found / truth } else { found / unit };
        let (found, true_noise) = (answer.noise, trial.cell.noise);
        Some(Self {
            deviation: Deviation::new(truth, estimate),
            mahalanobis2,
            outliers: answer.outliers as f64 - trial.wrong.iter().filter(|wrong| **wrong).count() as f64,
            covered: answer.small_sample.scale * mahalanobis2 <= limit(answer.small_sample.degrees_of_freedom)?,
            tip_covered: at_point.norm() <= answer.tip_error_95_m,
            noise: [
                level(found.corner_px, true_noise.corner_px, 1.0),
                level(found.robot_m, true_noise.robot_m, 1e-6),
                level(found.robot_rad, true_noise.robot_rad, 1e-3f64.to_radians()),
            ],
        })
    }
}

/// The squared Mahalanobis distance that 95 % of errors stay under: six times the F quantile, or chi-square's if the
/// covariance counts as known.
fn limit(degrees_of_freedom: f64) -> Option<f64> {
    if degrees_of_freedom < MANY {
        return Some(COMPONENTS * FisherSnedecor::new(COMPONENTS, degrees_of_freedom).ok()?.inverse_cdf(PROBABILITY));
    }
    Some(ChiSquared::new(COMPONENTS).ok()?.inverse_cdf(PROBABILITY))
}

/// Everything about one trial. An estimate that failed is an error with its message.
pub struct Outcome {
    pub bound: Matrix6<f64>,
    pub given: Result<Judged, String>,
    pub estimated: Result<Judged, String>,
    pub closed_forms: Vec<Option<Deviation>>,
    /// Minimum relative standard deviations of estimates of the noise levels.
    pub level_scatter: Option<[f64; 3]>,
}

/// Draws a trial, solves it and judges the answers. `product` selects the whole path of `calibrate` instead of the
/// estimator alone, if noise levels are estimated.
pub fn run(cell: &Cell, seed: u64, number: u64, product: bool) -> Result<Outcome, String> {
    let trial = super::scene::trial(cell, seed, number);
    let normals = Normals::new(&trial);
    let bound = bound::hand_eye(&normals, &cell.noise).ok_or("the bound is singular")?;
    let judged = |answer: Result<Answer, String>| {
        answer.and_then(|a| Judged::new(&trial, &a).ok_or_else(|| "the covariance is singular".to_owned()))
    };
    let start = answer::start(&trial);
    let from = |noise_given| start.as_ref().map_err(Clone::clone).and_then(|s| answer::joint(&trial, s, noise_given));
    let given = judged(from(true));
    let estimated = judged(if product { answer::product(&trial) } else { from(false) });
    let truth = trial.links.mount_from_camera.isometry();
    let closed_forms = start.as_ref().map_or_else(
        |_| vec![None; closed_form::all().len()],
        |s| {
            let deviation = |c: &closed_form::ClosedFormSolution| Deviation::new(truth, c.mount_from_camera.isometry());
            s.closed_forms.iter().map(|c| c.as_ref().map(deviation)).collect()
        },
    );
    Ok(Outcome { bound, given, estimated, closed_forms, level_scatter: level_scatter(&normals, &cell.noise) })
}

/// Root mean square error over the bound's, with the standard error of that ratio.
#[derive(Debug, Clone, Copy)]
pub struct Ratio {
    pub value: f64,
    pub sigma: f64,
}

impl Ratio {
    /// From pairs of a squared error and a variance. The spread is that of a ratio of means, to first order.
    fn of(pairs: &[(f64, f64)]) -> Self {
        let (errors, bounds) = pairs.iter().fold((0.0, 0.0), |(e, b), pair| (e + pair.0, b + pair.1));
        let squared = errors / bounds;
        let spread: f64 = pairs.iter().map(|(e, b)| (e - squared * b).powi(2)).sum::<f64>().sqrt() / bounds;
        Self { value: squared.sqrt(), sigma: spread / (2.0 * squared.sqrt()) }
    }
}

/// One estimator over all trials of a cell.
pub struct Performance {
    pub translation: Ratio,
    pub rotation: Ratio,
    pub covered: f64,
    pub tip_covered: f64,
    pub mean_mahalanobis2: f64,
    /// Mean number of views excluded as outliers, minus those that are wrong.
    pub outliers: f64,
    /// Root mean squares of [`Judged::noise`], and its standard deviations.
    pub noise: [f64; 3],
    pub noise_scatter: [f64; 3],
    pub failures: usize,
    pub first_failure: Option<String>,
}

impl Performance {
    pub fn of<'a>(outcomes: impl Iterator<Item = (&'a Matrix6<f64>, &'a Result<Judged, String>)>) -> Self {
        let mut good = Vec::new();
        let (mut failures, mut first_failure) = (0, None);
        for (bound, result) in outcomes {
            match result {
                Ok(judged) => good.push((bound::levels(bound), *judged)),
                Err(words) => {
                    failures += 1;
                    first_failure.get_or_insert_with(|| words.clone());
                }
            }
        }
        let count = good.len().max(1) as f64;
        let share = |is: fn(&Judged) -> bool| good.iter().filter(|(_, j)| is(j)).count() as f64 / count;
        let mean = |of: &dyn Fn(&Judged) -> f64| good.iter().map(|(_, j)| of(j)).sum::<f64>() / count;
        let pairs = |of: fn(&Deviation) -> f64, which: fn(&(f64, f64)) -> f64| -> Vec<(f64, f64)> {
            good.iter().map(|(level, j)| (of(&j.deviation), which(level).powi(2))).collect()
        };
        let noise_mean: [f64; 3] = std::array::from_fn(|i| mean(&|j| j.noise[i]));
        Self {
            translation: Ratio::of(&pairs(|d| d.metres2, |l| l.0)),
            rotation: Ratio::of(&pairs(|d| d.radians2, |l| l.1)),
            covered: share(|j| j.covered),
            tip_covered: share(|j| j.tip_covered),
            mean_mahalanobis2: mean(&|j| j.mahalanobis2),
            outliers: mean(&|j| j.outliers),
            noise: std::array::from_fn(|i| mean(&|j| j.noise[i].powi(2)).sqrt()),
            noise_scatter: std::array::from_fn(|i| mean(&|j| (j.noise[i] - noise_mean[i]).powi(2)).sqrt()),
            failures,
            first_failure,
        }
    }
}

/// All trials of a cell.
pub struct Summary {
    pub cell: Cell,
    pub trials: usize,
    /// Root mean square of the bound: metres and radians.
    pub bound: (f64, f64),
    pub given: Performance,
    pub estimated: Performance,
    /// Name, translation and rotation ratio, and number of failures of every closed form.
    pub closed_forms: Vec<(&'static str, Ratio, Ratio, usize)>,
    /// Trials whose estimate with estimated noise levels is more than [`FAR`] times its bound away, with the multiple.
    pub far: Vec<(usize, f64)>,
    /// Mean of [`Outcome::level_scatter`].
    pub level_scatter: [f64; 3],
    /// Trials that could not be set up, with the reason of the first.
    pub unusable: usize,
    pub first_unusable: Option<String>,
    pub seconds: f64,
}

impl Summary {
    pub fn of(cell: Cell, results: &[Result<Outcome, String>], seconds: f64) -> Self {
        let outcomes: Vec<&Outcome> = results.iter().filter_map(|r| r.as_ref().ok()).collect();
        let first_unusable = results.iter().find_map(|r| r.as_ref().err().cloned());
        let mean_square = |of: &dyn Fn((f64, f64)) -> f64| {
            let sum: f64 = outcomes.iter().map(|o| of(bound::levels(&o.bound)).powi(2)).sum();
            (sum / outcomes.len().max(1) as f64).sqrt()
        };
        let closed_forms = closed_form::all()
            .iter()
            .enumerate()
            .map(|(k, method)| {
                let good: Vec<(&Matrix6<f64>, Deviation)> =
                    outcomes.iter().filter_map(|o| Some((&o.bound, o.closed_forms[k]?))).collect();
                let pairs = |metres: bool| -> Vec<(f64, f64)> {
                    let pair = |(bound, d): &(&Matrix6<f64>, Deviation)| {
                        let (t, r) = bound::levels(bound);
                        if metres { (d.metres2, t * t) } else { (d.radians2, r * r) }
                    };
                    good.iter().map(pair).collect()
                };
                (method.name(), Ratio::of(&pairs(true)), Ratio::of(&pairs(false)), outcomes.len() - good.len())
            })
            .collect();
        let times_bound = |o: &Outcome| {
            let (t, r) = bound::levels(&o.bound);
            let d = o.estimated.as_ref().ok()?.deviation;
            Some((d.metres2 / (t * t)).max(d.radians2 / (r * r)).sqrt())
        };
        let far = results
            .iter()
            .enumerate()
            .filter_map(|(number, r)| Some((number, times_bound(r.as_ref().ok()?)?)))
            .filter(|(_, times)| *times > FAR)
            .collect();
        let scatters: Vec<[f64; 3]> = outcomes.iter().filter_map(|o| o.level_scatter).collect();
        let level_scatter =
            std::array::from_fn(|i| scatters.iter().map(|s| s[i]).sum::<f64>() / scatters.len().max(1) as f64);
        Self {
            cell,
            far,
            level_scatter,
            trials: outcomes.len(),
            bound: (mean_square(&|l| l.0), mean_square(&|l| l.1)),
            given: Performance::of(outcomes.iter().map(|o| (&o.bound, &o.given))),
            estimated: Performance::of(outcomes.iter().map(|o| (&o.bound, &o.estimated))),
            closed_forms,
            unusable: results.len() - outcomes.len(),
            first_unusable,
            seconds,
        }
    }
}
