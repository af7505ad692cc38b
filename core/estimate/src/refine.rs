//! The joint estimate within a calibration: its start, outliers, and which unknowns the data support.

use nalgebra::Vector2;

use super::bend::{Deflection, may_be_shown};
use super::lens::Lens;
use super::{CalibrateError, DepthsInFit, MethodResult, Options, TargetSize, size};
use crate::handeye::closed_form::ClosedFormSolution;
use crate::handeye::consensus::{Consensus, consensus};
use crate::handeye::joint::outliers::{Screened, estimate_screened};
use crate::handeye::joint::prediction::ErrorCurve;
use crate::handeye::joint::print_errors::{self, with_shown_print};
use crate::handeye::joint::residual_distortion::{self, corrected, with_shown_distortion};
use crate::handeye::joint::with_depths::{OtherModel, with_depths};
use crate::handeye::joint::{
    self, CornerWeights, DepthWeight, Free, JointProblem, JointSolution, JointStart, PrintErrors, ShownDistortion,
    ShownEffects, with_shown_field,
};
use crate::handeye::numbering::Turns;
use crate::handeye::{HandEyeError, PosePair, determined};
use crate::residuals::squared_residuals;
use crate::uncertainty::overdispersion;
use crate::uncertainty::overdispersion::Overdispersion;
use crate::uncertainty::quality::{self, PredictedBy};
use handeye_geometry::frames::{Camera, Pose, Target};
use handeye_geometry::progress::Work;
use handeye_geometry::targets::TargetSpec;
use handeye_geometry::targets::bent::{BoardPoints, BoardShape};
use handeye_geometry::targets::observation::{Corners, View};

/// A joint estimate and what was decided on the way.
#[derive(Clone)]
pub struct Refined {
    pub screened: Screened,
    pub weights: Option<CornerWeights>,
    /// Result of an attempt to use the depths of the views; `None` when there was none.
    pub depths: Option<DepthsInFit>,
    /// What the other model of the depth camera adds, where the answer uses its depths.
    pub other_depths: Option<OtherModel>,
    /// Print errors of the target's points, where the data show them.
    pub print: Option<PrintErrors>,
    /// Residual distortion of the lens, where the data show it; it is subtracted from the corners of the views.
    pub distortion: Option<ShownDistortion>,
}

/// The start that most views agree with, and the views numbered from another corner.
pub fn start(
    problem: &JointProblem<'_>,
    target: &TargetSpec,
    lens: &Lens,
    pairs: &[PosePair],
    methods: &[MethodResult],
) -> Result<Consensus, HandEyeError> {
    let candidates: Vec<ClosedFormSolution> = methods.iter().filter_map(|m| m.outcome.clone().ok()).collect();
    let sampled: Vec<View> = problem.views.iter().map(sampled).collect();
    let problem = &JointProblem { views: &sampled, ..*problem };
    let turns = Turns::of(target);
    let misfit = |solution: &ClosedFormSolution, view: usize, quarters: usize| {
        // The corners stay as detected: the target is turned the other way instead.
        let anchor_from_target = turns.turned(&solution.anchor_from_target, 4 - quarters);
        let solution = ClosedFormSolution { anchor_from_target, ..*solution };
        squared_residuals(problem, (&lens.intrinsics, &lens.shape), &solution, &problem.views[view], CAP_PX).sqrt()
    };
    consensus(pairs, &candidates, &turns, misfit).ok_or_else(|| {
        methods.iter().find_map(|m| m.outcome.clone().err()).unwrap_or(HandEyeError::NoSolution {
            method: "the closed forms",
            views: pairs.len(),
            reason: "none gave a finite answer",
        })
    })
}

/// The view with a handful of corners spread over the target: enough to distinguish a good start from a bad one.
fn sampled(view: &View) -> View {
    const CORNERS: usize = 6;
    let count = view.corners.len();
    let taken = CORNERS.min(count);
    let corners: Corners = (0..taken).map(|k| view.corners[k * (count - 1) / (taken - 1).max(1)]).collect();
    View::new(view.name.clone(), view.base_from_tip, corners)
}

/// Residual \[px\] at which a corner counts as simply wrong when starts are ranked, so that one bad view does not decide.
const CAP_PX: f64 = 50.0;

