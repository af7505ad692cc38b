//! Findings on a calibration: single views that stand out, the noise, the other methods, the goal.

use nalgebra::{Point3, Vector3};

use super::{Finding, FindingCode, FindingOptions, Severity};
use crate::diagnose::{Calibration, Promise, Promised};
use crate::stated_uncertainty::StatedUncertainty;
use crate::{JointFit, ViewResult, ViewStatus, resolution};
use handeye_geometry::statistics::{SIGMA_PER_MEDIAN_SIZE, median};
use handeye_wording::text;
use handeye_wording::{Text, shown};

/// Views below which none can stand out from the others.
const MIN_FOR_OUTLIERS: usize = 5;
/// Number of robust standard deviations ([`SIGMA_PER_MEDIAN_SIZE`] times the median absolute deviation) a view may lie above the
/// median. Five are reached by chance in one of 3 million views of Gaussian noise; real noise has longer tails.
const ROBUST_SIGMAS: f64 = 5.0;
/// And at least this many times the median, because the deviation of a handful of views is itself uncertain.
const TIMES_MEDIAN: f64 = 3.0;
/// Length of the six numbers of a correction over the noise levels: passed by chance by one view in 400 000.
const CORRECTION_SIGMAS: f64 = 6.0;
/// An influence above this part of the expected error counts: leaving the view out would change what is stated.
const INFLUENCE: f64 = 0.5;
/// Prediction error over what the noise levels explain; they are themselves known to a fifth or so.
const PREDICTION: f64 = 1.5;
/// Robot noise over corner noise, both in pixels, from which better images hardly help: a tenth part in the square.
const ROBOT_OVER_CORNERS: f64 = 3.0;
/// Difference of fx and fy, part of either, that no camera has: pixels are drawn as true squares to a hundredth of a percent, a
/// lens without cylinders is round, and a sensor would have to lean by 8° against the axis to look 1 % shorter. The errors to be
/// detected are larger: 640×480 made of 1280×1024 is 7 % off, of 1920×1080 33 %, a print that was fitted to its page some percent.
const LEAST_ASPECT: f64 = 0.01;
/// Number of standard deviations by which the difference has to exceed that: one camera in seven hundred by chance, if it were just
/// as much off.
const ASPECT_SIGMAS: f64 = 3.0;
/// Distance from the middle of the closed forms, metres, from which one of them is worth reporting.
const DISAGREE_M: f64 = 5e-3;
/// More of the same views than this many times those gathered are not advised.
const MOST_TIMES: usize = 4;

pub fn findings(calibration: &Calibration, options: &FindingOptions<'_>) -> Vec<Finding> {
    let used: Vec<&ViewResult> = calibration.views.iter().filter(|v| v.status == ViewStatus::Used).collect();
    let mut found = Vec::new();
    found.extend(influence(calibration, &used));
    found.extend(residuals(&used));
    found.extend(corrections(calibration, &used));
    found.extend(prediction(calibration));
    found.extend(pixel_aspect(calibration));
    found.extend(lens_folds(calibration));
    found.extend(robot_field(calibration));
    found.extend(print_errors(calibration));
    found.extend(residual_distortion(calibration));
    found.extend(robot_noise(calibration));
    found.extend(closed_forms(calibration));
    found.extend(options.goal_mm.and_then(|goal_mm| goal(calibration, goal_mm)));
    found
}

/// The view that stands out most by a value, the value and the median of all; `None` when none does.
fn stands_out<'a>(
    views: &[&'a ViewResult],
    value: impl Fn(&ViewResult) -> Option<f64>,
) -> Option<(&'a ViewResult, f64, f64)> {
    let valued: Vec<(&ViewResult, f64)> = views.iter().filter_map(|v| Some((*v, value(v)?))).collect();
    if valued.len() < MIN_FOR_OUTLIERS {
        return None;
    }
    let middle = median(valued.iter().map(|(_, x)| *x))?;
    let deviation = SIGMA_PER_MEDIAN_SIZE * median(valued.iter().map(|(_, x)| (x - middle).abs()))?;
    let (view, largest) = valued.into_iter().max_by(|a, b| a.1.total_cmp(&b.1))?;
    let limit = (middle + ROBUST_SIGMAS * deviation).max(TIMES_MEDIAN * middle);
    (largest > limit).then_some((view, largest, middle))
}

