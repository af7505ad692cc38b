//! The target, where the camera is mounted, and what is known about it.

use egui::{DragValue, Ui};
use handeye_dataset::CameraInput;
use handeye_estimate::handeye::Mode;
use handeye_geometry::camera::{Distortion, Intrinsics};
use handeye_geometry::observations::LENS_ACCURACY_PX;

use super::board::{board_ui, number_ui};
use crate::style::theme::{Palette, Tone};
use crate::style::{form, parts};
use handeye_wording::text;
use handeye_workbench::command::Outbox;
use handeye_workbench::model::Model;
use handeye_workbench::session;
use handeye_workbench::text::{Language, Text};
use handeye_workbench::tr;

/// The pane.
pub fn target_ui(ui: &mut Ui, model: &Model, outbox: &mut Outbox) {
    form::body_ui(ui, |ui| {
        board_ui(ui, model, outbox);
        ui.add_space(4.0);
        if model.document().mode().is_some() {
            mode_ui(ui, model, outbox);
            ui.add_space(4.0);
        }
        camera_ui(ui, model, outbox);
    });
}

fn mode_ui(ui: &mut Ui, model: &Model, outbox: &mut Outbox) {
    let language = model.view.language;
    let mode = model.document().meta.mode;
    form::heading_ui(ui, tr!(language, "Where the camera sits"));
    let choices =
        [(Mode::EyeInHand, tr!(language, "Eye in hand"), ""), (Mode::EyeToHand, tr!(language, "Eye to hand"), "")];
    if let Some(mode) = form::choice_ui(ui, mode, &choices) {
        outbox.send(session::Command::SetMode(mode));
    }
    parts::hint_ui(
        ui,
        match mode {
            Mode::EyeInHand => tr!(
                language,
                "The camera is on the robot, the board stands still. The answer is the pose of the camera in the tip frame."
            ),
            Mode::EyeToHand => tr!(
                language,
                "The camera stands still, the robot holds the board. The answer is the pose of the camera in the base frame."
            ),
        },
    );
}

/// A number of pixels as shown or typed.
fn pixels(text: &str) -> Option<f64> {
    text.trim().trim_start_matches('±').trim_end_matches("px").trim().parse().ok()
}

/// Intrinsics with a larger error should be estimated instead, pixels.
const MOST_PX: f64 = 20.0;

