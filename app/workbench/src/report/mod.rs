//! What there is to report about a calibration, in one place, for a page of text and for Markdown.

mod markdown;
mod page;

use handeye_estimate::diagnose::findings::WIDENING_WORTH_SAYING;
use handeye_estimate::handeye::Mode;
use handeye_estimate::resolution::{angle_text, place_text};
use handeye_estimate::verify::Verification;
use handeye_result::{
    ArmLevels, CalibrationResult, EstimateDetails, HeldOutByArm, JointErrorEstimate, MethodStatus, TransformEstimate,
    ViewRecordStatus,
};

use nalgebra::Vector3;

pub use markdown::markdown;
pub use page::{of_session, page, shared_camera};

use crate::solve::state::Solved;
use handeye_wording::{English, decimals, shown};

/// What is reported about one thing. Numbers have their units.
#[derive(Debug, Clone, Default)]
pub(crate) struct Section {
    /// What it is; empty for the findings, which need no title.
    pub title: String,
    /// The short form.
    pub summary: Vec<String>,
    /// The long form.
    pub lines: Vec<Line>,
    /// Letters that the names of rows take on a page.
    pub name_width: usize,
}

/// A line of a section.
#[derive(Debug, Clone)]
pub enum Line {
    /// A sentence.
    Words(String),
    /// A row of a table.
    Row {
        /// What it is about.
        name: String,
        /// From left to right.
        values: Vec<String>,
    },
}

impl Line {
    fn row(name: impl Into<String>, values: impl IntoIterator<Item = String>) -> Self {
        Self::Row { name: name.into(), values: values.into_iter().collect() }
    }
}

/// All of it, the most important first.
pub(crate) fn sections(solved: &Solved) -> Vec<Section> {
    let result = &solved.result;
    let mut all = vec![headline(result), findings(result)];
    all.extend(
        [&result.hand_eye, &result.target].into_iter().flatten().map(|link| transform(link, sigma_name(result))),
    );
    all.extend(camera(result));
    all.push(fit(result));
    all.extend(arm(result));
    all.extend(truth(result));
    all.push(methods(result));
    all.push(views(result));
    all.extend(verification(solved));
    all.extend(depth_camera(result));
    all.retain(|section| !section.lines.is_empty() || !section.summary.is_empty() || !section.title.is_empty());
    all
}

fn headline(result: &CalibrationResult) -> Section {
    let title = match result.mode {
        Some(Mode::EyeInHand) => "Hand-eye calibration, camera on the tip",
        Some(Mode::EyeToHand) => "Hand-eye calibration, camera beside the robot",
        None => "Intrinsic calibration, no robot poses",
    };
    Section {
        title: title.to_owned(),
        lines: reach(result).into_iter().chain(expected_error(result)).map(Line::Words).collect(),
        ..Section::default()
    }
}

/// What a user of the calibration can expect; `None` for a camera without a robot.
fn expected_error(result: &CalibrationResult) -> Option<String> {
    let Some(error) = result.quality.tip_error_95_mm else {
        let why = match (result.problem(), &result.estimate) {
            (Some(problem), _) => format!("none can be stated, see the problem below [{}]", problem.code),
            (None, Some(_)) => "none can be stated, see below what was found".to_owned(),
            (None, None) => "not known for this method".to_owned(),
        };
        return result.mode.is_some().then(|| format!("expected error: {why}"));
    };
    let stated =
        format!("expected error of a measured point: below {error:.3} mm in 95 % of cases, where the target was seen");
    Some(match result.estimate.as_ref().and_then(|estimate| estimate.moved_mm) {
        Some(moved) => {
            let (moved, rest) = in_parts(error, moved);
            format!("{stated}: what is found below would move the answer by {moved} mm, which is known to {rest} mm")
        }
        None => stated,
    })
}

