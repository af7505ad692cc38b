//! Error on views that the fit has not seen.

use nalgebra::{Isometry3, Point3, Vector3};

use crate::handeye::HandEyeError;
use crate::handeye::joint::state::State;
use crate::handeye::joint::{JointProblem, JointSolution, camera_from_target, corrected_base_from_tip};
use crate::handeye::motion::MIN_VIEWS;
use handeye_geometry::camera::Intrinsics;
use handeye_geometry::frames::{Anchor, Camera, Mount, Pose, Target};
use handeye_geometry::planar_pose::refine::refine;
use handeye_geometry::progress::{CancelToken, Stage, Work};
use handeye_geometry::statistics::better_by_chance;
use handeye_geometry::targets::bent::{BoardPoints, BoardShape};
use handeye_geometry::targets::observation::{Corner, View};
use handeye_geometry::view_equations::{ViewInput, Whitener};

/// Most folds of the cross-validation.
const FOLDS: usize = 5;

/// Errors on views that were not in the fit, each predicted from its reported robot pose alone.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct HeldOut {
    /// RMS of 2-D corner residuals, pixels.
    pub rms_px: f64,
    /// The same by the two links alone, without the robot's field; the same number where there is none.
    pub links_rms_px: f64,
    /// RMS over the views of [`board_error_m`], metres.
    pub rms_m: f64,
}

/// Distance of the middle of the target by a view from that by the fit: the distance in the anchor frame between
/// `anchor_from_mount * mount_from_camera * camera_from_target * centre` and `anchor_from_target * centre`, metres, with
/// the target's pose in the camera found from the corners of the view alone.
pub fn board_error_m(
    anchor_from_mount: &Pose<Anchor, Mount>,
    mount_from_camera: &Pose<Mount, Camera>,
    camera_from_target: &Pose<Camera, Target>,
    anchor_from_target: &Pose<Anchor, Target>,
    centre: &Point3<f64>,
) -> f64 {
    let seen = *anchor_from_mount * *mount_from_camera * *camera_from_target;
    (seen.isometry() * centre - anchor_from_target.isometry() * centre).norm()
}

/// [`HeldOut`] over five folds (or one view at a time when there are fewer than ten). View `i` is in fold `i mod folds`. The
/// answer without a fold is one Newton step from that of all views, whose equations are available, so that no view is
/// linearised again: what the step leaves is of second order in its length. Noise levels are kept: without a fifth of the
/// views they differ by a few percent, which moves a prediction by much less than its error.
///
/// `None` when a fold leaves too few views for a fit, or puts a held-out target behind the camera. `work` is a
/// `&CancelToken`, or a [`Work`] to follow the progress.
///
/// # Errors
/// [`HandEyeError::Cancelled`].
pub fn held_out<'a>(
    problem: &JointProblem<'_>,
    solution: &JointSolution,
    work: impl Into<Work<'a>>,
) -> Result<Option<HeldOut>, HandEyeError> {
    let Some(by_view) = predicted_by_view(problem, solution, work.into())? else { return Ok(None) };
    let squares = by_view.iter().fold(Squares::default(), |sum, of_view| sum.plus(of_view));
    let corners: usize = problem.views.iter().map(|view| view.corners.len()).sum();
    let rms = |squares: f64, count: usize| (squares / count as f64).sqrt();
    Ok((corners > 0).then(|| HeldOut {
        rms_px: rms(squares.px, corners),
        links_rms_px: rms(squares.links_px, corners),
        rms_m: rms(squares.m, by_view.len()),
    }))
}