fn camera_ui(ui: &mut Ui, model: &Model, outbox: &mut Outbox) {
    let language = model.view.language;
    let camera = model.document().meta.camera;
    let fixed = camera.is_some_and(|camera| camera.fixed);
    form::heading_ui(ui, tr!(language, "Camera intrinsics"));
    let choices = [
        (false, tr!(language, "Estimate"), tr!(language, "From the captures")),
        (true, tr!(language, "Fixed"), tr!(language, "Known from an earlier calibration, as well as you say")),
    ];
    if let Some(fixed) = form::choice_ui(ui, fixed, &choices) {
        let intrinsics = start(model);
        let unknown =
            CameraInput { fixed, accuracy_px: None, intrinsics: Some(intrinsics), model: intrinsics.distortion };
        let camera = camera.unwrap_or(unknown);
        outbox.send(session::Command::SetCamera(Some(CameraInput {
            fixed,
            accuracy_px: camera.accuracy_px.filter(|_| fixed),
            intrinsics: camera.intrinsics.or(Some(intrinsics)),
            ..camera
        })));
    }
    let Some(CameraInput { intrinsics: Some(before), accuracy_px, .. }) = camera.filter(|camera| camera.fixed) else {
        parts::hint_ui(ui, tr!(language, "Focal lengths, principal point and lens are estimated from the captures."));
        return;
    };
    let mut now = before;
    let size = tr!(language, "Image size");
    form::row_ui(ui, size, |ui| {
        number_ui(ui, tr!(language, "Image width"), DragValue::new(&mut now.width).range(16..=20000).suffix(" px"));
        number_ui(ui, tr!(language, "Image height"), DragValue::new(&mut now.height).range(16..=20000).suffix(" px"));
    });
    for (caption, [first, second]) in [
        (tr!(language, "Focal length"), [("fx", &mut now.fx), ("fy", &mut now.fy)]),
        (tr!(language, "Principal point"), [("cx", &mut now.cx), ("cy", &mut now.cy)]),
    ] {
        form::row_ui(ui, caption, |ui| {
            for (name, value) in [first, second] {
                let value = DragValue::new(value).speed(0.1).max_decimals(4).prefix(format!("{name} ")).suffix(" px");
                number_ui(ui, name, value).on_hover_text(text!("{name} in pixels", name = name).in_language(language));
            }
        });
    }
    lens_ui(ui, &mut now, language);
    let mut accuracy = accuracy_px.unwrap_or(0.0);
    form::row_ui(ui, tr!(language, "Accuracy"), |ui| {
        let exact = tr!(language, "exact");
        let shown = move |px: f64, _| if px > 0.0 { format!("± {px} px") } else { exact.to_owned() };
        let value = DragValue::new(&mut accuracy)
            .speed(0.01)
            .range(0.0..=MOST_PX)
            .clamp_existing_to_range(false)
            .custom_formatter(shown)
            .custom_parser(pixels);
        number_ui(ui, tr!(language, "Accuracy of the intrinsics"), value).on_hover_text(tr!(
            language,
            "By how much each of them may displace points of the image, one standard deviation, RMS; half a pixel is usual of a data \
             sheet or another program. The expected error counts it. At 0 they are taken as exact."
        ));
    });
    // A smaller value counts as exact, and is shown as such.
    let accuracy = Some(accuracy).filter(|px| px >= LENS_ACCURACY_PX.start());
    if now != before || accuracy != accuracy_px {
        let known = CameraInput { fixed: true, accuracy_px: accuracy, intrinsics: Some(now), model: now.distortion };
        outbox.send(session::Command::SetCamera(Some(known)));
    }
    if let Err(error) = now.validate() {
        form::note_ui(
            ui,
            Tone::Bad,
            tr!(language, "These intrinsics cannot be"),
            &Text::from(error).in_language(language),
        );
    }
}

fn lens_ui(ui: &mut Ui, camera: &mut Intrinsics, language: Language) {
    let choices = [
        (Distortion::None.name(), tr!(language, "None"), ""),
        ("brown_conrady", "Brown-Conrady", "k1 k2 p1 p2 k3"),
        ("rational", tr!(language, "Rational"), "k1 k2 p1 p2 k3 k4 k5 k6"),
        ("fisheye", tr!(language, "Fisheye"), "k1 k2 k3 k4"),
    ];
    ui.label(egui::RichText::new(tr!(language, "Lens model")).color(Palette::of(ui).weak));
    let chosen = form::choice_ui(ui, camera.distortion.name(), &choices);
    if let Some(model) = chosen.and_then(Distortion::from_name) {
        camera.distortion = model;
    }
    let names: &[&str] = match camera.distortion {
        Distortion::Fisheye(_) => &["k1", "k2", "k3", "k4"],
        _ => &["k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6"],
    };
    let mut coefficients = camera.distortion.coefficients().to_vec();
    ui.horizontal_wrapped(|ui| {
        for (value, name) in coefficients.iter_mut().zip(names) {
            let value = DragValue::new(value).speed(0.0005).max_decimals(8).prefix(format!("{name} "));
            number_ui(ui, name, value);
        }
    });
    camera.distortion = camera.distortion.with_coefficients(&coefficients);
}

/// Where entering intrinsics starts: what the cell reports about its camera, or else a lens of 57° for the present
/// image.
fn start(model: &Model) -> Intrinsics {
    if let Some(nominal) = model.cell.as_ref().and_then(|cell| cell.nominal_intrinsics) {
        return nominal;
    }
    let (width, height) = model.frame.as_ref().map_or((640, 480), |frame| frame.images.rgb.dimensions());
    Intrinsics::from_view_angle(width, height, 57.0_f64.to_radians())
}