/// The joint estimate from a start.
pub fn refine(
    problem: &JointProblem<'_>,
    own: &[Pose<Camera, Target>],
    lens: &Lens,
    begin: &Consensus,
    options: Options,
    work: &Work<'_>,
) -> Result<Refined, CalibrateError> {
    let weights = CornerWeights::stated(problem.views.iter().flat_map(|view| &view.corners));
    // What the corners show without the robot holds with it, and the start is then near the answer.
    let warp = lens.is_bent();
    let free = Free { intrinsics: lens.free, warp, scale: options.free_scale, ..Free::default() };
    let problem = JointProblem { free, weights, ..*problem };
    let start = JointStart {
        mount_from_camera: begin.solution.mount_from_camera,
        anchor_from_target: begin.solution.anchor_from_target,
        intrinsics: lens.intrinsics,
        shape: lens.shape,
        noise: None,
    };
    let mut screened = if options.keep_outliers {
        keep_all(&problem, &start, *work)?
    } else {
        estimate_screened(&problem, &start, own, *work)?
    };
    // Unmodelled effects make views look wrong, so they are judged again once the model includes them.
    let again = |problem: &JointProblem<'_>, solution: JointSolution, screened: Screened| {
        if options.keep_outliers {
            return Ok(Screened { solution, ..screened });
        }
        estimate_screened(problem, &solution.as_start(), own, work.cancel)
    };
    if !warp && let Some(bent) = bent(&problem, &screened.kept_views(), &screened.solution, None, work)? {
        screened = again(&JointProblem { free: bent.free, ..problem }, bent, screened)?;
    }
    let (print, with_print) = printed(&problem, &screened, work)?.unzip();
    let board = print.as_ref().map(|print| print.on(problem.board));
    let problem = JointProblem { board: board.as_ref().unwrap_or(problem.board), ..problem };
    if let Some(with_print) = with_print {
        screened = again(&JointProblem { free: with_print.free, ..problem }, with_print, screened)?;
    }
    if let Some(with_field) = with_shown_field(&problem, &screened.kept_views(), &screened.solution, *work)? {
        screened = again(&JointProblem { free: with_field.free, ..problem }, with_field, screened)?;
    }
    let (depths, other_depths) = depths(&problem, &mut screened, work)?.unzip();
    let other_depths = other_depths.flatten();
    Ok(Refined { screened, weights, depths, other_depths, print, distortion: None })
}

impl Refined {
    /// The estimate repeated from where it ended, with the same views, unknowns and kinds of noise: `problem` is of those
    /// views. The error that may be stated is that of [`Self::stated`].
    pub fn again(&self, problem: &JointProblem<'_>, work: &Work<'_>) -> Result<Self, HandEyeError> {
        let mut next = self.clone();
        let view_noise = Some(self.screened.solution.noise.view_px > 0.0);
        let problem = &JointProblem { view_noise, ..*problem };
        next.screened.solution = joint::fit(problem, &self.screened.solution.as_start(), work.cancel)?;
        Ok(next)
    }

    /// The same with the residual distortion of the lens, where the data show it; `problem` is of the views in the fit.
    pub fn with_distortion(mut self, problem: &JointProblem<'_>, work: &Work<'_>) -> Result<Self, HandEyeError> {
        let shown = with_shown_distortion(problem, &self.screened.solution, work.cancel)?;
        if let Some((distortion, solution)) = shown {
            self.screened.views = corrected(&self.screened.views, &distortion.field);
            self.screened.solution = solution;
            self.distortion = Some(distortion);
        }
        Ok(self)
    }

    /// The same with the errors of the print as the views in the fit show them now; `problem` is of those views and of the
    /// target as drawn.
    pub fn with_settled_print(mut self, problem: &JointProblem<'_>, work: &Work<'_>) -> Result<Self, HandEyeError> {
        if let Some(shown) = self.print.clone() {
            let solution = self.screened.solution.clone();
            if let Some((print, solution)) = print_errors::settled(problem, shown, solution, work.cancel)? {
                (self.print, self.screened.solution) = (Some(print), solution);
            }
        }
        Ok(self)
    }

