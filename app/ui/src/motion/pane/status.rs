//! What the arm does now, why it did not do what was requested, and where its tip is.

use egui::{Align, Button, Layout, RichText, Ui};

use crate::status::robot_age;
use crate::stop_button::{Face, stop_button_ui};
use crate::style::numbers;
use crate::style::parts::{self, Sign};
use crate::style::theme::{Palette, Tone};
use handeye_wording::text;
use handeye_workbench::command::Outbox;
use handeye_workbench::model::{Model, Motion, Pane, RotationFormat, Severity};
use handeye_workbench::motion::correction::{real_tip, real_tip_error_95_m};
use handeye_workbench::tr;
use handeye_workbench::{messages, motion};

/// The motion with a button that ends it.
pub fn status_ui(ui: &mut Ui, model: &Model, outbox: &mut Outbox) {
    let language = model.view.language;
    let palette = Palette::of(ui);
    let (colour, what) = match &model.motion {
        _ if model.stop_pending && !model.control.is_connected() => {
            (palette.weak, tr!(language, "The arm is stopped once the connection is back").to_owned())
        }
        _ if model.stop_pending => (palette.warning, tr!(language, "Stopping").to_owned()),
        _ if let Some(age) = robot_age(model) => {
            (palette.weak, text!("Not known whether the arm moves: {age}", age = age).in_language(language))
        }
        Motion::Idle => (palette.good, tr!(language, "The arm is at rest").to_owned()),
        Motion::Moving { what, since_s, .. } => {
            let seconds = format!("{:.0}", (model.now_s - since_s).max(0.0));
            (
                palette.busy,
                text!("Moving: {what} ({seconds} s)", what = what.clone(), seconds = seconds).in_language(language),
            )
        }
        Motion::Jogging(_) => (palette.busy, tr!(language, "Jogging").to_owned()),
    };
    ui.horizontal(|ui| {
        parts::dot_ui(ui, colour);
        ui.with_layout(Layout::right_to_left(Align::Center), |ui| {
            let face = Face::of(ui, model, tr!(language, "Stop"));
            let stop = Button::new(RichText::new(face.words).color(face.ink)).fill(face.fill);
            if stop_button_ui(ui, stop).on_hover_text(face.hint).clicked() {
                outbox.send(motion::Command::Stop);
            }
            ui.with_layout(Layout::left_to_right(Align::Center), |ui| {
                ui.add(egui::Label::new(RichText::new(what).color(palette.text)).truncate());
            });
        });
    });
}

/// Why the arm did not do what was requested last.
pub fn refusal_ui(ui: &mut Ui, model: &Model, outbox: &mut Outbox) {
    let language = model.view.language;
    let Some(message) = model.messages.shown_in(Pane::Jog) else { return };
    let tone = if message.severity == Severity::Error { Tone::Bad } else { Tone::Warning };
    let reported = message.text.in_language(language);
    let close = tr!(language, "Dismiss the message");
    ui.horizontal_top(|ui| {
        let width = ui.available_width() - 32.0;
        ui.allocate_ui(egui::vec2(width, 0.0), |ui| parts::notice_ui(ui, tone, &reported, |_| ()));
        if parts::sign_ui(ui, Sign::Cross, close, true).clicked() {
            outbox.send(messages::Command::Dismiss(message.number));
        }
    });
}

/// The tip in the base.
pub fn tip_ui(ui: &mut Ui, model: &Model) {
    let language = model.view.language;
    let Some(robot) = &model.robot else { return };
    let pose = &robot.base_from_tip;
    let (mut title, mut colour) = (tr!(language, "Tip in base").to_owned(), Palette::of(ui).text);
    if let Some(age) = robot_age(model) {
        title = format!("{title} · {}", age.in_language(language));
        colour = Palette::of(ui).weak;
    }
    parts::section_with_ui(ui, &title, |ui| {
        parts::copy_ui(ui, language, tr!(language, "the tip pose"), || {
            let [x, y, z]: [f64; 3] = pose.translation().into();
            let [qx, qy, qz, qw] = pose.xyzw();
            format!("base_from_tip: translation_m = [{x}, {y}, {z}], rotation_xyzw = [{qx}, {qy}, {qz}, {qw}]")
        });
    });
    parts::stated_in_ui(ui, "x y z [mm]", &numbers::translation_mm(pose), colour);
    if let Some((real, within_m)) = real_tip(model).zip(real_tip_error_95_m(model)) {
        parts::stated_in_ui(ui, tr!(language, "really [mm]"), &numbers::translation_mm(&real), colour);
        let within = text!(
            "By the errors of the arm that the calibration found; within {mm} mm of that in 95 of 100 cases",
            mm = format!("{:.2}", within_m * 1e3)
        );
        parts::hint_ui(ui, &within.in_language(language));
    }
    match model.view.rotation {
        RotationFormat::RollPitchYaw => {
            parts::stated_in_ui(ui, tr!(language, "roll pitch yaw [°]"), &numbers::rpy_deg(pose), colour)
        }
        RotationFormat::Quaternion => {
            parts::stated_in_ui(ui, tr!(language, "quaternion x y z w"), &numbers::quaternion(pose), colour)
        }
    };
}