fn influence(calibration: &Calibration, used: &[&ViewResult]) -> Option<Finding> {
    let error_m = calibration.error_by_poses_95_m()?;
    let (view, largest_m, median_m) = stands_out(used, |v| v.influence_m)?;
    if largest_m < (INFLUENCE * error_m).max(resolution::PLACE_M) {
        return None;
    }
    let text = text!(
        "View {view} alone moves the answer by {influence} mm; the median view moves it by {median} mm. Check its image \
         and its robot pose, or add views like it so that it does not stand alone.",
        view = &view.name,
        influence = shown(largest_m * 1e3, 2),
        median = shown(median_m * 1e3, 2)
    );
    // A view in an isolated place is influential by geometry; a wrong one is recognised by what it contradicts.
    let finding = Finding::new(FindingCode::InfluentialView, Severity::Advice, text).of_view(&view.name);
    let finding = finding.with("influence", largest_m * 1e3, "mm").with("median_influence", median_m * 1e3, "mm");
    Some(finding.with("expected_error_95", error_m * 1e3, "mm"))
}

fn residuals(used: &[&ViewResult]) -> Option<Finding> {
    let (view, largest, middle) = stands_out(used, |v| v.rms_px)?;
    if largest < resolution::FINE_PX {
        return None;
    }
    let text = text!(
        "The corners of view {view} fit with {rms} px, those of the median view with {median} px. Look at its image for \
         blur, reflections and wrong corners; leave it out if there are any.",
        view = &view.name,
        rms = shown(largest, 2),
        median = shown(middle, 2)
    );
    let finding = Finding::new(FindingCode::LargeResidual, Severity::Warning, text).of_view(&view.name);
    Some(finding.with("rms", largest, "px").with("median_rms", middle, "px"))
}

fn corrections(calibration: &Calibration, used: &[&ViewResult]) -> Option<Finding> {
    let by_distance = stands_out(used, |v| v.correction_m);
    let by_angle = stands_out(used, |v| v.correction_rad);
    // One view is named: that which is out by more of its median.
    let (view, ..) =
        [by_distance, by_angle].into_iter().flatten().max_by(|a, b| (a.1 / a.2).total_cmp(&(b.1 / b.2)))?;
    // Views determine their corrections unequally well, so the median alone is not a measure: the noise level must be
    // left too. One view that makes up all of the noise has at most the root of six times the views.
    let noise = resolution::judged_by(&calibration.joint.as_ref()?.noise);
    let over_noise = (view.correction_m? / noise.robot_m).hypot(view.correction_rad? / noise.robot_rad);
    if over_noise < CORRECTION_SIGMAS.min(0.75 * (6.0 * used.len() as f64).sqrt()) {
        return None;
    }
    let middle = |value: fn(&ViewResult) -> Option<f64>| median(used.iter().filter_map(|v| value(v)));
    let (mm, deg) = (view.correction_m? * 1e3, view.correction_rad?.to_degrees());
    let (median_mm, median_deg) = (middle(|v| v.correction_m)? * 1e3, middle(|v| v.correction_rad)?.to_degrees());
    let text = text!(
        "The robot pose of view {view} had to be corrected by {mm} mm and {deg}°, the median by {median_mm} mm and \
         {median_deg}°. The arm may have moved when the image was taken, or the board has; leave the view out or capture \
         it again.",
        view = &view.name,
        mm = shown(mm, 2),
        deg = shown(deg, 3),
        median_mm = shown(median_mm, 2),
        median_deg = shown(median_deg, 3)
    );
    let finding = Finding::new(FindingCode::LargeCorrection, Severity::Warning, text).of_view(&view.name);
    let finding = finding.with("correction", mm, "mm").with("correction_angle", deg, "°");
    Some(finding.with("median_correction", median_mm, "mm").with("median_correction_angle", median_deg, "°"))
}