    /// The effects that are in the model.
    pub fn shown(&self) -> ShownEffects<'_> {
        ShownEffects { print: self.print.as_ref(), distortion: self.distortion.as_ref() }
    }

    /// See [`JointProblem::depth`].
    pub fn depth_weight(&self) -> Option<DepthWeight> {
        self.depths.and_then(|depths| depths.weight())
    }

    /// The target of the fit.
    pub fn board(&self, drawn: &BoardPoints) -> BoardPoints {
        self.print.as_ref().map_or_else(|| drawn.clone(), |print| print.on(drawn))
    }

    /// The same with the error that may be stated: that of a single session, if its lens has a residual distortion.
    pub fn stated(mut self, problem: &JointProblem<'_>, work: &Work<'_>) -> Result<Self, HandEyeError> {
        let mut solution = joint::with_stated_error(problem, self.screened.solution.clone(), work.cancel)?;
        if let Some(other) = &self.other_depths {
            solution.covariance = other.mixed(&solution.covariance);
        }
        let (solution, sigma_m) = self.shown().with_their_error(problem, solution, work.cancel)?;
        self.screened.solution = solution;
        if let Some(print) = &mut self.print {
            print.sigma_m = sigma_m;
        }
        Ok(self)
    }
}

fn keep_all(problem: &JointProblem<'_>, start: &JointStart, work: Work<'_>) -> Result<Screened, HandEyeError> {
    let solution = joint::fit(problem, start, work)?;
    Ok(Screened {
        solution,
        kept: (0..problem.views.len()).collect(),
        views: problem.views.to_vec(),
        distances: Vec::new(),
        corners: Vec::new(),
    })
}

/// The problem of the views that a screened estimate kept.
pub fn kept_problem<'a>(problem: &JointProblem<'a>, views: &'a [View], solution: &JointSolution) -> JointProblem<'a> {
    JointProblem { views, free: solution.free, ..*problem }
}

/// The estimate with a bent target, when the data support one. `print` are the errors that the target of the problem has in its
/// plane.
fn bent(
    problem: &JointProblem<'_>,
    views: &[View],
    flat: &JointSolution,
    print: Option<&PrintErrors>,
    work: &Work<'_>,
) -> Result<Option<JointSolution>, HandEyeError> {
    let free = Free { warp: true, ..flat.free };
    let with_warp = JointProblem { views, free, ..*problem };
    let one_step = joint::warp_ratio(&with_warp, flat, work.cancel)?;
    if !one_step.is_some_and(may_be_shown) {
        return Ok(None);
    }
    let start = flat.as_start();
    // A target seen square on does not determine its shape.
    let Some(solution) = determined(joint::fit(&with_warp, &start, work.cancel))? else { return Ok(None) };
    // Estimated noise levels and a curved cost make the covariance larger.
    let fitted = joint::warp_ratio(&with_warp, &solution, work.cancel)?;
    if !fitted.is_some_and(may_be_shown) {
        return Ok(None);
    }
    let stated = joint::with_stated_error(&with_warp, solution, work.cancel);
    let Some(mut solution) = determined(stated)? else { return Ok(None) };
    if let Some(print) = print {
        // The uncertainty of the print errors is one of the bend, too.
        solution = print_errors::with_its_error(&with_warp, solution, print, work.cancel)?.0;
    }
    let Some(covariance) = solution.warp_covariance() else { return Ok(None) };
    let metres_per_px = solution.reference_point.coords.norm() / solution.intrinsics.fx;
    let deflection = Deflection {
        warp_m: Vector2::from(solution.shape.warp_m),
        covariance,
        degrees_of_freedom: solution.small_sample.degrees_of_freedom,
        noise_m: solution.noise.corner_px * metres_per_px,
    };
    Ok(deflection.is_shown().then_some(solution))
}

/// The print errors that the views of a screened estimate show, and the estimate with them. `problem` has the target as drawn.
///
/// Errors that are smooth over the image are smooth over a target that is always seen the same way, and vice versa. What explains
/// more goes first: where that is the lens, print errors are what its residual distortion leaves.
fn printed(
    problem: &JointProblem<'_>,
    screened: &Screened,
    work: &Work<'_>,
) -> Result<Option<(PrintErrors, JointSolution)>, HandEyeError> {
    let (views, without) = (screened.kept_views(), &screened.solution);
    let problem = kept_problem(problem, &views, without);
    let Some(shown) = with_shown_print(&problem, without, work.cancel)? else { return Ok(None) };
    let distorted = if residual_distortion::gain(&problem, without, work.cancel)? > shown.0.gain {
        with_shown_distortion(&problem, without, work.cancel)?
    } else {
        None
    };
    let Some((distortion, distorted)) = distorted else {
        return on_flat_target(&problem, without, shown, work).map(Some);
    };
    let undistorted = corrected(&views, &distortion.field);
    let of_undistorted = JointProblem { views: &undistorted, ..problem };
    let Some(shown) = with_shown_print(&of_undistorted, &distorted, work.cancel)? else { return Ok(None) };
    let (print, solution) = on_flat_target(&of_undistorted, &distorted, shown, work)?;
    // The distortion is found again once all else is; until then the corners are those measured.
    let board = print.on(problem.board);
    let with_print = JointProblem { board: &board, free: solution.free, ..problem };
    let solution = determined(joint::fit(&with_print, &solution.as_start(), work.cancel))?;
    Ok(solution.map(|solution| (print, solution)))
}

