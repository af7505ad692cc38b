//! The result as a page of text for a person.

use std::fmt::Write as _;

use handeye_core::diagnose::findings::WIDENING_WORTH_SAYING;
use handeye_core::estimate::handeye::Mode;
use handeye_core::project::result::{CalibrationResult, MethodStatus, TransformEstimate, ViewRecordStatus};

use crate::model::Solved;

/// Writing into a `String` cannot fail.
macro_rules! line {
    ($out:expr, $($arg:tt)*) => {{
        let _infallible = writeln!($out, $($arg)*);
    }};
}

/// The report. It ends with a newline.
pub fn text(result: &CalibrationResult) -> String {
    let mut out = String::new();
    headline(&mut out, result);
    findings(&mut out, result);
    for link in [&result.hand_eye, &result.target].into_iter().flatten() {
        transform(&mut out, link, sigma_name(result));
    }
    camera(&mut out, result);
    fit(&mut out, result);
    details(&mut out, result);
    truth(&mut out, result);
    methods(&mut out, result);
    views(&mut out, result);
    out
}

/// One session of several: what it is worth and what was found, under its `name`. It ends with a newline.
pub fn of_session(name: &str, result: &CalibrationResult) -> String {
    let mut out = String::new();
    line!(out, "{name}");
    headline(&mut out, result);
    findings(&mut out, result);
    out
}

/// The lens that sessions share, from the result of one of them. It ends with a newline.
pub fn shared_camera(sessions: usize, views: usize, result: &CalibrationResult) -> String {
    let mut out = String::new();
    line!(out, "one lens by {views} views of {sessions} sessions");
    camera(&mut out, result);
    out
}

fn headline(out: &mut String, result: &CalibrationResult) {
    line!(out, "{}", title(result));
    if let Some(expected) = expected_error(result) {
        line!(out, "  {expected}");
    }
}

/// What was calibrated.
pub fn title(result: &CalibrationResult) -> &'static str {
    match result.mode {
        Some(Mode::EyeInHand) => "Hand-eye calibration, camera on the tip",
        Some(Mode::EyeToHand) => "Hand-eye calibration, camera beside the robot",
        None => "Intrinsic calibration, no robot poses",
    }
}

/// What a user of the calibration can expect; `None` for a camera alone.
pub fn expected_error(result: &CalibrationResult) -> Option<String> {
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
    let estimate = result.estimate.as_ref();
    Some(match estimate.and_then(|estimate| estimate.moved_mm.zip(estimate.modelled_error_95_mm)) {
        Some((moved, modelled)) => format!(
            "{stated}: what is found below would move the answer by {moved:.3} mm, the noise alone makes {modelled:.3} mm"
        ),
        None => stated,
    })
}

/// What became of a view.
pub fn status(status: ViewRecordStatus) -> &'static str {
    match status {
        ViewRecordStatus::Used => "used",
        ViewRecordStatus::Excluded => "excluded",
        ViewRecordStatus::Outlier => "outlier",
        ViewRecordStatus::NoTarget => "target not found",
    }
}

/// What the standard deviations are: with something found that is not in the model they are no error of the answer.
fn sigma_name(result: &CalibrationResult) -> &'static str {
    let moved = result.estimate.as_ref().is_some_and(|estimate| estimate.moved_mm.is_some());
    if moved || result.problem().is_some() { "standard deviation by noise alone" } else { "standard deviation" }
}

fn transform(out: &mut String, t: &TransformEstimate, sigma_name: &str) {
    let [x, y, z] = t.translation_m.map(|v| v * 1e3);
    let [qx, qy, qz, qw] = t.rotation_xyzw;
    line!(out, "{}_from_{}", t.parent_frame, t.child_frame);
    line!(out, "  t  [{x:.3} {y:.3} {z:.3}] mm");
    line!(out, "  q  [{qx:.6} {qy:.6} {qz:.6} {qw:.6}] xyzw");
    if let Some(c) = t.covariance {
        let sigma: Vec<f64> = (0..6).map(|i| c[i][i].max(0.0).sqrt()).collect();
        let [a, b, c] = [0, 1, 2].map(|i| sigma[i] * 1e3);
        let [d, e, f] = [3, 4, 5].map(|i| sigma[i].to_degrees());
        line!(out, "  {sigma_name} [{a:.3} {b:.3} {c:.3}] mm, [{d:.4} {e:.4} {f:.4}]°");
    }
}

