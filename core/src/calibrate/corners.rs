//! Calibration from corners.

use nalgebra::Point3;

use super::lens::Lens;
use super::{
    CalibrateError, Calibration, CornerResidual, Method, Observations, ViewResult, ViewStatus, best_start,
    check_motion, chosen, closed_forms,
};
use crate::camera::Intrinsics;
use crate::frames::{Camera, Pose, Target};
use crate::handeye::closed_form::ClosedFormSolution;
use crate::handeye::joint::{self, JointProblem, JointStart, camera_from_target, prediction};
use crate::handeye::{HandEye, Mode, PosePair, quality, subset};
use crate::observation::{Corner, View};
use crate::progress::Work;

/// Least number of views with the target in sight.
pub(crate) const NEED: usize = 3;

pub fn calibrate(observations: &Observations, method: Method, work: &Work<'_>) -> Result<Calibration, CalibrateError> {
    let seen: Vec<Seen<'_>> = observations.views.iter().enumerate().filter_map(Seen::new).collect();
    if seen.len() < NEED {
        return Err(too_few(observations, seen.len()));
    }
    let refined = observations.mode.is_some() && method == Method::Joint;
    let lens = Lens::find(observations, &seen, refined, work)?;
    let mut calibration = without_hand_eye(observations, &seen, &lens);
    let Some(mode) = observations.mode else { return Ok(calibration) };

    let (views, pairs) = with_robot(mode, &seen, &lens)?;
    check_motion(&pairs)?;
    calibration.methods = closed_forms(&pairs, work)?;
    let points = observations.target.points();
    let problem = JointProblem { mode, points: &points, views: &views, free_intrinsics: lens.free, noise: None };
    match method {
        Method::ClosedForm(name) => {
            let solution = chosen(&calibration.methods, name)?;
            take_closed_form(&mut calibration, &solution, &problem, &seen, &lens);
        }
        Method::Joint => take_joint(&mut calibration, &problem, &seen, &lens, work)?,
    }
    Ok(calibration)
}

/// Whether it is the target that is missing, or views that were left out.
fn too_few(observations: &Observations, found: usize) -> CalibrateError {
    let excluded = observations.views.iter().filter(|v| !v.in_fit).count();
    let with_excluded = observations.views.iter().filter(|v| v.corners.is_some()).count();
    if with_excluded >= NEED {
        return CalibrateError::TooFewLeft { left: found, excluded, need: NEED };
    }
    CalibrateError::TargetNotFound {
        found,
        images: observations.views.len() - excluded,
        need: NEED,
        target: observations.target.to_string(),
    }
}

/// A view in the fit in which the target was found.
pub(super) struct Seen<'a> {
    /// Its index among all views.
    index: usize,
    view: &'a super::ObservedView,
    pub(super) corners: &'a [Corner],
}

