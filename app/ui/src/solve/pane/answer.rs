//! Where the camera is, how large its error may be, and its true error if the truth is known.

use egui::{RichText, Ui};
use handeye_estimate::handeye::Mode;
use handeye_estimate::handeye::joint::SmallSample;
use handeye_estimate::stated_uncertainty::StatedUncertainty;

use super::figures::{self, Within95};
use crate::style::numbers;
use crate::style::parts;
use crate::style::theme::Palette;
use handeye_wording::text;
use handeye_workbench::model::{Model, RotationFormat, Solved};
use handeye_workbench::tr;

/// The transform.
pub fn answer_ui(ui: &mut Ui, model: &Model, solved: &Solved) {
    let language = model.view.language;
    let Some(hand_eye) = solved.calibration.hand_eye else {
        parts::section_ui(ui, tr!(language, "Camera only"));
        parts::hint_ui(ui, tr!(language, "There are no robot poses, so only the camera itself is calibrated."));
        return;
    };
    let (title, name, meaning) = match hand_eye.mode() {
        Mode::EyeInHand => (
            tr!(language, "Camera in tip"),
            "tip_from_camera",
            tr!(language, "The pose of the camera in the tip: a point p in the camera is T·p in the tip."),
        ),
        Mode::EyeToHand => (
            tr!(language, "Camera in base"),
            "base_from_camera",
            tr!(language, "The pose of the camera in the base: a point p in the camera is T·p in the base."),
        ),
    };
    let pose = hand_eye.mount_from_camera();
    let translation_mm = pose.translation() * 1e3;
    parts::section_with_ui(ui, title, |ui| {
        ui.label(RichText::new(name).monospace().color(Palette::of(ui).weak));
        parts::copy_ui(ui, language, name, || {
            let [x, y, z]: [f64; 3] = pose.translation().into();
            let [qx, qy, qz, qw] = pose.xyzw();
            format!("{name}: translation_m = [{x}, {y}, {z}], rotation_xyzw = [{qx}, {qy}, {qz}, {qw}]")
        });
    });
    parts::hint_ui(ui, meaning);
    let law = solved.calibration.joint.as_ref().map_or(SmallSample::KNOWN, |joint| joint.small_sample);
    // If something was found that is not in the model the covariance is not the error of the answer.
    let covariance = solved.calibration.link_covariances().map(|links| links.hand_eye);
    let covariance_withheld =
        covariance.is_some() && *solved.calibration.stated_uncertainty() != StatedUncertainty::AsModelled;
    let covariance = covariance.filter(|_| !covariance_withheld);
    let within = covariance.map(|c| Within95::new(&pose, &c, law));
    let deg = |radians: [f64; 3]| radians.map(f64::to_degrees);
    parts::stated_ui(ui, "x y z [mm]", &numbers::row(translation_mm.as_slice(), 3, 9));
    if let Some(within) = &within {
        parts::stated_ui(ui, "± 95 % [mm]", &numbers::row(&within.translation_m.map(|m| m * 1e3), 3, 9));
    }
    match model.view.rotation {
        RotationFormat::RollPitchYaw => {
            let (roll, pitch, yaw) = pose.rotation().euler_angles();
            parts::stated_ui(ui, tr!(language, "roll pitch yaw [°]"), &numbers::row(&deg([roll, pitch, yaw]), 4, 9))
        }
        RotationFormat::Quaternion => {
            parts::stated_ui(ui, tr!(language, "quaternion x y z w"), &numbers::row(&pose.xyzw(), 5, 8))
        }
    };
    match &within {
        Some(within) => {
            parts::stated_ui(ui, "± 95 % [°]", &numbers::row(&deg(within.rotation_rad), 4, 9))
                .on_hover_text(tr!(language, "About the x, y and z axis of the camera"));
        }
        None if covariance_withheld => {
            parts::hint_ui(ui, tr!(language, "With what was found below no ± can be stated for each axis."));
        }
        None => parts::hint_ui(ui, tr!(language, "A closed form states no uncertainty.")),
    }
}

/// The comparison with the truth of a simulated cell.
pub fn truth_ui(ui: &mut Ui, model: &Model, solved: &Solved) {
    let language = model.view.language;
    let Some(truth) = &solved.result.truth else { return };
    parts::section_ui(ui, tr!(language, "Against the truth of the simulation"));
    if let Some(mm) = truth.translation_error_mm {
        parts::stated_ui(ui, tr!(language, "Position off by"), &format!("{mm:.3} mm"));
    }
    if let Some(deg) = truth.rotation_error_deg {
        parts::stated_ui(ui, tr!(language, "Rotation off by"), &format!("{deg:.4}°"));
    }
    if let Some(percent) = truth.focal_error_percent {
        parts::stated_ui(ui, tr!(language, "Focal length off by"), &format!("{percent:.3} %"));
    }
    let Some(against) = figures::against_truth(model, solved) else { return };
    if let Some(at_board_m) = against.at_board_m {
        parts::stated_ui(ui, tr!(language, "At the board off by"), &format!("{:.3} mm", at_board_m * 1e3))
            .on_hover_text(tr!(language, "The error that the headline states a bound for"));
    }
    let palette = Palette::of(ui);
    let (colour, verdict) = match against.is_within {
        None => return,
        Some(true) => (palette.good, text!("Within the stated 95 %")),
        Some(false) => (palette.warning, text!("Outside the stated 95 %: that happens to 5 of 100 right calibrations")),
    };
    ui.horizontal(|ui| {
        parts::dot_ui(ui, colour);
        ui.add(egui::Label::new(RichText::new(verdict.in_language(language)).color(palette.text)).wrap());
    });
}