fn prediction(calibration: &Calibration) -> Option<Finding> {
    let joint = calibration.joint.as_ref()?;
    let (heldout, expected) = (joint.heldout_rms_px?, joint.expected_heldout_rms_px);
    if heldout <= (PREDICTION * expected).max(resolution::FINE_PX) {
        return None;
    }
    let text = text!(
        "Views left out of the fit are predicted to {heldout} px, where robot and corner noise explain {expected} px. The \
         model misses something: a wrong view, a board that is bent or not of the stated size, too few views for so many \
         unknowns, or robot errors that depend on the pose. Capture more views and check those that stand out.",
        heldout = shown(heldout, 2),
        expected = shown(expected, 2)
    );
    let finding = Finding::new(FindingCode::PoorPrediction, Severity::Warning, text);
    Some(finding.with("heldout_rms", heldout, "px").with("explained_rms", expected, "px"))
}

fn pixel_aspect(calibration: &Calibration) -> Option<Finding> {
    let intrinsics = calibration.intrinsics()?;
    let sigma = calibration.aspect_sigma()?;
    let aspect = (intrinsics.fx / intrinsics.fy).ln();
    if aspect.abs() - ASPECT_SIGMAS * sigma < LEAST_ASPECT {
        return None;
    }
    let text = text!(
        "fx and fy differ by {percent} % ± {sigma} % ({fx} px and {fy} px), where those of a camera agree to a tenth of a \
         percent. The images were scaled in one direction, or the squares of the target are not square. Give images of the \
         camera's own proportions, and measure the target along both sides, over as many squares as it has.",
        percent = format!("{:.2}", 100.0 * aspect.abs()),
        sigma = format!("{:.2}", 100.0 * sigma),
        fx = format!("{:.1}", intrinsics.fx),
        fy = format!("{:.1}", intrinsics.fy)
    );
    let finding = Finding::new(FindingCode::PixelAspect, Severity::Warning, text);
    Some(finding.with("fx_over_fy", intrinsics.fx / intrinsics.fy, "").with("fx_over_fy_sigma", sigma, ""))
}

fn lens_folds(calibration: &Calibration) -> Option<Finding> {
    let fold = calibration.intrinsics()?.check_fold().err()?;
    let text = text!(
        "The lens model folds back {radius} px from the principal point, and the image reaches {reach} px: farther out than \
         {radius} px it is no lens, and pixels there have no ray. Capture the target out to the edges of the image, or \
         estimate a lens model of fewer coefficients.",
        radius = format!("{:.0}", fold.radius_px),
        reach = format!("{:.0}", fold.reach_px)
    );
    let finding = Finding::new(FindingCode::LensFolds, Severity::Advice, text);
    Some(finding.with("fold_radius", fold.radius_px, "px").with("image_reach", fold.reach_px, "px"))
}

fn robot_field(calibration: &Calibration) -> Option<Finding> {
    let joint = calibration.joint.as_ref()?;
    joint.field.as_ref()?;
    if !resolution::is_resolved(joint.noise.field_m, joint.noise.field_rad) {
        return None;
    }
    let (mm, deg) = (joint.noise.field_m * 1e3, joint.noise.field_rad.to_degrees());
    let by_arm = calibration.arm().and_then(|arm| arm.heldout_px);
    if let Some([without, with]) = by_arm.filter(|[without, with]| with < without) {
        let text = text!(
            "The robot's errors depend on where it stands: {mm} mm and {deg}° per axis at a typical distance from the middle of \
             the session. The errors of its arm explain them: poses that are corrected by them bring views left out of the fit \
             from {without} px to {with} px. Correct its commands by them, for which `handeye correct` makes the table.",
            mm = shown(mm, 2),
            deg = shown(deg, 3),
            without = shown(without, 2),
            with = shown(with, 2)
        );
        return Some(field_finding(text, (mm, deg), (without, with)));
    }
    let (without, with) = (joint.heldout_links_rms_px?, joint.heldout_rms_px?);
    let text = text!(
        "The robot's errors depend on where it stands: {mm} mm and {deg}° per axis at a typical distance from the middle of \
         the session. The answer and its expected error count on them. The result has them as an optional correction of \
         reported poses, which brings views left out of the fit from {without} px to {with} px; a kinematic calibration of \
         the arm removes their cause.",
        mm = shown(mm, 2),
        deg = shown(deg, 3),
        without = shown(without, 2),
        with = shown(with, 2)
    );
    let text = match joint.open_size() {
        Some(size) => Text::sentences([
            text,
            text!(
                "Another size of the target would look the same: by the robot's motion it is {size} ± {sigma} times the stated one, so \
                 that a wrong size would not be noticed, and the expected error counts on it. Measure the target over as many squares \
                 as it has, and take views from more different distances.",
                size = shown(size.scale, 3),
                sigma = shown(size.sigma, 3)
            ),
        ]),
        None => text,
    };
    Some(field_finding(text, (mm, deg), (without, with)))
}