/// How near a tool gets, or why that is not known.
fn reach(result: &CalibrationResult) -> Option<String> {
    let Some(plain) = result.quality.reach_error_95_mm else {
        let is_unknown = result.arm.as_ref().is_none_or(|arm| arm.contradicted);
        let is_asked = result.mode.is_some() && result.quality.tip_error_95_mm.is_some() && is_unknown;
        let takes = "that takes the errors of the arm, by its kinematics and the joint values of every capture, or the accuracy of the \
                     robot (--robot-accuracy)";
        return is_asked.then(|| format!("how near a tool arrives is not known: {takes}"));
    };
    let tool_m = result.quality.robot_tool_m.or_else(|| Some(result.arm.as_ref()?.tool_m));
    let length = tool_m.map(|tool_m| format!(" of {:.0} mm", Vector3::from(tool_m).norm() * 1e3));
    let stated = format!(
        "a tool{} arrives within {plain:.3} mm of a point that the camera saw in 95 % of cases as the controller is",
        length.unwrap_or_default()
    );
    Some(match (result.quality.reach_error_corrected_95_mm, result.quality.robot_accuracy_mm) {
        (Some(corrected), _) => {
            format!("{stated}, within {corrected:.3} mm with corrected commands (`handeye correct`)")
        }
        (None, Some(accuracy)) => format!("{stated}, with the robot accurate to {accuracy} mm RMS as stated"),
        (None, None) => stated,
    })
}

/// By how much what was found moves the answer, and what remains of an error, in millimetres: they add up as they are
/// printed.
pub fn in_parts(error_mm: f64, moved_mm: f64) -> (String, String) {
    let micrometres = |mm: f64| (mm * 1e3).round();
    let rest = micrometres(error_mm) - micrometres(moved_mm);
    (format!("{moved_mm:.3}"), format!("{:.3}", rest / 1e3))
}

/// What the standard deviations are: if something was found that is not in the model they are not the error of the
/// answer.
fn sigma_name(result: &CalibrationResult) -> &'static str {
    let moved = result.estimate.as_ref().is_some_and(|estimate| estimate.moved_mm.is_some());
    if moved || result.problem().is_some() { "standard deviation by noise alone" } else { "standard deviation" }
}

fn findings(result: &CalibrationResult) -> Section {
    let reported = result.findings.iter().map(|found| format!("{} [{}]: {}", found.severity, found.code, found.text));
    Section { lines: reported.map(Line::Words).collect(), ..Section::default() }
}

fn transform(t: &TransformEstimate, sigma_name: &str) -> Section {
    let [x, y, z] = t.translation_m.map(|v| v * 1e3);
    let [qx, qy, qz, qw] = t.rotation_xyzw;
    let mut lines = vec![
        Line::row("t", [format!("[{x:.3} {y:.3} {z:.3}] mm")]),
        Line::row("q", [format!("[{qx:.6} {qy:.6} {qz:.6} {qw:.6}] xyzw")]),
    ];
    if let Some(c) = t.covariance {
        let sigma: Vec<f64> = (0..6).map(|i| c[i][i].max(0.0).sqrt()).collect();
        let [a, b, c] = [0, 1, 2].map(|i| sigma[i] * 1e3);
        let [d, e, f] = [3, 4, 5].map(|i| sigma[i].to_degrees());
        lines.push(Line::row(sigma_name, [format!("[{a:.3} {b:.3} {c:.3}] mm, [{d:.4} {e:.4} {f:.4}]°")]));
    }
    let title = format!("{}_from_{}", t.parent_frame, t.child_frame);
    Section { title, lines, name_width: 2, ..Section::default() }
}

fn camera(result: &CalibrationResult) -> Option<Section> {
    let i = result.intrinsics.as_ref()?;
    let how = if i.fixed { "given" } else { "estimated" };
    let with_sigma = |name: &str, value: f64, sigma: Option<f64>| match sigma {
        Some(sigma) => format!("{name} {value:.3} ± {sigma:.3}"),
        None => format!("{name} {value:.3}"),
    };
    let numbers =
        [("fx", i.fx, i.sigma.fx), ("fy", i.fy, i.sigma.fy), ("cx", i.cx, i.sigma.cx), ("cy", i.cy, i.sigma.cy)]
            .map(|(name, value, sigma)| with_sigma(name, value, sigma));
    let meaning = if i.sigma.fx.is_some() { " (± one standard deviation)" } else { "" };
    let mut lines = vec![Line::Words(format!("{} px{meaning}", numbers.join("  ")))];
    if !i.distortion.is_empty() {
        let k: Vec<String> = i.distortion.iter().map(|k| format!("{k:.6}")).collect();
        lines.push(Line::Words(format!("distortion [{}]", k.join(" "))));
    }
    let title = format!("camera {}×{}, {}, {how}", i.width, i.height, i.model);
    Some(Section { title, lines, ..Section::default() })
}