/// For every view the squares of its prediction by a fit without its fold, as in [`held_out`].
fn predicted_by_view(
    problem: &JointProblem<'_>,
    solution: &JointSolution,
    work: Work<'_>,
) -> Result<Option<Vec<Squares>>, HandEyeError> {
    let state = State::of(solution);
    let system = solution.linearised(problem)?;
    let all = system.reduce(&solution.noise)?;
    let count = problem.views.len();
    let folds = if count < 2 * FOLDS { count } else { FOLDS };
    let mut by_view: Vec<Squares> = (0..count).map(|_| Squares::default()).collect();
    for fold in 0..folds {
        work.report(Stage::HeldOut, fold, folds);
        if work.is_cancelled() {
            return Err(HandEyeError::Cancelled);
        }
        let held: Vec<usize> = (fold..count).step_by(folds).collect();
        if count - held.len() < MIN_VIEWS {
            return Ok(None);
        }
        let blocks = held.iter().map(|&i| (&system.blocks[i], &state.corrections[i]));
        let Some(step) = all.step_without(blocks, &solution.noise) else { return Ok(None) };
        let fit = state.stepped(problem, &step, &[]);
        for i in held {
            let Some(of_view) = prediction_squares(problem, &fit, &problem.views[i]) else { return Ok(None) };
            by_view[i] = of_view;
        }
    }
    Ok(Some(by_view))
}

/// Sums of squares over held-out views: pixels of all corners, by the links alone too, and metres at the board.
#[derive(Default)]
struct Squares {
    px: f64,
    links_px: f64,
    m: f64,
}

impl Squares {
    fn plus(&self, other: &Self) -> Self {
        Self { px: self.px + other.px, links_px: self.links_px + other.links_px, m: self.m + other.m }
    }
}

/// Probability that a model predicts views left out better by chance, below which it counts as better. Eight views that all
/// gain come about by chance four times in a thousand: with fewer views this cannot be shown.
pub const BY_CHANCE: f64 = 5e-3;

/// Probability that views left out are predicted worse by chance, below which it counts as worse.
const WORSE_BY_CHANCE: f64 = 0.05;

/// The model by which a view left out is predicted.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum PredictedBy {
    /// All of the model.
    Model,
    /// The model without the field of reported poses: the prediction by uncorrected poses.
    Links,
}

/// Two models of the same views, by the views that they leave out.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Compared {
    /// RMS of 2-D corner residuals by the first, pixels.
    pub before_px: f64,
    /// The same by the second.
    pub after_px: f64,
    /// Whether the second predicts worse, by more than chance: signed ranks of the squares view by view, once in twenty.
    pub is_worse: bool,
}