fn camera(out: &mut String, result: &CalibrationResult) {
    let Some(i) = &result.intrinsics else { return };
    let how = if i.fixed { "given" } else { "estimated" };
    line!(out, "camera {}×{}, {}, {how}", i.width, i.height, i.model);
    let with_sigma = |value: f64, sigma: Option<f64>| match sigma {
        Some(sigma) => format!("{value:.3} ± {sigma:.3}"),
        None => format!("{value:.3}"),
    };
    line!(
        out,
        "  fx {}  fy {}  cx {}  cy {} px{}",
        with_sigma(i.fx, i.sigma.fx),
        with_sigma(i.fy, i.sigma.fy),
        with_sigma(i.cx, i.sigma.cx),
        with_sigma(i.cy, i.sigma.cy),
        if i.sigma.fx.is_some() { " (± one standard deviation)" } else { "" }
    );
    if !i.distortion.is_empty() {
        let k: Vec<String> = i.distortion.iter().map(|k| format!("{k:.6}")).collect();
        line!(out, "  distortion [{}]", k.join(" "));
    }
}

fn fit(out: &mut String, result: &CalibrationResult) {
    let q = &result.quality;
    let mut parts = Vec::new();
    if let Some(rms) = q.rms_px {
        parts.push(format!("residual {rms:.4} px RMS"));
    }
    if let Some(rms) = q.heldout_rms_px {
        parts.push(format!("{rms:.4} px on views held out"));
    }
    if let Some(sigma) = q.sigma_px {
        parts.push(format!("corner noise {sigma:.4} px per axis"));
    }
    if let (Some(mm), Some(deg)) = (q.robot_sigma_mm, q.robot_sigma_deg) {
        parts.push(format!("robot noise {mm:.4} mm and {deg:.4}° per axis"));
    }
    if !parts.is_empty() {
        line!(out, "fit: {}", parts.join(", "));
    }
}

/// What the joint estimate says of itself: only what there is to say.
fn details(out: &mut String, result: &CalibrationResult) {
    let Some(estimate) = &result.estimate else { return };
    if let Some(sigma) = estimate.view_sigma_px.filter(|sigma| *sigma > 0.0) {
        line!(out, "  the corners of a view share errors of {sigma:.4} px");
    }
    match estimate.degrees_of_freedom {
        Some(n) if n < 1e5 => line!(out, "  noise levels on {n:.0} degrees of freedom"),
        _ => {}
    }
    if let Some(widening) = estimate.widening.as_ref().filter(|widening| widening.factor >= WIDENING_WORTH_SAYING) {
        line!(out, "  stated uncertainty widened {:.2} times, by {}", widening.factor, widening.by.replace('_', " "));
    }
    if let Some(board) = &estimate.board {
        if let Some([x, y]) = board.warp_sigma_mm {
            let [wx, wy] = board.warp_mm;
            line!(out, "  target bent by {wx:.3} ± {x:.3} mm along x, {wy:.3} ± {y:.3} mm along y");
        }
        if let Some(sigma) = board.scale_sigma {
            line!(out, "  target {:.5} ± {sigma:.5} times its stated size", board.scale);
        }
    }
    if let Some(field) = &estimate.robot_field {
        let with = field
            .heldout_rms_px
            .map_or_else(String::new, |px| format!(", {px:.4} px on views held out with it applied"));
        let (mm, deg) = (field.typical_mm, field.typical_deg);
        line!(out, "  robot errors that depend on its place: {mm:.3} mm and {deg:.4}° per axis, typically{with}");
    }
    if let Some(joints) = &estimate.joint_offsets {
        let each: Vec<String> =
            joints.offsets_deg.iter().zip(&joints.sigma_deg).map(|(o, s)| format!("{o:.4} ± {s:.4}°")).collect();
        let verdict = if joints.accepted { "taken" } else { "not taken" };
        let (before, after) = (joints.heldout_before_px, joints.heldout_after_px);
        line!(out, "  joint offsets {}: {verdict}, held-out error {before:.4} → {after:.4} px", each.join(", "));
    }
}

