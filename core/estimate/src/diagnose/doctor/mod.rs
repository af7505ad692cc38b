//! What is wrong with a session: hypotheses about the data, each with how much better it explains them.
//!
//! # What it tests
//! Gross faults of how poses were written down and paired, with [`hypotheses`](super::hypotheses): inverted poses or the wrong
//! mode (the same equations), millimetres against metres, the order of quaternions, images and poses out of step. Then, in a
//! linear Gaussian model of pose pairs ([`model`]): a target that is not of its stated size or is bent, intrinsics that do not
//! fit, a target or a camera that moved during the session, the zero of a joint, views that contradict the others.
//!
//! # How it decides
//! A gross fault is accused when it brings the board together at least three times better, and to within a twentieth
//! of its distance. The others are fitted with noise levels of their own and judged by the F test with allowance for the
//! number of alternatives, by a size that matters, and, where they change the model, by views held out. The errors of an arm whose
//! joints are known ([`ArmFit`](crate::ArmFit)), else the pose-dependent errors of the robot
//! ([`PoseDependentError`](crate::handeye::joint::PoseDependentError)), are part of every fit. What is accepted becomes a finding.
//! Nothing is ever applied.
//!
//! # Needs
//! Four views for gross faults and five for the others, with robot turns about two axes; where that is missing
//! [`Diagnosis::untested`] says so, and the findings state what is missing. Views out of the fit count for nothing. Of
//! more than [`MOST_VIEWS`] views only that many are examined, spread over the session.

mod effect;
mod gross;
mod judge;
mod model;
mod pairing;
mod screen;
mod select;
mod stated_uncertainty;
pub mod views;
mod weight;
mod words;

use crate::diagnose::Calibration;
use crate::diagnose::findings::{self, Finding, FindingCode, FindingOptions, Severity};
use crate::diagnose::hypotheses::NEED;
use crate::diagnose::promise;
use crate::reach_error::Reach;
use crate::stated_uncertainty::StatedUncertainty;
use crate::{Fit, Observations};
use handeye_geometry::progress::Work;
use handeye_geometry::targets::observation;

pub use crate::diagnose::diagnosis::{Diagnosis, Estimate, Hypothesis};
pub use crate::diagnose::report::Detail;

/// Largest number of views examined: the noise levels are then known to a few percent, and more would add nothing.
pub const MOST_VIEWS: usize = 400;
/// Largest noise of a robot, metres and radians per axis, that is taken for an arm's. Real sets of good arms show 0.2
/// to 0.5 mm and 0.04° to 0.12°; four times as much has another reason.
const PLAUSIBLE: (f64, f64) = (2e-3, 8.4e-3);
/// A misfit beyond this part of the board's distance is beyond the linear model.
const HOPELESS: f64 = 0.2;

/// What is wrong with observations without a fit, or whose fit does not matter: the hypotheses do not depend on it.
///
/// `work` is a `&CancelToken`, or a [`Work`]; when it is cancelled [`Diagnosis::untested`] says so.
pub fn diagnose<'a>(observations: &Observations, options: &FindingOptions<'_>, work: impl Into<Work<'a>>) -> Diagnosis {
    let mut diagnosis = Diagnosis::default();
    if let Err(why) = examine(observations, None, &mut diagnosis, &work.into()) {
        diagnosis.untested = Some(why);
    }
    diagnosis.with(findings::findings(observations, None, options))
}

/// What is wrong with observations and their fit, and which error may be stated for it. Only half of it when `work` is cancelled.
pub(super) fn examined(
    observations: &Observations,
    fit: Fit,
    options: &FindingOptions<'_>,
    work: &Work<'_>,
) -> Calibration {
    let repaired = as_found(observations, &fit);
    let observations = repaired.as_ref().unwrap_or(observations);
    let mut diagnosis = Diagnosis::default();
    let mut found = (&fit, StatedUncertainty::AsModelled);
    if let Err(why) = examine(observations, Some(&mut found), &mut diagnosis, work) {
        diagnosis.untested = Some(why);
    }
    let (_, stated) = found;
    let mut stated = stated_uncertainty::with_open_size(stated_uncertainty::with_own_lens(stated, &fit), &fit);
    if diagnosis.findings.iter().any(|finding| finding.severity == Severity::Problem) {
        stated = StatedUncertainty::Nothing;
    }
    let reach = options.arm.filter(|_| stated != StatedUncertainty::Nothing);
    let reach = reach.and_then(|arm| promise::reach(&fit, arm, &observations.target));
    let reach_at_target = reach.as_ref().and_then(Reach::at_target);
    let mut calibration =
        Calibration { fit, stated, reach, reach_by_accuracy: None, reach_at_target, diagnosis: Diagnosis::default() };
    if let Some((by_accuracy, at_target)) = promise::reach_by_accuracy(&calibration, options, &observations.target) {
        calibration.reach_by_accuracy = Some(by_accuracy);
        calibration.reach_at_target = Some(at_target);
    }
    // After the claim: the goal is judged by it.
    let of_estimate = findings::findings(observations, Some(&calibration), options);
    Calibration { diagnosis: diagnosis.with(of_estimate), ..calibration }
}

impl Diagnosis {
    /// Adds what the estimate found. It comes before what was examined, so that what the estimate has already acted upon is
    /// reported as the estimate states it, and only once.
    fn with(mut self, of_estimate: Vec<Finding>) -> Self {
        self.findings.splice(0..0, of_estimate);
        let mut reported: Vec<FindingCode> = Vec::new();
        self.findings.retain(|finding| {
            let once =
                matches!(finding.code, FindingCode::OutlierView | FindingCode::BoardBent | FindingCode::OutlierCorners);
            let new = !(once && reported.contains(&finding.code));
            reported.push(finding.code);
            new
        });
        findings::sort(&mut self.findings);
        self
    }
}

