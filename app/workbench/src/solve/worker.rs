//! The solver: calibrates the newest set of captures, and checks the answer on the captures that never entered it.

use std::cell::Cell;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;

use handeye_estimate::diagnose::examine;
use handeye_estimate::diagnose::findings::{Finding, FindingOptions, depth_finding, sort};
use handeye_estimate::handeye::HandEyeError;
use handeye_estimate::placement::ArmOfViews;
use handeye_estimate::robot_accuracy::RobotAccuracy;
use handeye_estimate::verify::{self, DepthCheck, DepthReport, Predictor, Verification};
use handeye_estimate::{self as estimate, CalibrateError, Fit, Method, Observations, Options, ViewStatus};
use handeye_geometry::progress::{CancelToken, Progress, Work};
use handeye_geometry::targets::bent::BoardShape;
use handeye_geometry::targets::observation::View;
use handeye_result::{ArmEstimate, CalibrationResult, DepthSummary, VerificationSummary, solve_options};
use handeye_session::CaptureId;

use crate::solve;
use crate::solve::SolveOutcome;
use crate::solve::state::{Corrected, JobId, Solved};
use crate::truth;
use crate::worker::link::Outlet;
use handeye_link::Truth;
use handeye_wording::text;

/// Progress is reported when it has advanced by this much: a window that is drawn for every step would slow the solve
/// down.
const PROGRESS_STEP: f64 = 0.05;

/// A set of captures to calibrate.
pub struct SolveJob {
    /// Its number.
    pub id: JobId,
    /// What was observed; excluded captures are among the views.
    pub observations: Observations,
    /// The captures of the views.
    pub captures: Vec<CaptureId>,
    /// What was observed in captures that never enter the fit.
    pub verification: Vec<(CaptureId, View)>,
    /// Which answer is requested.
    pub method: Method,
    /// The changed options.
    pub options: Options,
    /// The error \[m\] that is good enough.
    pub goal_m: f64,
    /// The arm, if the views know its joints.
    pub arm: Option<ArmOfViews>,
    /// How accurate the robot is, if that was stated.
    pub robot_accuracy: Option<RobotAccuracy>,
    /// For comparison with the answer, once it is available.
    pub truth: Option<Truth>,
}

/// Solves a job and reports how that went.
pub fn solve(job: &SolveJob, cancel: &CancelToken, outlet: &Outlet) {
    let id = job.id;
    let began_s = outlet.now_s();
    let stated = Cell::new(None::<Progress>);
    let progress = |now: Progress| {
        let tell = stated.get().is_none_or(|before| {
            before.stage != now.stage || (now.fraction() - before.fraction()).abs() >= PROGRESS_STEP
        });
        if tell {
            stated.set(Some(now));
            outlet.report(solve::Event::Progress { job: id, stage: now.stage, part: now.fraction() });
        }
    };
    let work = Work { cancel, progress: &progress };
    // A bug in a solver must not cost the user the captures.
    let solved = catch_unwind(AssertUnwindSafe(|| answer(job, work)));
    let outcome = match solved {
        Ok(Ok(solved)) => SolveOutcome::Solved(Arc::new(Solved { took_s: outlet.now_s() - began_s, ..solved })),
        Ok(Err(CalibrateError::HandEye(HandEyeError::Cancelled))) => SolveOutcome::Cancelled,
        Ok(Err(error)) => SolveOutcome::Failed(error.into()),
        Err(_panic) => SolveOutcome::Failed(text!(
            "The solver crashed on these captures. They are safe. Please report it with the session folder"
        )),
    };
    outlet.report(solve::Event::Ended { job: id, outcome });
}

/// The calibration of a job with all that is reported about it: one path for the window and the command line.
///
/// # Errors
/// [`CalibrateError`].
pub fn answer(job: &SolveJob, work: Work<'_>) -> Result<Solved, CalibrateError> {
    let fit = estimate::fit_with(&job.observations, job.method, job.options, work)?;
    examined(job, fit, work)
}