fn fit(result: &CalibrationResult) -> Section {
    let q = &result.quality;
    let robot = q.robot_sigma_mm.zip(q.robot_sigma_deg);
    let summary: Vec<String> = [
        q.rms_px.map(|rms| format!("residual {rms:.4} px RMS")),
        q.heldout_rms_px.map(|rms| format!("{rms:.4} px on views held out")),
        q.sigma_px.map(|sigma| format!("corner noise {sigma:.4} px per axis")),
        robot.map(|(mm, deg)| {
            let (place, angle) = (place_text(mm * 1e-3), angle_text(deg.to_radians()));
            format!("robot noise {} and {} per axis", place.in_language(English), angle.in_language(English))
        }),
    ]
    .into_iter()
    .flatten()
    .collect();
    let lines: Vec<Line> =
        result.estimate.as_ref().map_or_else(Vec::new, details).into_iter().map(Line::Words).collect();
    let title = if summary.is_empty() && lines.is_empty() { "" } else { "fit" };
    Section { title: title.to_owned(), summary, lines, name_width: 0 }
}

/// What is off about the arm, joint by joint.
fn arm(result: &CalibrationResult) -> Option<Section> {
    let arm = result.arm.as_ref()?;
    let ArmLevels { angle_deg, length_mm, compliance_deg } = arm.levels;
    let mut summary = vec![format!("typically {angle_deg:.4}° and {length_mm:.4} mm, compliance {compliance_deg:.4}°")];
    if let Some(field) = &arm.field {
        let (mm, deg) = (field.typical_mm, field.typical_deg);
        summary
            .push(format!("beside them errors that depend on the place: {mm:.3} mm and {deg:.4}° per axis, typically"));
    }
    if let Some(HeldOutByArm { reported, corrected }) = arm.heldout_px {
        let verdict = if arm.contradicted { ": do not correct by them" } else { "" };
        summary.push(format!("held-out error {reported:.4} → {corrected:.4} px by corrected poses{verdict}"));
    }
    let row = |joint: &JointErrorEstimate| {
        let zero = joint.zero_deg.zip(joint.zero_sigma_deg).map(|(value, sigma)| ([value], [sigma]));
        let zero = zero.map(|(values, sigmas)| with_sigma("zero", &values, &sigmas, "°"));
        let tilt = joint.tilt_deg.zip(joint.tilt_sigma_deg).map(|(v, s)| with_sigma("axis", &v, &s, "°"));
        let shift = joint.shift_mm.zip(joint.shift_sigma_mm).map(|(v, s)| with_sigma("place", &v, &s, " mm"));
        let parts: Vec<String> = [zero, tilt, shift].into_iter().flatten().collect();
        (!parts.is_empty()).then(|| Line::row(&joint.name, parts))
    };
    let lines = arm.joints.iter().filter_map(row).collect();
    Some(Section { title: "errors of the arm".to_owned(), summary, lines, name_width: 12 })
}

fn with_sigma(what: &str, values: &[f64], sigmas: &[f64], unit: &str) -> String {
    let each: Vec<_> = values.iter().zip(sigmas).map(|(value, sigma)| format!("{value:+.4} ± {sigma:.4}")).collect();
    format!("{what} {}{unit}", each.join(", "))
}