fn findings(out: &mut String, result: &CalibrationResult) {
    for finding in &result.findings {
        line!(out, "{} [{}]: {}", finding.severity, finding.code, finding.text);
    }
}

fn truth(out: &mut String, result: &CalibrationResult) {
    let Some(truth) = &result.truth else { return };
    let show = |value: Option<f64>, unit: &str| value.map_or_else(|| "unknown".to_owned(), |v| format!("{v:.4}{unit}"));
    line!(
        out,
        "against the truth of the cell: translation {}, rotation {}, focal length {}",
        show(truth.translation_error_mm, " mm"),
        show(truth.rotation_error_deg, "°"),
        show(truth.focal_error_percent, " %")
    );
}

/// How the answer does on captures that never entered the fit; nothing when there are none.
pub fn verification(solved: &Solved) -> String {
    let mut out = String::new();
    match &solved.verification {
        None => {}
        Some(Err(error)) => line!(out, "verification: {error}"),
        Some(Ok(verification)) => {
            let captures = match verification.captures.len() {
                1 => "1 capture that was".to_owned(),
                count => format!("{count} captures that were"),
            };
            line!(
                out,
                "verification on {captures} not in the fit: {:.4} px RMS, middle of the board {:.3} mm and {:.4}° RMS",
                verification.rms_px,
                verification.centre_rms_m * 1e3,
                verification.orientation_rms_rad.to_degrees()
            );
            for check in &verification.captures {
                let mm = check.centre_error_m.norm() * 1e3;
                line!(out, "  {:<24} {:.4} px  {mm:.3} mm", check.name, check.rms_px);
            }
        }
    }
    out
}

fn methods(out: &mut String, result: &CalibrationResult) {
    if result.methods.is_empty() {
        return;
    }
    line!(out, "closed forms, for comparison");
    for m in &result.methods {
        match (&m.status, m.translation_m) {
            (MethodStatus::Ok, Some(t)) => {
                let [x, y, z] = t.map(|v| v * 1e3);
                line!(out, "  {:<12} [{x:9.3} {y:9.3} {z:9.3}] mm", m.name);
            }
            (MethodStatus::Failed(why), _) => line!(out, "  {:<12} {why}", m.name),
            (MethodStatus::Ok, None) => {}
        }
    }
}

fn views(out: &mut String, result: &CalibrationResult) {
    line!(out, "views");
    for view in &result.views {
        let status = status(view.status);
        let rms = view.rms_px.map_or_else(String::new, |v| format!("  {v:.4} px"));
        let influence = view.influence_mm.map_or_else(String::new, |v| format!("  influence {v:.3} mm"));
        line!(out, "  {:<24} {status}{rms}{influence}", view.name);
    }
}

#[cfg(test)]
mod tests {
    use handeye_core::project::result::WideningRecord;

    use super::*;
    use crate::gui::testing::sample;

    #[test]
    fn a_widening_that_changes_no_figure_is_not_said() {
        let model = sample::solved();
        let mut result = model.solve.current().expect("solved").result.clone();
        let mut said = |factor| {
            let widening = Some(WideningRecord { factor, by: "jackknife".to_owned() });
            result.estimate.as_mut().expect("a joint estimate").widening = widening;
            text(&result)
        };
        assert!(!said(1.01).contains("widened"));
        assert!(said(1.1).contains("stated uncertainty widened 1.10 times, by jackknife"));
    }
}