fn field_finding(text: Text, (mm, deg): (f64, f64), (without_px, with_px): (f64, f64)) -> Finding {
    let finding = Finding::new(FindingCode::RobotField, Severity::Advice, text);
    let finding = finding.with("field_sigma", mm, "mm").with("field_sigma_angle", deg, "°");
    finding.with("heldout_rms", without_px, "px").with("heldout_rms_corrected", with_px, "px")
}

fn print_errors(calibration: &Calibration) -> Option<Finding> {
    let found = calibration.joint.as_ref()?.print.as_ref()?;
    if found.rms_m() < resolution::PLACE_M {
        return None;
    }
    let (mm, most) = (found.rms_m() * 1e3, found.largest_m() * 1e3);
    let text = text!(
        "The target is not printed quite as drawn: its points are off by {mm} mm RMS per axis, {most} mm at the most, by the same \
         in all views. The answer and its expected error count on it, and the result has the places of the points. Views with \
         the board turned and tilted otherwise tell them apart from the lens; a better print is better still.",
        mm = shown(mm, 3),
        most = shown(most, 3)
    );
    let finding = Finding::new(FindingCode::PrintErrors, Severity::Advice, text);
    let finding = finding.with("print_rms", mm, "mm").with("print_largest", most, "mm");
    Some(finding.with("log_likelihood_gain", 0.5 * found.gain, ""))
}

fn residual_distortion(calibration: &Calibration) -> Option<Finding> {
    let found = calibration.joint.as_ref()?.residual_distortion.as_ref()?;
    if found.rms_px < resolution::CORNER_PX {
        return None;
    }
    let text = text!(
        "The lens does more than its model: corners are displaced by {px} px RMS, smoothly with their place in the image. The \
         answer and its expected error count on it, and the result has it as an optional correction of image points. A lens \
         model with more coefficients may follow the lens further; views that cover the whole image show how it goes on.",
        px = shown(found.rms_px, 3)
    );
    let finding = Finding::new(FindingCode::ResidualDistortion, Severity::Advice, text);
    Some(finding.with("displacement_rms", found.rms_px, "px").with("log_likelihood_gain", 0.5 * found.gain, ""))
}

fn robot_noise(calibration: &Calibration) -> Option<Finding> {
    let JointFit { noise, robot_effect_px: robot_px, .. } = *calibration.joint.as_ref()?;
    // Both as 2-D distances.
    let corner_px = noise.corner_px * std::f64::consts::SQRT_2;
    if robot_px < ROBOT_OVER_CORNERS * corner_px || !resolution::is_resolved(noise.robot_m, noise.robot_rad) {
        return None;
    }
    let (mm, deg) = (noise.robot_m * 1e3, noise.robot_rad.to_degrees());
    let text = text!(
        "The robot limits the answer: its noise of {position} and {orientation} per axis moves corners by {robot} px, their \
         own noise is {corner} px. Better images will not help much; settling longer before each will.",
        position = resolution::place_text(noise.robot_m),
        orientation = resolution::angle_text(noise.robot_rad),
        robot = shown(robot_px, 2),
        corner = shown(corner_px, 2)
    );
    let finding = Finding::new(FindingCode::RobotNoise, Severity::Info, text);
    let finding = finding.with("robot_effect", robot_px, "px").with("corner_noise", corner_px, "px");
    Some(finding.with("robot_sigma", mm, "mm").with("robot_sigma_angle", deg, "°"))
}

