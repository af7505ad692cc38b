//! Calibration from corners.

use super::arm_fit::arm_fit;
use super::detected_view::DetectedView;
use super::lens::Lens;
use super::refine::{self, Judged, Refined};
use super::residuals::{residuals, squared_residuals};
use super::{
    CalibrateError, CalibratedCamera, Fit, JointDepths, JointFit, LinkCovariances, Method, Observations, Options,
    RefutedLens, ShapeEstimate, ViewResult, ViewStatus, check_motion, chosen, closed_forms, two_poses,
};
use crate::given_lens;
use crate::handeye::closed_form::ClosedFormSolution;
use crate::handeye::consensus::Consensus;
use crate::handeye::joint::{JointProblem, LensPrior, ShownEffects, camera_from_target};
use crate::handeye::motion::MIN_VIEWS;
use crate::handeye::numbering::Turns;
use crate::handeye::{HandEye, HandEyeError, Mode, PosePair, determined};
use handeye_geometry::frames::{Camera, Pose, Target};
use handeye_geometry::progress::Work;
use handeye_geometry::statistics::median_high;
use handeye_geometry::targets::TargetSpec;
use handeye_geometry::targets::bent::BoardPoints;
use handeye_geometry::targets::observation::{self, View};

pub fn calibrate(
    observations: &Observations,
    method: Method,
    options: Options,
    work: &Work<'_>,
) -> Result<Fit, CalibrateError> {
    let session = match Prepared::new(observations, options, work)? {
        Prepared::Camera(calibration) => return Ok(*calibration),
        Prepared::HandEye(session) => *session,
    };
    match method {
        Method::ClosedForm(name) => session.closed_form(name),
        Method::Joint => {
            let known = session.lens.known.map(|known| (known.intrinsics, known.information()));
            let prior = known.as_ref().map(|(expected, information)| LensPrior { expected: *expected, information });
            let refuted = session.refuted_lens(options, work)?;
            // A refuted prior must not pull the answer.
            let prior = prior.filter(|_| refuted.is_none());
            let refined = session.alone(prior, options, work)?;
            let mut fit = session.finish(refined, prior, work)?;
            if let Some(joint) = &mut fit.joint {
                joint.refuted_lens = refuted;
            }
            Ok(fit)
        }
    }
}

/// What is computed before the hand-eye transform.
pub enum Prepared<'a> {
    /// Without a robot the calibration ends here.
    Camera(Box<Fit>),
    /// All that the joint estimate begins with.
    HandEye(Box<Session<'a>>),
}

impl<'a> Prepared<'a> {
    /// Camera, views, closed forms and a start.
    pub fn new(observations: &'a Observations, options: Options, work: &Work<'_>) -> Result<Self, CalibrateError> {
        let seen: Vec<DetectedView<'_>> = observations.views.iter().enumerate().filter_map(DetectedView::new).collect();
        if seen.len() < MIN_VIEWS {
            return Err(too_few(observations, seen.len()));
        }
        let (seen, wrong, lens) = believable(observations, seen, options, work)?;
        let mut calibration = without_hand_eye(observations, &seen, &lens);
        for index in wrong {
            calibration.views[index].status = ViewStatus::Outlier;
        }
        let Some(mode) = observations.mode else { return Ok(Self::Camera(Box::new(calibration))) };

        let (mut views, mut pairs) = with_robot(mode, &seen, &lens)?;
        check_motion(mode, &pairs)?;
        calibration.methods = closed_forms(&pairs, work)?;
        let board = BoardPoints::new(&observations.target.points());
        let mut alternatives = lens.alternatives.clone();
        let mut rounds = 0;
        let begin = loop {
            let problem = JointProblem::new(mode, &board, &views);
            let begin = refine::start(&problem, &observations.target, &lens, &pairs, &calibration.methods);
            let Ok(found) = &begin else { break begin };
            for (i, quarters) in &found.turned {
                renumber(&mut views[*i], &mut pairs[*i], &mut alternatives[*i], &observations.target, *quarters);
                let view = &mut calibration.views[seen[*i].index];
                view.quarter_turns = (view.quarter_turns + quarters) % 4;
            }
            let changed = two_poses::take_agreeing(&mut pairs, &mut alternatives, &found.solution);
            if !changed && found.turned.is_empty() {
                break begin;
            }
            calibration.methods = closed_forms(&pairs, work)?;
            rounds += 1;
            if rounds == ROUNDS {
                break begin;
            }
        };
        Ok(Self::HandEye(Box::new(Session { seen, lens, calibration, mode, board, views, pairs, begin })))
    }
}

