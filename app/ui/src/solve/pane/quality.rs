//! The camera, the noise levels, and residuals, each called by its name.

use egui::Ui;
use handeye_estimate::resolution::{angle_text, place_text};

use crate::style::numbers;
use crate::style::parts;
use handeye_workbench::model::{Model, Solved};
use handeye_workbench::tr;

/// Intrinsics with one standard deviation.
pub fn camera_ui(ui: &mut Ui, model: &Model, solved: &Solved) {
    let language = model.view.language;
    let Some(camera) = &solved.result.intrinsics else { return };
    parts::section_ui(ui, tr!(language, "Camera"));
    if camera.fixed {
        parts::hint_ui(ui, tr!(language, "The intrinsics were given and kept."));
    } else {
        parts::hint_ui(ui, tr!(language, "Estimated together with everything else; ± is one standard deviation."));
    }
    for (name, value, sigma) in [
        ("fx", camera.fx, camera.sigma.fx),
        ("fy", camera.fy, camera.sigma.fy),
        ("cx", camera.cx, camera.sigma.cx),
        ("cy", camera.cy, camera.sigma.cy),
    ] {
        let value = numbers::fixed(value, 2, 8);
        let stated = match sigma {
            Some(sigma) => format!("{value} ± {sigma:.2} px"),
            None => format!("{value} px"),
        };
        parts::stated_ui(ui, name, &stated);
    }
    if !camera.distortion.is_empty() {
        parts::stated_ui(ui, &camera.model, &numbers::row(&camera.distortion, 4, 7))
            .on_hover_text(tr!(language, "Coefficients of the lens in OpenCV's order"));
    }
}

/// Noise levels and residuals.
pub fn noise_ui(ui: &mut Ui, model: &Model, solved: &Solved) {
    let language = model.view.language;
    let quality = &solved.result.quality;
    parts::section_ui(ui, tr!(language, "Noise, as estimated from the captures"));
    stated(ui, tr!(language, "Corners"), quality.sigma_px.map(|px| format!("{px:.3} px")));
    if solved.calibration.hand_eye.is_some() {
        stated(
            ui,
            tr!(language, "Robot position"),
            quality.robot_sigma_mm.map(|mm| place_text(mm * 1e-3).in_language(language)),
        );
        stated(
            ui,
            tr!(language, "Robot rotation"),
            quality.robot_sigma_deg.map(|deg| angle_text(deg.to_radians()).in_language(language)),
        );
    }
    parts::section_ui(ui, tr!(language, "Residuals (not accuracy)"));
    stated(ui, tr!(language, "Fit, RMS"), quality.rms_px.map(|px| format!("{px:.3} px")));
    // From the complete model, with the robot's field if there is one: that is what the noise levels explain.
    let joint = solved.calibration.joint.as_ref();
    let of_model = joint.and_then(|joint| Some((joint.heldout_rms_px?, joint.expected_heldout_rms_px)));
    let heldout = match of_model {
        Some((px, expected)) => Some(format!("{px:.3} px ({expected:.3})")),
        None => quality.heldout_rms_px.map(|px| format!("{px:.3} px")),
    };
    stated(ui, tr!(language, "Held out, RMS"), heldout).on_hover_text(tr!(
        language,
        "Of views that were left out of the fit and predicted from their robot poses; in brackets what the noise levels \
         explain"
    ));
}

#[expect(clippy::needless_pass_by_value, reason = "made where it is stated")]
fn stated(ui: &mut Ui, caption: &str, value: Option<String>) -> egui::Response {
    parts::stated_ui(ui, caption, value.as_deref().unwrap_or("–"))
}