/// The observations with the corners numbered as found by the calibration, and where they would be if the target were printed
/// as drawn; `None` when that changes nothing.
fn as_found(observations: &Observations, calibration: &Fit) -> Option<Observations> {
    let print = calibration.joint.as_ref().and_then(|joint| joint.print.as_ref()).zip(calibration.intrinsics());
    if print.is_none() && calibration.views.iter().all(|view| view.quarter_turns == 0) {
        return None;
    }
    let points = observations.target.points();
    let mut observations = observations.clone();
    for (view, result) in observations.views.iter_mut().zip(&calibration.views) {
        let Some(corners) = view.corners.as_mut() else { continue };
        if result.quarter_turns != 0 {
            observation::renumber(corners, &mut view.depth, &observations.target, result.quarter_turns);
        }
        let Some(((print, lens), pose)) = print.zip(result.camera_from_target) else { continue };
        for corner in corners {
            let drawn = points[corner.index];
            let printed = drawn + print.errors_m[corner.index].push(0.0);
            let [drawn, printed] = [drawn, printed].map(|point| lens.project(&(pose.isometry() * point)));
            if let (Ok(drawn), Ok(printed)) = (drawn, printed) {
                corner.px += drawn - printed;
            }
        }
    }
    Some(observations)
}

fn examine(
    observations: &Observations,
    fit: Option<&mut (&Fit, StatedUncertainty)>,
    diagnosis: &mut Diagnosis,
    work: &Work<'_>,
) -> Result<(), String> {
    let cancelled = || "cancelled".to_owned();
    let (calibration, stated) = fit.map(|(fit, stated)| (*fit, stated)).unzip();
    let lens = calibration.and_then(|calibration| calibration.lens_by_corners);
    let sight = views::SessionViews::new(observations, lens).map_err(|why| why.to_string())?;
    diagnosis.findings.extend(words::not_finite(&sight));
    diagnosis.findings.extend(words::wrong_corners(&sight));
    let views = sight.views.len();
    if views < NEED {
        return Err(format!("views with the target and a robot pose: {views}, {NEED} are needed"));
    }
    if let Some(behind) = words::behind_the_camera(&sight) {
        diagnosis.findings.push(behind);
        return Ok(());
    }
    let gross = gross::gross(&sight, work).ok_or_else(cancelled)?;
    diagnosis.hypotheses = words::gross(&sight, &gross);
    if gross.accused {
        diagnosis.findings.extend(words::gross_findings(&diagnosis.hypotheses));
        return Ok(());
    }
    let start = gross.as_given.map_err(|error| error.to_string())?;
    if start.median_m > HOPELESS * sight.target.distance_m {
        diagnosis.findings.push(words::hopeless(&sight, start.median_m));
        return Ok(());
    }
    if views < select::NEED {
        return Err(format!("views with the target and a robot pose: {views}, {} are needed", select::NEED));
    }
    let arm = calibration.and_then(Fit::arm);
    let selection = select::select(&sight, &start, arm, work).ok_or_else(|| {
        if work.is_cancelled() { cancelled() } else { "the views leave a direction of the answer open".to_owned() }
    })?;
    let size = calibration.and_then(|calibration| calibration.joint.as_ref()?.size.as_ref());
    let selection = match (arm, size) {
        (Some(arm), _) => selection.with_size_beside_arm(arm),
        (None, Some(size)) => selection.with_size(size),
        (None, None) => selection,
    };
    let mut fine = words::fine(&selection);
    if let Some(calibration) = calibration {
        for h in &mut fine {
            h.applied = stated_uncertainty::is_applied(calibration, h);
        }
    }
    // With a known arm, the noise is what its errors do not explain.
    let of_poses = calibration.and_then(|calibration| calibration.joint.as_ref()).map(|joint| joint.noise);
    let noise = arm.map(|arm| arm.noise).or(of_poses);
    if let Some((calibration, stated)) = calibration.zip(stated) {
        *stated = stated_uncertainty::stated_uncertainty(&selection, calibration);
    }
    diagnosis.findings.extend(fine.iter().filter(|h| h.accepted).map(words::finding_of));
    let others = fine.iter().any(|h| h.accepted && !h.applied);
    // Where nothing else was found that is the noise that the answer states: one report has one number for it.
    let (robot_m, robot_rad) = match noise.filter(|_| !others) {
        // Pose-dependent error is part of the robot's error as much as scatter is.
        Some(noise) => (noise.robot_m.hypot(noise.field_m), noise.robot_rad.hypot(noise.field_rad)),
        None => selection.fit.robot_sigma(),
    };
    if robot_m > PLAUSIBLE.0 || robot_rad > PLAUSIBLE.1 {
        diagnosis.findings.push(words::implausible(robot_m, robot_rad, others));
    }
    // What was not accepted is listed by its weight.
    let gross = std::mem::take(&mut diagnosis.hypotheses);
    diagnosis.hypotheses = fine;
    diagnosis.hypotheses.extend(gross);
    diagnosis.hypotheses.sort_by(|a, b| {
        b.accepted.cmp(&a.accepted).then(
            // Accepted ones stay in the order in which they were taken in.
            if a.accepted && b.accepted { std::cmp::Ordering::Equal } else { b.gain.total_cmp(&a.gain) },
        )
    });
    if selection.is_ended {
        return Err(format!(
            "so much is wrong that the examination was ended after {} findings: mend them and examine the session again for more",
            selection.taken.len()
        ));
    }
    Ok(())
}