/// A session with a robot, up to the joint estimate.
pub struct Session<'a> {
    seen: Vec<DetectedView<'a>>,
    lens: Lens,
    /// What is known so far.
    calibration: Fit,
    mode: Mode,
    board: BoardPoints,
    views: Vec<View>,
    pairs: Vec<PosePair>,
    begin: Result<Consensus, HandEyeError>,
}

/// What a joint estimate was made from.
pub struct Fitted {
    /// The target's points, with print errors where the data show them.
    board: BoardPoints,
    /// The views that are not outliers.
    views: Vec<View>,
}

impl Session<'_> {
    /// The answer of a closed form.
    fn closed_form(mut self, name: &str) -> Result<Fit, CalibrateError> {
        let solution = chosen(&self.calibration.methods, name)?;
        let problem = JointProblem::new(self.mode, &self.board, &self.views);
        take_closed_form(&mut self.calibration, &solution, &problem, &self.seen, &self.lens);
        Ok(self.calibration)
    }

    /// The joint estimate with what is known of the lens beforehand.
    pub fn refine(
        &self,
        lens: Option<LensPrior<'_>>,
        options: Options,
        work: &Work<'_>,
    ) -> Result<Refined, CalibrateError> {
        let begin = self.begin.as_ref().map_err(Clone::clone)?;
        let problem = JointProblem { lens_prior: lens, ..JointProblem::new(self.mode, &self.board, &self.views) };
        let own: Vec<_> = self.pairs.iter().map(|pair| pair.camera_from_target).collect();
        refine::refine(&problem, &own, &self.lens, begin, options, work)
    }

    /// Whether the views contradict what is known of the lens: as a prior it would distort the noise levels and so hide the
    /// contradiction.
    fn refuted_lens(&self, options: Options, work: &Work<'_>) -> Result<Option<RefutedLens>, CalibrateError> {
        let Some(known) = &self.lens.known else { return Ok(None) };
        match self.refine(None, options, work) {
            Ok(by_views) => Ok(given_lens::refuted(known, &by_views.screened.solution)),
            Err(CalibrateError::HandEye(HandEyeError::Cancelled)) => Err(HandEyeError::Cancelled.into()),
            // The views do not determine a lens.
            Err(_) => Ok(None),
        }
    }

    /// The joint estimate of the session alone, with what is known of its lens beforehand, and the error that may be stated.
    pub fn alone(
        &self,
        prior: Option<LensPrior<'_>>,
        options: Options,
        work: &Work<'_>,
    ) -> Result<Refined, CalibrateError> {
        let mut refined = self.refine(prior, options, work)?;
        let fitted = self.fitted(&refined);
        let problem = self.problem(&refined, &fitted, prior);
        refined = refined.with_distortion(&problem, work)?;
        let fitted = self.fitted(&refined);
        let as_drawn = JointProblem { board: &self.board, ..self.problem(&refined, &fitted, prior) };
        refined = refined.with_settled_print(&as_drawn, work)?;
        let fitted = self.fitted(&refined);
        let problem = self.problem(&refined, &fitted, prior);
        Ok(refined.stated(&problem, work)?)
    }

    /// What a joint estimate was made from.
    pub fn fitted(&self, refined: &Refined) -> Fitted {
        Fitted { board: refined.board(&self.board), views: refined.screened.kept_views() }
    }

    /// The problem that a joint estimate solved.
    pub fn problem<'p>(&self, refined: &Refined, of: &'p Fitted, lens: Option<LensPrior<'p>>) -> JointProblem<'p> {
        let all = JointProblem::new(self.mode, &of.board, &of.views);
        let problem = JointProblem { weights: refined.weights, depth: refined.depth_weight(), lens_prior: lens, ..all };
        refine::kept_problem(&problem, &of.views, &refined.screened.solution)
    }

    /// The calibration with a joint estimate that was made with what is known of the lens.
    pub fn finish(
        mut self,
        mut refined: Refined,
        lens: Option<LensPrior<'_>>,
        work: &Work<'_>,
    ) -> Result<Fit, CalibrateError> {
        let fitted = self.fitted(&refined);
        if fitted.views.len() < self.pairs.len() {
            // For comparison on the same views.
            let kept: Vec<PosePair> = refined.screened.kept.iter().map(|i| self.pairs[*i]).collect();
            self.calibration.methods = closed_forms(&kept, work)?;
        }
        let mut calibration = std::mem::take(&mut self.calibration);
        let problem = self.problem(&refined, &fitted, lens);
        let shown = ShownEffects { print: refined.print.as_ref(), distortion: refined.distortion.as_ref() };
        let judged = refine::judge(&problem, &mut refined.screened.solution, shown, work)?;
        take_joint(&mut calibration, &problem, &refined, judged, &self.seen);
        if let Some(joint) = &mut calibration.joint {
            joint.arm = arm_fit(&problem, &refined.screened.solution, refined.shown(), work)?;
            joint.known_lens = self.lens.known.filter(|_| lens.is_some());
            let solution = &refined.screened.solution;
            let widened = joint.widening.factor;
            let at_half = given_lens::error_at_half_a_pixel_95_m(&problem, solution, widened, work.cancel);
            joint.error_at_half_a_pixel_95_m = determined(at_half)?.flatten();
        }
        Ok(calibration)
    }
}