/// Details of the joint estimate: only what is worth reporting.
fn details(estimate: &EstimateDetails) -> Vec<String> {
    let mut out = Vec::new();
    if let Some(sigma) = estimate.view_sigma_px.filter(|sigma| *sigma > 0.0) {
        out.push(format!("the corners of a view share errors of {sigma:.4} px"));
    }
    if let Some(n) = estimate.degrees_of_freedom.filter(|n| *n < 1e5) {
        out.push(format!("error of a point: Student's t with {n:.0} degrees of freedom"));
    }
    if let Some(widening) = estimate.widening.as_ref().filter(|widening| widening.factor >= WIDENING_WORTH_SAYING) {
        let by = widening.by.replace('_', " ");
        out.push(format!("stated uncertainty widened {:.2} times, by {by}", widening.factor));
    }
    if let Some(board) = &estimate.board {
        if let Some([x, y]) = board.warp_sigma_mm {
            let [wx, wy] = board.warp_mm;
            out.push(format!("target bent by {wx:.3} ± {x:.3} mm along x, {wy:.3} ± {y:.3} mm along y"));
        }
        if let Some(sigma) = board.scale_sigma {
            out.push(format!("target {:.5} ± {sigma:.5} times its stated size", board.scale));
        }
    }
    // One size: the estimated one, or else what the robot's motion implies for the one that is taken as stated.
    let estimated = estimate.board.as_ref().is_some_and(|board| board.scale_sigma.is_some());
    if let Some(size) = estimate.target_size.filter(|_| !estimated) {
        let (scale, sigma) = (size.true_over_stated, size.sigma);
        let unsure = if size.determined { "" } else { ": another size would not be noticed" };
        out.push(format!(
            "target {scale:.5} ± {sigma:.5} times its stated size by the robot's motion, taken as stated{unsure}"
        ));
    }
    if let Some(field) = &estimate.robot_field {
        let with = field
            .heldout_rms_px
            .map_or_else(String::new, |px| format!(", {px:.4} px on views held out with it applied"));
        let (mm, deg) = (field.typical_mm, field.typical_deg);
        out.push(format!("robot errors that depend on its place: {mm:.3} mm and {deg:.4}° per axis, typically{with}"));
    }
    if let Some(print) = &estimate.print {
        out.push(format!("print of the target off its drawing: {:.4} mm RMS per axis", print.rms_mm));
    }
    if let Some(depths) = &estimate.depths {
        let verdict = if depths.accepted { "taken" } else { "not taken" };
        let (before, after) = (depths.heldout_before_px, depths.heldout_after_px);
        let noise = shown(depths.noise_mm, 3);
        out.push(format!(
            "depths of {} captures: {verdict}, noise {noise} mm, held-out error {before:.4} → {after:.4} px",
            depths.captures
        ));
    }
    if let Some(distortion) = &estimate.residual_distortion {
        out.push(format!("lens beyond its model: {:.4} px RMS over the corners", distortion.rms_px));
    }
    out
}

fn truth(result: &CalibrationResult) -> Option<Section> {
    let truth = result.truth.as_ref()?;
    let show = |what: &str, value: Option<f64>, unit: &str| match value {
        Some(value) => format!("{what} {value:.4}{unit}"),
        None => format!("{what} unknown"),
    };
    let summary = vec![
        show("translation", truth.translation_error_mm, " mm"),
        show("rotation", truth.rotation_error_deg, "°"),
        show("focal length", truth.focal_error_percent, " %"),
    ];
    Some(Section { title: "against the truth of the cell".to_owned(), summary, ..Section::default() })
}

fn methods(result: &CalibrationResult) -> Section {
    if result.methods.is_empty() {
        return Section::default();
    }
    let row = |m: &handeye_result::MethodRecord| {
        let reported = match (&m.status, m.translation_m.map(|t| t.map(|v| v * 1e3))) {
            (MethodStatus::Ok, Some([x, y, z])) => format!("[{x:9.3} {y:9.3} {z:9.3}] mm"),
            (MethodStatus::Failed(why), _) => why.clone(),
            (MethodStatus::Ok, None) => return None,
        };
        Some(Line::row(&m.name, [reported]))
    };
    let title = "closed forms, for comparison".to_owned();
    Section { title, lines: result.methods.iter().filter_map(row).collect(), name_width: 12, ..Section::default() }
}

fn views(result: &CalibrationResult) -> Section {
    let lines = result.views.iter().map(|view| {
        let status = match view.status {
            ViewRecordStatus::Used => "used",
            ViewRecordStatus::Excluded => "excluded",
            ViewRecordStatus::Outlier => "outlier",
            ViewRecordStatus::NoTarget => "target not found",
        };
        let rms = view.rms_px.map(|v| format!("{v:.4} px"));
        let influence = view.influence_mm.map(|v| format!("influence {v:.3} mm"));
        Line::row(&view.name, [Some(status.to_owned()), rms, influence].into_iter().flatten())
    });
    Section { title: "views".to_owned(), lines: lines.collect(), name_width: 24, ..Section::default() }
}