impl<'a> Seen<'a> {
    fn new((index, view): (usize, &'a super::ObservedView)) -> Option<Self> {
        Some(Self { index, view, corners: view.corners.as_deref().filter(|_| view.in_fit)? })
    }
}

/// RMS over all corners from the RMS of each view.
fn total_rms(per_view: impl Iterator<Item = (f64, usize)>) -> f64 {
    let (squared, corners) = per_view.fold((0.0, 0usize), |(s, n), (rms, k)| (s + rms * rms * k as f64, n + k));
    (squared / corners.max(1) as f64).sqrt()
}

fn without_hand_eye(observations: &Observations, seen: &[Seen<'_>], lens: &Lens) -> Calibration {
    let mut views: Vec<ViewResult> =
        observations.views.iter().map(|v| ViewResult::new(v, ViewStatus::NoTarget)).collect();
    let points = observations.target.points();
    for ((s, rms), pose) in seen.iter().zip(&lens.rms_px).zip(&lens.camera_from_target) {
        let view = &mut views[s.index];
        view.status = ViewStatus::Used;
        view.rms_px = Some(*rms);
        view.residuals = residuals(&lens.intrinsics, pose, &points, s.corners);
        view.camera_from_target = Some(*pose);
    }
    Calibration {
        hand_eye: None,
        hand_eye_covariance: None,
        target_covariance: None,
        shared_covariance: None,
        intrinsics: Some(lens.intrinsics),
        intrinsics_fixed: !lens.free,
        intrinsics_sigma: lens.sigma,
        noise: None,
        rms_px: Some(total_rms(lens.rms_px.iter().copied().zip(seen.iter().map(|s| s.corners.len())))),
        heldout_rms_px: None,
        expected_heldout_rms_px: None,
        robot_effect_px: None,
        tip_error_95_m: None,
        reference_point: None,
        error_curve: None,
        methods: Vec::new(),
        views,
    }
}

/// Views and pose pairs of the robot; a view without a robot pose cannot stand in a set with a mode.
fn with_robot(mode: Mode, seen: &[Seen<'_>], lens: &Lens) -> Result<(Vec<View>, Vec<PosePair>), CalibrateError> {
    let mut views = Vec::with_capacity(seen.len());
    let mut pairs = Vec::with_capacity(seen.len());
    for (s, camera_from_target) in seen.iter().zip(&lens.camera_from_target) {
        let Some(base_from_tip) = s.view.base_from_tip else {
            return Err(CalibrateError::NoRobotPose { name: s.view.name.clone() });
        };
        views.push(View { name: s.view.name.clone(), base_from_tip, corners: s.corners.to_vec() });
        pairs.push(PosePair {
            anchor_from_mount: mode.anchor_from_mount(&base_from_tip),
            camera_from_target: *camera_from_target,
        });
    }
    Ok((views, pairs))
}

fn take_joint(
    calibration: &mut Calibration,
    problem: &JointProblem<'_>,
    seen: &[Seen<'_>],
    lens: &Lens,
    work: &Work<'_>,
) -> Result<(), CalibrateError> {
    let start = best_start(&calibration.methods, |s| capped_misfit(problem, lens, s))?;
    let start = JointStart {
        mount_from_camera: start.mount_from_camera,
        anchor_from_target: start.anchor_from_target,
        intrinsics: lens.intrinsics,
    };
    let solution = joint::estimate(problem, &start, *work)?;
    let from_solution = JointStart {
        mount_from_camera: solution.hand_eye.mount_from_camera(),
        anchor_from_target: solution.hand_eye.anchor_from_target(),
        intrinsics: solution.intrinsics,
    };
    // Leaving out a fifth of so many views changes their noise levels by a few percent, and finding them again would
    // take longer than everything else.
    let known = (problem.views.len() > subset::MOST_VIEWS).then_some(solution.noise);
    let folds = JointProblem { noise: known, ..*problem };
    calibration.heldout_rms_px = quality::held_out_rms_px(&folds, &from_solution, *work)?;
    let expected = prediction::expected_residuals(problem, &solution, *work)?;
    calibration.expected_heldout_rms_px = Some(expected.prediction_px);
    calibration.robot_effect_px = Some(expected.robot_px);
    calibration.error_curve = Some(prediction::error_by_views(problem, &solution, *work)?);
    calibration.shared_covariance = Some(solution.covariance.clone());
    calibration.hand_eye_covariance = Some(solution.hand_eye_covariance());
    calibration.target_covariance = Some(solution.target_covariance());
    if let Some(sigma) = solution.intrinsics_sigma().first_chunk::<4>() {
        calibration.intrinsics_sigma = Some(*sigma);
    }
    calibration.tip_error_95_m = Some(quality::tip_error_95_m(&solution));
    calibration.reference_point = Some(solution.reference_point);
    calibration.noise = Some(solution.noise);
    calibration.rms_px = Some(solution.rms_px);
    calibration.intrinsics = Some(solution.intrinsics);
    calibration.hand_eye = Some(solution.hand_eye);
    for (s, fit) in seen.iter().zip(&solution.views) {
        let view = &mut calibration.views[s.index];
        view.rms_px = Some(fit.rms_px);
        view.influence_m = fit.influence_m;
        view.correction_m = Some(fit.correction.fixed_rows::<3>(0).norm());
        view.correction_rad = Some(fit.correction.fixed_rows::<3>(3).norm());
        view.residuals = residuals(&solution.intrinsics, &fit.camera_from_target, problem.points, s.corners);
        view.camera_from_target = Some(fit.camera_from_target);
    }
    Ok(())
}

/// A closed form has no correction of robot poses: its residuals are those of the bare chain.
fn take_closed_form(
    calibration: &mut Calibration,
    solution: &ClosedFormSolution,
    problem: &JointProblem<'_>,
    seen: &[Seen<'_>],
    lens: &Lens,
) {
    let mut rms = Vec::with_capacity(seen.len());
    for (s, view) in seen.iter().zip(problem.views) {
        let squared = squared_residuals(problem, &lens.intrinsics, solution, view, f64::INFINITY);
        let view_rms = (squared / view.corners.len() as f64).sqrt();
        let result = &mut calibration.views[s.index];
        let pose = camera_from_target(
            problem.mode,
            &view.base_from_tip,
            &solution.mount_from_camera,
            &solution.anchor_from_target,
        );
        result.rms_px = view_rms.is_finite().then_some(view_rms);
        result.residuals = residuals(&lens.intrinsics, &pose, problem.points, s.corners);
        result.camera_from_target = Some(pose);
        rms.push((view_rms, view.corners.len()));
    }
    let all = total_rms(rms.into_iter());
    calibration.rms_px = all.is_finite().then_some(all);
    calibration.hand_eye = Some(HandEye::new(problem.mode, solution.mount_from_camera, solution.anchor_from_target));
}

/// Residuals of a view at a pose of the target; none at all when a corner has no image there.
fn residuals(
    intrinsics: &Intrinsics,
    camera_from_target: &Pose<Camera, Target>,
    points: &[Point3<f64>],
    corners: &[Corner],
) -> Vec<CornerResidual> {
    let residual = |corner: &Corner| {
        let predicted = intrinsics.project(&(camera_from_target.isometry() * points[corner.index])).ok()?;
        Some(CornerResidual { index: corner.index, px: corner.px, residual_px: corner.px - predicted })
    };
    corners.iter().map(residual).collect::<Option<_>>().unwrap_or_default()
}

/// Residual [px] at which a corner counts as simply wrong when starts are ranked, so that one bad view does not decide.
const CAP_PX: f64 = 50.0;

/// Over the views that the closed forms saw.
fn capped_misfit(problem: &JointProblem<'_>, lens: &Lens, solution: &ClosedFormSolution) -> f64 {
    subset::spread(problem.views.len(), subset::MOST_VIEWS)
        .into_iter()
        .map(|i| squared_residuals(problem, &lens.intrinsics, solution, &problem.views[i], CAP_PX))
        .sum()
}

/// Sum of squared residuals of one view by the bare chain; a point without an image counts as the cap.
fn squared_residuals(
    problem: &JointProblem<'_>,
    intrinsics: &Intrinsics,
    solution: &ClosedFormSolution,
    view: &View,
    cap_px: f64,
) -> f64 {
    let chain = camera_from_target(
        problem.mode,
        &view.base_from_tip,
        &solution.mount_from_camera,
        &solution.anchor_from_target,
    );
    view.corners
        .iter()
        .map(|corner| {
            let residual = intrinsics
                .project(&(chain.isometry() * problem.points[corner.index]))
                .map_or(cap_px, |px| (px - corner.px).norm());
            residual.min(cap_px).powi(2)
        })
        .sum()
}