/// All that is reported about the calibration of a job.
///
/// # Errors
/// When the work was cancelled.
pub fn examined(job: &SolveJob, fit: Fit, work: Work<'_>) -> Result<Solved, CalibrateError> {
    let goal = FindingOptions::with_goal_mm(Some(job.goal_m * 1e3)).with_arm(job.arm.as_ref());
    let goal = goal.with_robot_accuracy(job.robot_accuracy);
    let calibration = examine(&job.observations, fit, &goal, work.cancel)?;
    let mut findings = calibration.diagnosis().findings.clone();
    let options = solve_options(job.method, job.options, &job.observations.target);
    let mut result = CalibrationResult::of(&calibration, env!("CARGO_PKG_VERSION"), None, options);
    if let Some(of_views) = &job.arm
        && !result.state_arm(&calibration, of_views)
    {
        tracing::warn!(
            "the reported poses are {:.3} mm RMS from those of the arm by its joint angles: the controller counts with another \
             chain, such as its factory calibration, and no commands are corrected",
            of_views.placement.rms_m() * 1e3
        );
    }
    if let Some(truth) = &job.truth {
        result.truth = truth::comparison(&result, &truth.tip_from_camera, &truth.intrinsics);
    }
    let depth = depth_camera(job, &calibration);
    findings.extend(depth.as_ref().and_then(|depth| depth_finding(depth, calibration.error_by_poses_95_m())));
    sort(&mut findings);
    result.depth = depth.as_ref().map(DepthSummary::from);
    result.findings = findings.iter().map(Finding::to_record).collect();
    let calibrated = Predictor::new(&calibration).ok();
    let captures: Vec<&View> = job.verification.iter().map(|(_, view)| view).collect();
    let verified = |calibrated: &Predictor| {
        (!captures.is_empty()).then(|| verify::verify(calibrated, &job.observations.target, &captures, work))
    };
    let verification = calibrated.as_ref().and_then(verified);
    let counts = |arm: &&ArmEstimate| !arm.contradicted && result.quality.reach_error_corrected_95_mm.is_some();
    let corrected_arm = result.arm.as_ref().filter(counts).and_then(|arm| arm.corrected_arm().ok());
    let corrected = corrected_arm.zip(Predictor::of_arm(&calibration)).map(|(arm, calibrated)| {
        let verification = verified(&calibrated).and_then(Result::ok);
        Arc::new(Corrected { arm: Arc::new(arm), calibrated, verification })
    });
    if work.is_cancelled() {
        return Err(CalibrateError::HandEye(HandEyeError::Cancelled));
    }
    result.verification = verification.as_ref().and_then(|outcome| outcome.as_ref().ok()).map(|as_it_is| {
        let corrected = corrected.as_ref().and_then(|corrected| corrected.verification.as_ref());
        VerificationSummary { corrected: corrected.map(summary).map(Box::new), ..summary(as_it_is) }
    });
    Ok(Solved {
        corrected,
        job: job.id,
        captures: job.captures.clone(),
        result,
        findings,
        calibrated,
        verification,
        depth,
        verified_captures: job.verification.iter().map(|(id, _)| *id).collect(),
        calibration,
        took_s: 0.0,
    })
}

/// What the depths of the captures in the fit show about a depth camera.
fn depth_camera(job: &SolveJob, calibration: &Fit) -> Option<DepthReport> {
    let lens = calibration.intrinsics()?;
    let shape =
        calibration.joint.as_ref().and_then(|joint| joint.shape).map_or_else(BoardShape::default, |it| it.shape);
    let mut check = DepthCheck::new(&lens, &job.observations.target, &shape);
    for (view, observed) in calibration.views.iter().zip(&job.observations.views) {
        let used = view.camera_from_target.filter(|_| view.status == ViewStatus::Used);
        if let Some((board, depth)) = used.zip(observed.depth) {
            // The pose is that of the target as the other views count it.
            let depth = depth.renumbered(&job.observations.target, view.quarter_turns);
            check.add(&depth, board.isometry());
        }
    }
    let sigma_px = calibration.camera.and_then(|camera| camera.sigma_px);
    let in_fit = calibration.joint.as_ref().and_then(|joint| joint.depths.as_ref());
    check.finish(sigma_px.map_or(0.0, |sigma| sigma[0]), in_fit.map(|depths| &depths.in_fit))
}

fn summary(verification: &Verification) -> VerificationSummary {
    VerificationSummary {
        captures: verification.captures.len(),
        rms_px: verification.rms_px,
        centre_rms_mm: verification.centre_rms_m * 1e3,
        orientation_rms_deg: verification.orientation_rms_rad.to_degrees(),
        as_stated: verification.is_as_stated(),
        corrected: None,
    }
}

#[cfg(test)]
mod tests {
    use handeye_estimate::diagnose::findings::FindingCode;
    use handeye_geometry::depth::DepthImage;
    use handeye_geometry::targets::depth_plane::DepthPlane;

