//! The result as Markdown: what a person reads beside the scene.

use std::fmt::Write as _;

use handeye_core::diagnose::findings::Severity;
use handeye_core::project::result::{CalibrationResult, MethodStatus, Quality, TransformEstimate};

use crate::cli::report;
use crate::model::{self, Solved};
use crate::text::{Language, Text};

/// Writing into a `String` cannot fail.
macro_rules! line {
    ($out:expr) => {{ $out.push('\n'); }};
    ($out:expr, $($arg:tt)*) => {{
        let _infallible = writeln!($out, $($arg)*);
    }};
}

/// The report of a calibration, with what is weak in it and what to do next.
pub(super) fn markdown(solved: &Solved) -> String {
    let result = &solved.result;
    let mut out = String::new();
    line!(out, "# {}\n", report::title(result));
    if let Some(expected) = report::expected_error(result) {
        line!(out, "**{}**\n", capitalised(&expected));
    }
    findings(&mut out, solved);
    for transform in [&result.hand_eye, &result.target].into_iter().flatten() {
        pose(&mut out, transform);
    }
    estimate(&mut out, solved);
    camera(&mut out, result);
    quality(&mut out, &result.quality);
    verification(&mut out, solved);
    truth(&mut out, result);
    methods(&mut out, result);
    views(&mut out, result);
    out
}

fn capitalised(text: &str) -> String {
    let mut letters = text.chars();
    letters.next().map_or_else(String::new, |first| first.to_uppercase().chain(letters).collect())
}

fn findings(out: &mut String, solved: &Solved) {
    for finding in &solved.findings {
        let mark = match finding.severity {
            Severity::Info => "Note",
            Severity::Advice => "Advice",
            Severity::Warning => "Warning",
            Severity::Problem => "Problem",
        };
        line!(out, "- *{mark}:* {finding}");
    }
    if !solved.findings.is_empty() {
        line!(out);
    }
}

fn pose(out: &mut String, transform: &TransformEstimate) {
    let [x, y, z] = transform.translation_m.map(|metres| metres * 1e3);
    let [qx, qy, qz, qw] = transform.rotation_xyzw;
    line!(out, "## {}_from_{}\n", transform.parent_frame, transform.child_frame);
    line!(out, "| | x | y | z | w |");
    line!(out, "| --- | --- | --- | --- | --- |");
    line!(out, "| translation [mm] | {x:.3} | {y:.3} | {z:.3} | |");
    if let Some(c) = transform.covariance {
        let [a, b, c] = [0, 1, 2].map(|i| c[i][i].max(0.0).sqrt() * 1e3);
        line!(out, "| standard deviation [mm] | {a:.3} | {b:.3} | {c:.3} | |");
    }
    line!(out, "| quaternion | {qx:.6} | {qy:.6} | {qz:.6} | {qw:.6} |");
    if let Some(c) = transform.covariance {
        let [a, b, c] = [3, 4, 5].map(|i| c[i][i].max(0.0).sqrt().to_degrees());
        line!(out, "| standard deviation [°] | {a:.4} | {b:.4} | {c:.4} | |");
    }
    line!(out);
}

/// What the result pane says below the answer.
fn estimate(out: &mut String, solved: &Solved) {
    let lines = model::estimated(&solved.calibration);
    if lines.is_empty() {
        return;
    }
    let said = |text: &Text| text.say(Language::English);
    line!(out, "## What the estimate found out\n");
    line!(out, "| | |");
    line!(out, "| --- | --- |");
    for it in &lines {
        let why = it.why.as_ref().map_or_else(String::new, |why| format!(": {}", said(why)));
        line!(out, "| {} | {}{} |", cell(&said(&it.what)), cell(&said(&it.value)), cell(&why));
    }
    line!(out);
}

fn camera(out: &mut String, result: &CalibrationResult) {
    let Some(camera) = &result.intrinsics else { return };
    let how = if camera.fixed { "given" } else { "estimated" };
    line!(out, "## Camera, {how}\n");
    line!(out, "| | value [px] | standard deviation [px] |");
    line!(out, "| --- | --- | --- |");
    let sigma = camera.sigma;
    for (name, value, sigma) in [
        ("fx", camera.fx, sigma.fx),
        ("fy", camera.fy, sigma.fy),
        ("cx", camera.cx, sigma.cx),
        ("cy", camera.cy, sigma.cy),
    ] {
        let sigma = sigma.map_or_else(String::new, |sigma| format!("{sigma:.3}"));
        line!(out, "| {name} | {value:.3} | {sigma} |");
    }
    let k: Vec<String> = camera.distortion.iter().map(|k| format!("{k:.6}")).collect();
    line!(out, "\n{}×{} pixels, lens model {} [{}]\n", camera.width, camera.height, camera.model, k.join(" "));
}