/// Compared where the board was seen; without a joint estimate at the camera itself.
fn closed_forms(calibration: &Calibration) -> Option<Finding> {
    let point = calibration.joint.as_ref().map_or_else(Point3::origin, |joint| joint.reference_point);
    let places: Vec<(&'static str, Vector3<f64>)> = calibration
        .methods
        .iter()
        .filter_map(|m| Some((m.name, (m.outcome.as_ref().ok()?.mount_from_camera.isometry() * point).coords)))
        .collect();
    if places.len() < 3 {
        return None;
    }
    let component = |i: usize| median(places.iter().map(|(_, p)| p[i]));
    let middle = Vector3::new(component(0)?, component(1)?, component(2)?);
    let distances: Vec<(&'static str, f64)> = places.iter().map(|(name, p)| (*name, (p - middle).norm())).collect();
    let typical_m = median(distances.iter().map(|(_, d)| *d))?;
    let mut off: Vec<(&'static str, f64)> = distances.into_iter().filter(|(_, d)| *d > DISAGREE_M).collect();
    if off.is_empty() {
        return None;
    }
    off.sort_by(|a, b| b.1.total_cmp(&a.1));
    let each =
        off.iter().map(|(name, d)| text!("{method} by {distance} mm", method = name, distance = shown(d * 1e3, 1)));
    let (severity, advice) = if typical_m > DISAGREE_M {
        (
            Severity::Warning,
            text!("Most of them do, so the views determine the answer weakly: add views with more tilt and turn."),
        )
    } else {
        (Severity::Info, text!("The others agree; these are sensitive to noise and are for comparison only."))
    };
    let list = Text::list(each);
    let text = text!("Closed forms differ from the median of all: {list}. {advice}", list = list, advice = advice);
    let finding = Finding::new(FindingCode::ClosedFormsDisagree, severity, text);
    let finding = finding.with("median_distance", typical_m * 1e3, "mm");
    Some(off.iter().fold(finding, |f, (name, d)| f.with(name, d * 1e3, "mm")))
}

fn goal(calibration: &Calibration, goal_mm: f64) -> Option<Finding> {
    let promised = calibration.promised(goal_mm * 1e-3, None)?;
    let (error_mm, goal) = (promised.error_m * 1e3, shown(goal_mm, 3));
    let is_reached = error_mm <= goal_mm;
    let error = shown(error_mm, 3);
    let (advice, advised) = match promised.of {
        _ if is_reached => (None, None),
        Promise::Point => towards_goal(calibration, goal_mm).map(|(advice, advised)| (Some(advice), advised))?,
        Promise::Reach | Promise::ReachByAccuracy | Promise::ReachCorrected => {
            (Some(towards_reach(calibration, &promised, goal_mm)), None)
        }
    };
    let text = match (promised.of, advice) {
        (Promise::Point, None) => text!(
            "Good enough: the expected error of {error} mm (95 %) is below the goal of {goal} mm. Verify with captures that \
             were not in the fit.",
            error = error,
            goal = goal
        ),
        (Promise::Reach | Promise::ReachByAccuracy, None) => text!(
            "Good enough: a tool arrives within {error} mm (95 %), below the goal of {goal} mm. Verify with captures that were not in \
             the fit.",
            error = error,
            goal = goal
        ),
        (Promise::ReachCorrected, None) => text!(
            "Good enough with corrected commands: with them a tool arrives within {error} mm (95 %), below the goal of {goal} mm. Correct \
             the commands by the errors of the arm, for which `handeye correct` makes the table.",
            error = error,
            goal = goal
        ),
        (Promise::Point, Some(advice)) => text!(
            "The expected error of {error} mm (95 %) is above the goal of {goal} mm. {advice}",
            error = error,
            goal = goal,
            advice = advice
        ),
        (Promise::Reach | Promise::ReachByAccuracy, Some(advice)) => text!(
            "A tool arrives within {error} mm (95 %), and the goal is {goal} mm. {advice}",
            error = error,
            goal = goal,
            advice = advice
        ),
        (Promise::ReachCorrected, Some(advice)) => text!(
            "Even with corrected commands a tool arrives within {error} mm (95 %), and the goal is {goal} mm. {advice}",
            error = error,
            goal = goal,
            advice = advice
        ),
    };
    let (code, severity) = if is_reached {
        (FindingCode::GoalReached, Severity::Info)
    } else {
        (FindingCode::GoalNotReached, Severity::Advice)
    };
    let finding =
        Finding::new(code, severity, text).with("expected_error_95", calibration.tip_error_95_m()? * 1e3, "mm");
    let finding = finding.with("goal", goal_mm, "mm");
    let numbers = calibration.reach_errors().into_iter().flat_map(|reach| {
        let corrected = reach.corrected_95_m.map(|metres| ("reach_error_corrected_95", metres));
        let repeatability = reach.repeatability_95_m.map(|metres| ("repeatability_95", metres));
        [Some(("reach_error_95", reach.as_it_is_95_m)), corrected, repeatability]
    });
    let finding = numbers.flatten().fold(finding, |finding, (name, metres)| finding.with(name, metres * 1e3, "mm"));
    Some(advised.into_iter().fold(finding, |finding, (name, value, unit)| finding.with(name, value, unit)))
}

/// What lowers the error of a tool.
fn towards_reach(calibration: &Calibration, promised: &Promised, goal_mm: f64) -> Text {
    let least_mm = promised.least_m * 1e3;
    if calibration.stated != StatedUncertainty::AsModelled {
        return text!("More views do not help until what was found is corrected.");
    }
    match promised.of {
        Promise::Reach if least_mm > goal_mm => text!(
            "{least} mm of it is what the arm is off and does not repeat, and more views do not lower that: have the arm calibrated.",
            least = shown(least_mm, 3)
        ),
        Promise::ReachByAccuracy if least_mm > goal_mm => text!(
            "{least} mm of it follow from the stated accuracy of the robot, and more views do not lower that: record the joint values \
             and name the arm, and its errors are estimated.",
            least = shown(least_mm, 3)
        ),
        Promise::ReachCorrected if least_mm > goal_mm => text!(
            "{repeatability} mm of it is what the arm does not repeat, and more views do not lower that: let it settle longer, \
             or use an arm that repeats better.",
            repeatability = shown(least_mm, 3)
        ),
        _ => {
            text!("Views with more different postures of the arm, and with the board tilted and turned more, lower it.")
        }
    }
}

/// Evidence for an advice.
type Advised = Option<(&'static str, f64, &'static str)>;

/// What lowers the error of a measured point.
fn towards_goal(calibration: &Calibration, goal_mm: f64) -> Option<(Text, Advised)> {
    if let Some(moved_m) = calibration.moved_by_arm_m() {
        let advice = text!(
            "Most of it, {moved} mm, are errors of the arm, and more views do not lower it: correct the commands by them, for which \
             `handeye correct` makes the table, or have the arm calibrated.",
            moved = shown(moved_m * 1e3, 3)
        );
        return Some((advice, Some(("moved_by_arm", moved_m * 1e3, "mm"))));
    }
    if calibration.stated != StatedUncertainty::AsModelled {
        return Some((text!("More views do not help until what was found is corrected."), None));
    }
    let curve = &calibration.joint.as_ref()?.error_curve;
    let (views, _) = curve.now()?;
    let Some(needed) = curve.views_for(goal_mm * 1e-3).filter(|n| *n <= MOST_TIMES * views) else {
        let advice = text!(
            "More views like these would take too many: tilt and turn the camera more, come closer, or reduce the noise."
        );
        return Some((advice, None));
    };
    // The curve's error equals the stated one except for rounding, so at least one more is needed.
    let more = needed.saturating_sub(views).max(1);
    let advice = text!("About {more} more {more|view|views} like those gathered will reach it.", more = more);
    Some((advice, Some(("more_views", more as f64, ""))))
}