    use super::*;
    use crate::testing::sample;

    /// A depth camera that puts everything 2 mm and a part in a hundred too far away.
    #[test]
    fn what_the_depths_of_the_captures_are_off_is_in_the_result_and_said() {
        let model = sample::solved();
        let solved = model.solve.solved.as_ref().expect("solved");
        let lens = solved.calibration.intrinsics().expect("a lens");
        let mut observations = sample::observations();
        for (view, observed) in solved.calibration.views.iter().zip(&mut observations.views) {
            let board = view.camera_from_target.expect("fitted");
            let normal = board.isometry().rotation * nalgebra::Vector3::z();
            let metres = (0..640 * 480).map(|i| {
                let px = nalgebra::Vector2::new(f64::from(i % 640), f64::from(i / 640));
                let ray = lens.unproject(&px).map_or(f64::NAN, |ray| normal.dot(&ray) / ray.z);
                (normal.dot(&board.translation()) / ray * 1.01 + 0.002) as f32
            });
            let depth = DepthImage::new(640, 480, metres.collect()).expect("as many as pixels");
            let corners = observed.corners.as_ref().expect("seen");
            observed.depth = DepthPlane::new(&depth, (640, 480), corners, &observations.target);
        }
        let job = SolveJob {
            id: JobId(1),
            observations,
            captures: solved.captures.clone(),
            verification: Vec::new(),
            method: Method::Joint,
            options: Options::default(),
            goal_m: 5e-4,
            arm: None,
            robot_accuracy: None,
            truth: None,
        };
        let cancel = CancelToken::default();
        let solved = examined(&job, (*solved.calibration).clone(), (&cancel).into()).expect("not cancelled");
        let errors = solved.result.depth.and_then(|depth| depth.errors).expect("depths");
        let expected_mm = 2.0 + 0.01 * errors.at_mm;
        assert!((errors.offset_mm - expected_mm).abs() < 0.1, "{errors:?}");
        assert!((errors.scale.expect("captures") - 0.01).abs() < 1e-3, "{errors:?}");
        let reported =
            solved.findings.iter().find(|finding| finding.code == FindingCode::DepthError).expect("a finding");
        assert!(reported.to_string().contains("growing by +1.00"), "{reported}");
        let json = solved.result.to_json().expect("a result");
        assert_eq!(CalibrationResult::from_json(&json).expect("readable").depth, solved.result.depth);
        cancel.cancel();
        let fit = (*solved.calibration).clone();
        assert!(examined(&job, fit, (&cancel).into()).is_err(), "it can be cancelled");
    }

    /// A depth camera next to the lens: what it measured at the board is shown next to what the calibration predicts.
    #[test]
    fn the_depth_of_a_capture_for_verification_is_compared_with_that_of_the_board() {
        let depth = DepthImage::new(640, 480, vec![0.4; 640 * 480]).expect("as many as pixels");
        let model = sample::solved();
        let solved = model.solve.solved.as_ref().expect("solved");
        let id = solved.verified_captures[0];
        let record = model.document().capture(id).expect("a capture");
        let corners = model.observed(id).and_then(|seen| seen.corners.clone()).expect("seen");
        let observations = sample::observations();
        let plane = DepthPlane::new(&depth, (640, 480), &corners, &observations.target);
        let view = View::new(record.image.clone(), record.base_from_tip.expect("a pose"), corners);
        let job = SolveJob {
            id: JobId(1),
            observations,
            captures: solved.captures.clone(),
            verification: vec![(id, View { depth: plane, ..view.clone() })],
            method: Method::Joint,
            options: Options::default(),
            goal_m: 5e-4,
            arm: None,
            robot_accuracy: None,
            truth: None,
        };
        let off_m = |job: &SolveJob| {
            let solved = answer(job, (&CancelToken::default()).into()).expect("an answer");
            solved.verification.expect("verified").expect("it is one").captures[0].depth_error_m
        };
        let seen_m = solved.verification.as_ref().and_then(|it| it.as_ref().ok()).expect("verified").captures[0]
            .predicted_camera_from_target
            .translation()
            .z;
        let measured = off_m(&job).expect("a depth camera is there");
        assert!((measured - (0.4 - seen_m)).abs() < 0.1, "{measured} m, the board is at {seen_m} m");
        assert_eq!(off_m(&SolveJob { verification: vec![(id, view)], ..job }), None);
    }
}