/// Rounds of a start and of the poses that agree with it: a better start may find more of them.
const ROUNDS: usize = 5;

/// Numbers the corners of a view from another corner of the target, and its poses with them.
fn renumber(
    view: &mut View,
    pair: &mut PosePair,
    alternative: &mut Option<Pose<Camera, Target>>,
    target: &TargetSpec,
    quarters: usize,
) {
    observation::renumber(&mut view.corners, &mut view.depth, target, quarters);
    let turns = Turns::of(target);
    for pose in std::iter::once(&mut pair.camera_from_target).chain(alternative) {
        *pose = turns.turned(pose, quarters);
    }
}

/// How many times the typical residual of a view's own pose a view may have before its corners are taken as wrong: a target
/// numbered wrongly or found in something else misses by whole squares.
const WRONG_CORNERS: f64 = 8.0;
/// Residuals below this, in pixels, do not indicate wrong corners, however good the others are.
const FINE_PX: f64 = 1.0;

/// The views whose corners make sense as an image of the target, those whose do not, and the camera by the former.
fn believable<'a>(
    observations: &Observations,
    seen: Vec<DetectedView<'a>>,
    options: Options,
    work: &Work<'_>,
) -> Result<(Vec<DetectedView<'a>>, Vec<usize>, Lens), CalibrateError> {
    let lens = Lens::find(observations, &seen, options.keep_outliers, work)?;
    let usual = median_high(lens.rms_px.iter().copied()).unwrap_or(0.0);
    let limit = (WRONG_CORNERS * usual).max(FINE_PX);
    let good = lens.rms_px.iter().filter(|rms| **rms <= limit).count();
    if options.keep_outliers || good == seen.len() || good < MIN_VIEWS {
        return Ok((seen, Vec::new(), lens));
    }
    let (kept, wrong): (Vec<_>, Vec<_>) = seen.into_iter().zip(&lens.rms_px).partition(|(_, rms)| **rms <= limit);
    let kept: Vec<DetectedView<'a>> = kept.into_iter().map(|(s, _)| s).collect();
    let wrong = wrong.into_iter().map(|(s, _)| s.index).collect();
    let lens = Lens::find(observations, &kept, options.keep_outliers, work)?;
    Ok((kept, wrong, lens))
}

/// Whether it is the target that is missing, or views that were left out.
fn too_few(observations: &Observations, found: usize) -> CalibrateError {
    let excluded = observations.views.iter().filter(|v| !v.in_fit).count();
    let with_excluded = observations.views.iter().filter(|v| v.corners.is_some()).count();
    if with_excluded >= MIN_VIEWS {
        return CalibrateError::TooFewLeft { left: found, excluded, need: MIN_VIEWS };
    }
    CalibrateError::TargetNotFound {
        found,
        images: observations.views.len() - excluded,
        need: MIN_VIEWS,
        target: observations.target.to_string(),
    }
}