/// Compares two estimates from the same views, predicted as in [`held_out`]; `None` where one of them cannot be.
///
/// # Errors
/// [`HandEyeError::Cancelled`].
pub(crate) fn compared(
    before: (&JointProblem<'_>, &JointSolution),
    after: (&JointProblem<'_>, &JointSolution),
    by: PredictedBy,
    cancel: &CancelToken,
) -> Result<Option<Compared>, HandEyeError> {
    let px = |of: &Squares| if by == PredictedBy::Model { of.px } else { of.links_px };
    let predicted = |(problem, solution)| predicted_by_view(problem, solution, cancel.into());
    let (Some(first), Some(second)) = (predicted(before)?, predicted(after)?) else { return Ok(None) };
    let corners: usize = before.0.views.iter().map(|view| view.corners.len()).sum();
    let rms_px = |views: &[Squares]| (views.iter().map(px).sum::<f64>() / corners as f64).sqrt();
    let losses: Vec<f64> = first.iter().zip(&second).map(|(before, after)| px(after) - px(before)).collect();
    let is_worse = better_by_chance(&losses) < WORSE_BY_CHANCE;
    Ok(Some(Compared { before_px: rms_px(&first), after_px: rms_px(&second), is_worse }))
}

/// Squares of one view predicted from its reported robot pose; `None` when a point falls behind the camera.
fn prediction_squares(problem: &JointProblem<'_>, fit: &State, view: &View) -> Option<Squares> {
    let (x, y) = (fit.mount_from_camera, fit.anchor_from_target);
    let points = problem.board.points(&fit.shape);
    let squared_px = |predicted: &Pose<Camera, Target>| -> Option<f64> {
        let squared = |corner: &Corner| {
            let px = fit.intrinsics.project(&(predicted.isometry() * points[corner.index])).ok()?;
            Some((px - corner.px).norm_squared())
        };
        view.corners.iter().map(squared).sum()
    };
    let base_from_tip = corrected_base_from_tip(view, fit.arm.as_ref(), fit.field.as_ref());
    let predicted = camera_from_target(problem.mode, &base_from_tip, &x, &y);
    let px = squared_px(&predicted)?;
    let links_px = if fit.field.is_some() {
        let by_links = corrected_base_from_tip(view, fit.arm.as_ref(), None);
        squared_px(&camera_from_target(problem.mode, &by_links, &x, &y))?
    } else {
        px
    };
    let seen = pose_of_view(&fit.intrinsics, problem.board, &fit.shape, &view.corners, &predicted)?;
    let centre = Point3::from(points.iter().map(|p| p.coords).sum::<Vector3<f64>>() / points.len().max(1) as f64);
    let anchor_from_mount = problem.mode.anchor_from_mount(&base_from_tip);
    Some(Squares { px, links_px, m: board_error_m(&anchor_from_mount, &x, &seen, &y, &centre).powi(2) })
}

/// Steps from a pose nearby: Gauss–Newton from a few pixels off needs three or four.
const STEPS: usize = 10;

/// The target's pose from the corners of one view alone, from one nearby; `None` when that puts a corner behind the
/// camera. Where the corners do not determine a pose the start is returned.
pub fn pose_of_view(
    intrinsics: &Intrinsics,
    board: &BoardPoints,
    shape: &BoardShape,
    corners: &[Corner],
    start: &Pose<Camera, Target>,
) -> Option<Pose<Camera, Target>> {
    weighted_pose_of_view(
        &ViewInput { intrinsics, board, shape, corners, whitener: &Whitener::Alike, depths: None },
        start.isometry(),
    )
}

/// The same with weighted corners.
pub(crate) fn weighted_pose_of_view(seen: &ViewInput<'_>, start: &Isometry3<f64>) -> Option<Pose<Camera, Target>> {
    refine(seen, start, STEPS).map(|minimum| Pose::from_isometry(minimum.pose))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::handeye::Mode;
    use crate::handeye::joint::{Noise, estimate, fit};
    use crate::test_sessions::Estimated as _;
    use handeye_simulate::session::{camera, trial};

    /// Views that stayed in the fit would be predicted too well, which would not be noticed.
    #[test]
    fn views_held_out_are_predicted_as_by_fits_that_never_saw_them() {
        let noise = Noise { corner_px: 0.1, robot_m: 5e-4, robot_rad: 1.7e-3, ..Noise::EXACT };
        let cancel = CancelToken::default();
        for (views, folds) in [(6, 6), (12, 5)] {
            for free_lens in [false, true] {
                let t = trial(Mode::EyeInHand, views, &noise, camera(), 21);
                let problem = t.problem(free_lens, None);
                let solution = estimate(&problem, &t.start(), &cancel).expect("solves");
                let found = held_out(&problem, &solution, &cancel).expect("solves").expect("enough views");
                let (mut squares, mut inside, mut corners) = (0.0, 0.0, 0);
                for fold in 0..folds {
                    let rest: Vec<View> =
                        (0..views).filter(|i| i % folds != fold).map(|i| problem.views[i].clone()).collect();
                    let alone = JointProblem { views: &rest, noise: Some(solution.noise), ..problem };
                    let alone = fit(&alone, &solution.as_start(), &cancel).expect("solves");
                    for view in (0..views).filter(|i| i % folds == fold).map(|i| &problem.views[i]) {
                        let of = |s| prediction_squares(&problem, &State::of(s), view).expect("in front").px;
                        squares += of(&alone);
                        inside += of(&solution);
                        corners += view.corners.len();
                    }
                }
                let [expected, seen] = [squares, inside].map(|sum| f64::sqrt(sum / corners as f64));
                let found = found.rms_px;
                println!(
                    "{views} views, free lens {free_lens}: {found:.4} px, by fits {expected:.4}, in the fit {seen:.4}"
                );
                assert!((found / expected - 1.0).abs() < 1e-3, "{found} {expected}");
                assert!(found > 1.05 * seen, "{found} {seen}: the test does not tell");
            }
        }
    }
}