/// Print errors that were shown against an estimate without them, decided again where the target is bent as well: points that are
/// off within the plane look like a bend.
fn on_flat_target(
    problem: &JointProblem<'_>,
    without: &JointSolution,
    shown: (PrintErrors, JointSolution),
    work: &Work<'_>,
) -> Result<(PrintErrors, JointSolution), HandEyeError> {
    if !problem.free.warp {
        return Ok(shown);
    }
    let flat = JointProblem { free: Free { warp: false, ..problem.free }, ..*problem };
    let start = without.as_start();
    let start = JointStart { shape: BoardShape { warp_m: [0.0; 2], ..start.shape }, ..start };
    let Some(solution) = determined(joint::fit(&flat, &start, work.cancel))? else { return Ok(shown) };
    let Some((print, solution)) = with_shown_print(&flat, &solution, work.cancel)? else { return Ok(shown) };
    let board = print.on(problem.board);
    let with_print = JointProblem { board: &board, ..flat };
    let is_bent = bent(&with_print, problem.views, &solution, Some(&print), work)?.is_some();
    Ok(if is_bent { shown } else { (print, solution) })
}

/// Tries the depths of the views, and takes them unless they make predictions of held-out views worse by more than chance. An
/// improvement is seldom visible: they determine what corners do not. One session in twenty leaves out depths that are right,
/// which costs little, whereas wrong depths do harm.
fn depths(
    problem: &JointProblem<'_>,
    screened: &mut Screened,
    work: &Work<'_>,
) -> Result<Option<(DepthsInFit, Option<OtherModel>)>, HandEyeError> {
    let views = screened.kept_views();
    let without = kept_problem(problem, &views, &screened.solution);
    let Some(found) = with_depths(&without, &screened.solution, work.cancel)? else { return Ok(None) };
    let free = found.solution.free;
    let with = JointProblem { free, depth: Some(found.weight), ..without };
    let compared =
        quality::compared((&without, &screened.solution), (&with, &found.solution), PredictedBy::Model, work.cancel)?;
    let Some(heldout) = compared else { return Ok(None) };
    let accepted = !heldout.is_worse;
    let depths = DepthsInFit {
        views: found.views,
        noise_m: found.solution.noise.corner_px / found.weight.px_per_m,
        weight: found.weight,
        other_probability: found.other.probability,
        bias: found.open.0,
        covariance: found.open.1,
        heldout_before_px: heldout.before_px,
        heldout_after_px: heldout.after_px,
        accepted,
    };
    if accepted {
        screened.solution = found.solution;
    }
    Ok(Some((depths, accepted.then_some(found.other))))
}

/// Results that need the whole problem.
pub struct Judged {
    pub heldout: Option<quality::HeldOut>,
    pub expected_heldout_rms_px: f64,
    pub robot_effect_px: f64,
    pub widening: Overdispersion,
    pub error_curve: ErrorCurve,
    pub size: Option<TargetSize>,
}

/// Error on held-out views, whether the covariance is true to the data, error by number of views. The covariance is
/// widened where it is not.
pub fn judge(
    problem: &JointProblem<'_>,
    solution: &mut JointSolution,
    shown: ShownEffects<'_>,
    work: &Work<'_>,
) -> Result<Judged, HandEyeError> {
    let heldout = quality::held_out(problem, solution, *work)?;
    let expected = joint::prediction::expected_residuals(problem, solution, *work)?;
    let widening = overdispersion::check(problem, solution, shown, work.cancel)?;
    let size = size::size(problem, solution, work.cancel)?;
    // Where the answer takes a wrong size for true, its overdispersion is due to the size, and no reason to doubt
    // another one.
    let size = if problem.free.scale { size.map(|size| size.widened(widening.factor)) } else { size };
    solution.widen(&widening);
    Ok(Judged {
        heldout,
        expected_heldout_rms_px: expected.prediction_px,
        robot_effect_px: expected.robot_px,
        widening,
        error_curve: joint::prediction::error_by_views(problem, solution, *work)?,
        size,
    })
}