/// Errors of the depths of the captures.
fn depth_camera(result: &CalibrationResult) -> Option<Section> {
    let depth = result.depth?;
    let title = match depth.captures {
        1 => "depth camera, by the target in 1 capture".to_owned(),
        count => format!("depth camera, by the target in {count} captures"),
    };
    let filled = format!("{:.1} % of its pixels have a depth", depth.fill * 1e2);
    let Some(errors) = depth.errors else {
        let ratio = format!("{} times what is expected", shown(depth.ratio, 3));
        return Some(Section { title, summary: vec![filled, ratio], ..Section::default() });
    };
    // To the decimals of its uncertainty.
    let with_sigma = |value: f64, sigma: f64, least: usize| {
        let decimals = decimals(sigma, least);
        format!("{value:+.decimals$} ± {sigma:.decimals$}")
    };
    let offset = with_sigma(errors.offset_mm, errors.offset_sigma_mm, 3);
    let mut lines = vec![Line::row("offset", [format!("{offset} mm at {:.0} mm", errors.at_mm)])];
    if let (Some(scale), Some(sigma)) = (errors.scale, errors.scale_sigma) {
        lines.push(Line::row("scale", [format!("{} %", with_sigma(scale * 1e2, sigma * 1e2, 3))]));
    }
    if let (Some(slope), Some(sigma)) = (errors.slope_px, errors.slope_sigma_px) {
        lines.push(Line::row("slope", [format!("{} px", with_sigma(slope, sigma, 2))]));
    }
    let [x, y] = [0, 1].map(|axis| with_sigma(errors.tilt_deg[axis], errors.tilt_sigma_deg[axis], 3));
    lines.push(Line::row("tilt", [format!("x {x}°, y {y}°")]));
    let noise = [errors.noise_mm, errors.between_mm].map(|mm| shown(mm, 3));
    lines.push(Line::row("noise", [format!("{} mm of single depths, {} mm between captures", noise[0], noise[1])]));
    Some(Section { title, summary: vec![filled], lines, name_width: 8 })
}

/// How the answer does on captures that never entered the fit; empty when there are none.
fn verification(solved: &Solved) -> Vec<Section> {
    let title = "verification";
    match &solved.verification {
        None => Vec::new(),
        Some(Err(error)) => {
            vec![Section { title: title.to_owned(), summary: vec![error.to_string()], ..Section::default() }]
        }
        Some(Ok(verification)) => {
            let corrected = solved.corrected.as_ref().and_then(|corrected| corrected.verification.as_ref());
            let by_arm =
                corrected.map(|it| checked("verification by tip poses corrected for the errors of the arm,", it));
            std::iter::once(checked(title, verification)).chain(by_arm).collect()
        }
    }
}

fn checked(title: &str, verification: &Verification) -> Section {
    let captures = match verification.captures.len() {
        1 => "1 capture that was".to_owned(),
        count => format!("{count} captures that were"),
    };
    let (mm, deg) = (verification.centre_rms_m * 1e3, verification.orientation_rms_rad.to_degrees());
    let lines = verification.captures.iter().map(|check| {
        let mm = check.centre_error_m.norm() * 1e3;
        Line::row(&check.name, [format!("{:.4} px", check.rms_px), format!("{mm:.3} mm")])
    });
    let verdict = verification
        .is_as_stated()
        .map(|is_as_stated| if is_as_stated { "no larger than stated" } else { "LARGER THAN STATED" });
    Section {
        title: format!("{title} on {captures} not in the fit"),
        summary: [
            Some(format!("{:.4} px RMS", verification.rms_px)),
            Some(format!("middle of the board {mm:.3} mm and {deg:.4}° RMS")),
            verdict.map(str::to_owned),
        ]
        .into_iter()
        .flatten()
        .collect(),
        lines: lines.collect(),
        name_width: 24,
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use handeye_result::OverdispersionRecord;

    use super::*;
    use crate::testing::sample;

    #[test]
    fn a_widening_that_changes_no_figure_is_not_said() {
        let model = sample::solved();
        let mut solved = Arc::unwrap_or_clone(model.solve.current().expect("solved").clone());
        let mut reported = |factor| {
            let widening = Some(OverdispersionRecord { factor, by: "jackknife".to_owned(), lens_factor: None });
            solved.result.estimate.as_mut().expect("a joint estimate").widening = widening;
            page(&solved)
        };
        assert!(!reported(1.01).contains("widened"));
        assert!(reported(1.1).contains("  stated uncertainty widened 1.10 times, by jackknife\n"));
    }
}