/// RMS over all corners from the RMS of each view.
fn total_rms(per_view: impl Iterator<Item = (f64, usize)>) -> f64 {
    let (squared, corners) = per_view.fold((0.0, 0usize), |(s, n), (rms, k)| (s + rms * rms * k as f64, n + k));
    (squared / corners.max(1) as f64).sqrt()
}

fn without_hand_eye(observations: &Observations, seen: &[DetectedView<'_>], lens: &Lens) -> Fit {
    let mut views: Vec<ViewResult> =
        observations.views.iter().map(|v| ViewResult::new(v, ViewStatus::NoTarget)).collect();
    let points = BoardPoints::new(&observations.target.points()).points(&lens.shape);
    let mut corners_used = Vec::with_capacity(seen.len());
    for (i, s) in seen.iter().enumerate() {
        let corners = lens.corners_left(i, s.corners);
        let view = &mut views[s.index];
        view.status = ViewStatus::Used;
        view.rms_px = Some(lens.rms_px[i]);
        view.rejected_corners.clone_from(&lens.rejected[i]);
        if observations.mode.is_none() {
            // With a robot the residuals are those of its chain.
            view.residuals = residuals(&lens.intrinsics, &lens.camera_from_target[i], &points, &corners);
        }
        view.camera_from_target = Some(lens.camera_from_target[i]);
        corners_used.push(corners.len());
    }
    let sigma_px = lens.fit.as_ref().and_then(|fit| fit.sigma_px);
    Fit {
        camera: Some(CalibratedCamera {
            intrinsics: lens.intrinsics,
            fixed: !lens.free || lens.known.is_some(),
            sigma_px,
        }),
        camera_fit: lens.fit,
        lens_by_corners: (lens.free && lens.known.is_none() && !lens.is_bent()).then_some(lens.intrinsics),
        rms_px: Some(total_rms(lens.rms_px.iter().copied().zip(corners_used))),
        views,
        ..Fit::default()
    }
}

/// Views and pose pairs of the robot; a view without a robot pose cannot be in a set with a mode.
fn with_robot(
    mode: Mode,
    seen: &[DetectedView<'_>],
    lens: &Lens,
) -> Result<(Vec<View>, Vec<PosePair>), CalibrateError> {
    let mut views = Vec::with_capacity(seen.len());
    let mut pairs = Vec::with_capacity(seen.len());
    for (s, camera_from_target) in seen.iter().zip(&lens.camera_from_target) {
        let Some(base_from_tip) = s.view.base_from_tip else {
            return Err(CalibrateError::NoRobotPose { name: s.view.name.clone() });
        };
        views.push(View {
            corners: s.corners.clone(),
            tip_from_joints: s.view.tip_from_joints.clone(),
            depth: s.view.depth,
            ..View::new(s.view.name.clone(), base_from_tip, Vec::new())
        });
        pairs.push(PosePair {
            anchor_from_mount: mode.anchor_from_mount(&base_from_tip),
            camera_from_target: *camera_from_target,
        });
    }
    Ok((views, pairs))
}

fn take_joint(
    calibration: &mut Fit,
    problem: &JointProblem<'_>,
    refined: &Refined,
    judged: Judged,
    seen: &[DetectedView<'_>],
) {
    let screened = &refined.screened;
    let solution = &screened.solution;
    calibration.hand_eye = Some(solution.hand_eye);
    calibration.link_covariances =
        Some(LinkCovariances { hand_eye: solution.hand_eye_covariance(), target: solution.target_covariance() });
    let sigma_px = solution.intrinsics_sigma().first_chunk::<4>().copied();
    calibration.camera = calibration.camera.map(|camera| CalibratedCamera {
        intrinsics: solution.intrinsics,
        sigma_px: sigma_px.or(camera.sigma_px),
        fixed: !solution.free.intrinsics,
    });
    calibration.camera_fit = None;
    calibration.rms_px = Some(solution.rms_px);
    let estimated = solution.free.warp || solution.free.scale;
    calibration.joint = Some(JointFit {
        known_lens: None,
        refuted_lens: None,
        error_at_half_a_pixel_95_m: None,
        free: solution.free,
        covariance: solution.covariance.clone(),
        noise: solution.noise,
        weights: refined.weights,
        small_sample: solution.small_sample,
        widening: judged.widening,
        reference_point: solution.reference_point,
        error_curve: judged.error_curve,
        heldout_rms_px: judged.heldout.map(|held| held.rms_px),
        heldout_links_rms_px: judged.heldout.map(|held| held.links_rms_px),
        field: solution.field.clone(),
        print: refined.print.clone(),
        depths: refined.depths.map(|in_fit| JointDepths { in_fit, bias: solution.depth }),
        residual_distortion: refined.distortion.clone(),
        expected_heldout_rms_px: judged.expected_heldout_rms_px,
        robot_effect_px: judged.robot_effect_px,
        shape: estimated.then(|| ShapeEstimate {
            shape: solution.shape,
            warp_sigma_m: solution.warp_covariance().map(|c| [c[(0, 0)].sqrt(), c[(1, 1)].sqrt()]),
            scale_sigma: solution.scale_sigma(),
        }),
        size: judged.size,
        arm: None,
    });
    let points = problem.board.points(&solution.shape);
    for (i, s) in seen.iter().enumerate() {
        let view = &mut calibration.views[s.index];
        view.distance = screened.distances.get(i).copied();
        view.rejected_corners = screened.corners.iter().filter(|(v, _)| *v == i).map(|(_, index)| *index).collect();
        let corners = &screened.views[i].corners;
        let fit = screened.kept.binary_search(&i).ok().map(|place| &solution.views[place]);
        let pose = match fit {
            Some(fit) => fit.camera_from_target,
            // Where the other views expect it: the residuals then show what the view does not fit.
            None => camera_from_target(
                problem.mode,
                &solution.base_from_tip(&screened.views[i]),
                &solution.hand_eye.mount_from_camera(),
                &solution.hand_eye.anchor_from_target(),
            ),
        };
        view.residuals = residuals(&solution.intrinsics, &pose, &points, corners);
        if let Some(distortion) = &refined.distortion {
            for residual in &mut view.residuals {
                // It was subtracted before; the shift of a corner is too small to change its value at the measured
                // place.
                residual.px += distortion.field.at(&residual.px);
            }
        }
        view.camera_from_target = Some(pose);
        if let Some(fit) = fit {
            view.rms_px = Some(fit.rms_px);
            view.influence_m = fit.influence_m;
            view.correction_m = Some(fit.correction.fixed_rows::<3>(0).norm());
            view.correction_rad = Some(fit.correction.fixed_rows::<3>(3).norm());
        } else {
            view.status = ViewStatus::Outlier;
            let squares: f64 = view.residuals.iter().map(|r| r.residual_px.norm_squared()).sum();
            view.rms_px = (!view.residuals.is_empty()).then(|| (squares / view.residuals.len() as f64).sqrt());
        }
    }
}

/// A closed form has no correction of robot poses: its residuals are those of the bare chain.
fn take_closed_form(
    calibration: &mut Fit,
    solution: &ClosedFormSolution,
    problem: &JointProblem<'_>,
    seen: &[DetectedView<'_>],
    lens: &Lens,
) {
    let mut rms = Vec::with_capacity(seen.len());
    let points = problem.board.points(&lens.shape);
    for (s, view) in seen.iter().zip(problem.views) {
        let squared = squared_residuals(problem, (&lens.intrinsics, &lens.shape), solution, view, f64::INFINITY);
        let view_rms = (squared / view.corners.len() as f64).sqrt();
        let result = &mut calibration.views[s.index];
        let pose = camera_from_target(
            problem.mode,
            &view.base_from_tip,
            &solution.mount_from_camera,
            &solution.anchor_from_target,
        );
        result.rms_px = view_rms.is_finite().then_some(view_rms);
        result.residuals = residuals(&lens.intrinsics, &pose, &points, &view.corners);
        result.camera_from_target = Some(pose);
        rms.push((view_rms, view.corners.len()));
    }
    let all = total_rms(rms.into_iter());
    calibration.rms_px = all.is_finite().then_some(all);
    calibration.hand_eye = Some(HandEye::new(problem.mode, solution.mount_from_camera, solution.anchor_from_target));
}