fn quality(out: &mut String, quality: &Quality) {
    let rows = [
        ("residual of the fit, RMS", quality.rms_px, "px"),
        ("residual of views held out, RMS", quality.heldout_rms_px, "px"),
        ("noise of a corner, per axis", quality.sigma_px, "px"),
        ("noise of the robot's position, per axis", quality.robot_sigma_mm, "mm"),
        ("noise of the robot's orientation, per axis", quality.robot_sigma_deg, "°"),
    ];
    if rows.iter().all(|(_, value, _)| value.is_none()) {
        return;
    }
    line!(out, "## Fit\n");
    line!(out, "| | |");
    line!(out, "| --- | --- |");
    for (name, value, unit) in rows {
        if let Some(value) = value {
            line!(out, "| {name} | {value:.4} {unit} |");
        }
    }
    line!(out, "\nA residual says how well the model fits, not how accurate it is.\n");
}

fn verification(out: &mut String, solved: &Solved) {
    match &solved.verification {
        None => {}
        Some(Err(error)) => line!(out, "## Verification\n\n{error}\n"),
        Some(Ok(verification)) => {
            line!(out, "## Verification\n");
            line!(
                out,
                "{} captures that took no part in the fit are predicted to {:.3} px RMS; the middle of the board to {:.3} mm \
                 and its orientation to {:.4}°, RMS.\n",
                verification.captures.len(),
                verification.rms_px,
                verification.centre_rms_m * 1e3,
                verification.orientation_rms_rad.to_degrees()
            );
        }
    }
}

fn truth(out: &mut String, result: &CalibrationResult) {
    let Some(truth) = &result.truth else { return };
    let show = |value: Option<f64>, unit: &str| value.map_or_else(|| "unknown".to_owned(), |v| format!("{v:.4}{unit}"));
    line!(out, "## Against the truth of the cell\n");
    line!(
        out,
        "Translation {}, rotation {}, focal length {}.\n",
        show(truth.translation_error_mm, " mm"),
        show(truth.rotation_error_deg, "°"),
        show(truth.focal_error_percent, " %")
    );
}

fn methods(out: &mut String, result: &CalibrationResult) {
    if result.methods.is_empty() {
        return;
    }
    line!(out, "## Closed forms, for comparison\n");
    line!(out, "| method | x [mm] | y [mm] | z [mm] |");
    line!(out, "| --- | --- | --- | --- |");
    for method in &result.methods {
        match (&method.status, method.translation_m) {
            (MethodStatus::Ok, Some(t)) => {
                let [x, y, z] = t.map(|metres| metres * 1e3);
                line!(out, "| {} | {x:.3} | {y:.3} | {z:.3} |", method.name);
            }
            (MethodStatus::Failed(why), _) => line!(out, "| {} | {} | | |", method.name, cell(why)),
            (MethodStatus::Ok, None) => {}
        }
    }
    line!(out);
}

fn views(out: &mut String, result: &CalibrationResult) {
    line!(out, "## Views\n");
    line!(out, "| view | | residual [px] | moves the answer by [mm] |");
    line!(out, "| --- | --- | --- | --- |");
    for view in &result.views {
        let number = |value: Option<f64>, digits: usize| value.map_or_else(String::new, |v| format!("{v:.digits$}"));
        let (rms, influence) = (number(view.rms_px, 4), number(view.influence_mm, 3));
        line!(out, "| {} | {} | {rms} | {influence} |", cell(&view.name), report::status(view.status));
    }
}

/// Text that may hold anything, in a cell of a table.
fn cell(text: &str) -> String {
    text.replace('|', "\\|").replace(['\n', '\r'], " ")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gui::testing::sample;

    #[test]
    fn the_report_says_what_to_expect_and_lists_every_view() {
        let model = sample::solved();
        let text = markdown(model.solve.current().expect("solved"));
        let expected = model.solve.current().and_then(|s| s.result.quality.tip_error_95_mm).expect("stated");
        assert!(text.contains(&format!("below {expected:.3} mm in 95 %")), "{text}");
        for n in 1..=sample::FITTED {
            assert!(text.contains(&format!("| images/{n:04}.png | used | 0.")), "{text}");
        }
        assert!(text.contains("## tip_from_camera") && text.contains("## base_from_target"), "{text}");
        assert!(text.contains("2 captures that took no part"), "{text}");
    }

    #[test]
    fn the_report_says_what_was_set_aside_and_what_the_estimate_found_out() {
        let model = sample::with_an_outlier();
        let text = markdown(model.solve.current().expect("solved"));
        assert!(text.contains("| Outlier views | 1 of 10 |"), "{text}");
        assert!(text.contains("| Noise levels | "), "{text}");
        assert!(text.contains("- *Warning:* 1 outlier view"), "{text}");
        assert!(text.contains("| images/0003.png | outlier | 18.0000 |"), "{text}");
    }

    #[test]
    fn a_name_cannot_break_a_table() {
        assert_eq!(cell("a|b\nc"), "a\\|b c");
    }
}
