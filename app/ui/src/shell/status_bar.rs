//! The bar at the bottom: the robot in numbers, the age of the images, what is under way.

use egui::{Button, Label, RichText, Sense, Ui};

use handeye_arm::{JointKind, MAX_JOINTS};

use crate::shell::capturing::waiting;
use crate::status::{STALE_AFTER_S, robot_age};
use crate::style::numbers;
use crate::style::theme::{self, CAPTION, Palette};
use handeye_wording::text;
use handeye_workbench::command::Outbox;
use handeye_workbench::model::{CellSource, FollowStatus, Model, Motion, RobotState, RotationFormat, Severity};
use handeye_workbench::shell;
use handeye_workbench::text::Text;
use handeye_workbench::tr;

/// Shown where a number is not known.
const UNKNOWN: &str = "–";
/// Height of a caption and its value.
const LINES: f32 = 34.0;
/// As wide as a joint value gets.
const WIDEST_ANGLE: &str = "−888.8";

/// For this long \[s\] a success counts as news.
const FRESH_S: f64 = 30.0;

pub fn status_bar_ui(ui: &mut Ui, model: &Model, outbox: &mut Outbox) {
    let palette = Palette::of(ui);
    // What is on the screen after a loss of connection is outdated, and looks like it.
    let language = model.view.language;
    let robot_age = robot_age(model);
    let live = robot_age.is_none();
    let robot = model.robot.as_ref();
    ui.spacing_mut().item_spacing.x = 18.0;
    ui.horizontal(|ui| {
        let colour = if live { palette.text } else { palette.weak };
        let text = |number: fn(&RobotState) -> String| robot.map_or_else(|| UNKNOWN.to_owned(), number);
        field_ui(
            ui,
            tr!(language, "Tip in base, x y z [mm]"),
            &text(|robot| numbers::translation_mm(&robot.base_from_tip)),
            "−888.8  −888.8  −888.8",
            colour,
        );
        rotation_ui(ui, model, colour, outbox);
        field_ui(
            ui,
            &joints_caption(model).in_language(language),
            &robot.map_or_else(|| UNKNOWN.to_owned(), |robot| joints_shown(model, robot)),
            &[WIDEST_ANGLE; MAX_JOINTS][..joint_count(model)].join("  "),
            colour,
        );
        field_ui(
            ui,
            if matches!(model.source, CellSource::Drivers(_)) {
                tr!(language, "Time")
            } else {
                tr!(language, "Simulation")
            },
            &text(|robot| format!("{:.2} s", robot.sim_time_s)),
            "8888.88 s",
            colour,
        );
        let stale = model.frame_age_s().is_some_and(|age_s| age_s > STALE_AFTER_S);
        let age = model.frame_age_s().map_or_else(|| UNKNOWN.to_owned(), age_text);
        field_ui(ui, tr!(language, "Image age"), &age, "88.8 s", if stale { palette.warning } else { palette.text });
        if let Some(age) = robot_age.filter(|_| robot.is_some()) {
            field_ui(ui, tr!(language, "Robot"), &age.in_language(language), "", palette.warning);
        }
    });
    ui.add_space(2.0);
    message_ui(ui, model);
}

/// A caption over a value with room for `sample`, read together by a screen reader.
fn field_ui(ui: &mut Ui, caption: &str, value: &str, sample: &str, colour: egui::Color32) -> egui::Response {
    let weak = Palette::of(ui).weak;
    let font = egui::TextStyle::Body.resolve(ui.style());
    let room = ui.painter().layout_no_wrap(sample.to_owned(), font, colour).size().x;
    ui.vertical(|ui| {
        ui.spacing_mut().item_spacing.y = 1.0;
        // Nothing shifts sideways when a number grows or is not known.
        ui.set_min_width(room);
        ui.label(RichText::new(caption).size(CAPTION).color(weak));
        let label = ui.add(Label::new(RichText::new(value).color(colour)).extend().sense(Sense::hover()));
        label.widget_info(|| {
            let spoken = value.split_whitespace().collect::<Vec<_>>().join(" ");
            egui::WidgetInfo::labeled(egui::WidgetType::Label, true, format!("{caption}: {spoken}"))
        });
    })
    .response
}

fn rotation_ui(ui: &mut Ui, model: &Model, colour: egui::Color32, outbox: &mut Outbox) {
    let language = model.view.language;
    let (caption, sample, next, name) = match model.view.rotation {
        RotationFormat::RollPitchYaw => (
            tr!(language, "Tip in base, roll pitch yaw [deg]"),
            "−888.88  −888.88  −888.88",
            RotationFormat::Quaternion,
            tr!(language, "quat"),
        ),
        RotationFormat::Quaternion => (
            tr!(language, "Tip in base, quaternion x y z w"),
            "−8.8888  −8.8888  −8.8888  −8.8888",
            RotationFormat::RollPitchYaw,
            tr!(language, "rpy"),
        ),
    };
    let value = model.robot.as_ref().map_or_else(
        || UNKNOWN.to_owned(),
        |robot| match model.view.rotation {
            RotationFormat::RollPitchYaw => numbers::rpy_deg(&robot.base_from_tip),
            RotationFormat::Quaternion => numbers::quaternion(&robot.base_from_tip),
        },
    );
    ui.horizontal_top(|ui| {
        ui.spacing_mut().item_spacing.x = 6.0;
        field_ui(ui, caption, &value, sample, colour);
        let button = ui
            .vertical(|ui| {
                let size = theme::least(ui, 34.0, 22.0);
                // In the middle of the two lines of text.
                ui.add_space((LINES - size.y).max(0.0) / 2.0);
                ui.add(Button::new(RichText::new(name).size(CAPTION)).min_size(size).small())
            })
            .inner
            .on_hover_text(match next {
                RotationFormat::Quaternion => tr!(language, "Write the rotation as a quaternion"),
                RotationFormat::RollPitchYaw => tr!(language, "Write the rotation as roll, pitch and yaw"),
            });
        if button.clicked() {
            outbox.send(shell::Command::SetRotationFormat(next));
        }
    });
}

/// What is under way, or else the last recent success. The log has all of it.
fn message_ui(ui: &mut Ui, model: &Model) {
    let palette = Palette::of(ui);
    let language = model.view.language;
    let (colour, reported) = if let Some(text) = under_way(model) {
        (palette.busy, text.in_language(language))
    } else {
        let fresh = model.messages.status_line().filter(|message| model.now_s - message.at_s < FRESH_S);
        (palette.severity(Severity::Info), fresh.map(|message| message.text.in_language(language)).unwrap_or_default())
    };
    ui.add(Label::new(RichText::new(reported).color(colour)).truncate());
}

/// What the program does now; user requests come before their consequences.
fn under_way(model: &Model) -> Option<Text> {
    if model.planning {
        return Some(text!("Planning poses that are not in the fit…"));
    }
    if let (true, Some(sequence)) = (model.sequence_runs, &model.sequence) {
        if let Some(guided) = &sequence.guided {
            return Some(crate::guided::section::under_way(model, sequence, guided));
        }
        let (number, of) = (sequence.outcomes.len() + 1, sequence.names.len());
        return sequence.current().map(|name| text!("Pose {n} of {of}: {name}", n = number, of = of, name = name));
    }
    if let Some(capture) = &model.capture {
        return Some(waiting(capture));
    }
    if model.export.writing {
        return Some(text!("Files are being written"));
    }
    if model.opening {
        return Some(text!("The session is being opened…"));
    }
    if model.solve.is_running() {
        return Some(text!("Solving…"));
    }
    match (&model.motion, &model.track.follow) {
        (_, FollowStatus::MakingRoom) => Some(text!("Moving to where the arm has room to follow…")),
        (_, FollowStatus::Waiting) => Some(text!("The arm waits until the board is seen again")),
        (_, FollowStatus::Following { .. }) => Some(text!("The arm follows the board")),
        (Motion::Moving { what, since_s, .. }, _) => {
            let seconds = format!("{:.0}", (model.now_s - since_s).max(0.0));
            Some(text!("Moving: {what} ({seconds} s)", what = what.clone(), seconds = seconds))
        }
        (Motion::Jogging(_), _) => Some(text!("Jogging")),
        (Motion::Idle, _) => None,
    }
}

/// The joint count of the arm, or of a typical one as long as there is none.
fn joint_count(model: &Model) -> usize {
    model.robot.as_ref().map_or(6, |robot| robot.joints_rad.len())
}

fn joints_caption(model: &Model) -> Text {
    let count = joint_count(model);
    let shifts = |i: &usize| model.joint_kind(*i) == JointKind::Prismatic;
    let rails: Vec<String> = (0..count).filter(shifts).map(|i| format!("J{}", i + 1)).collect();
    if rails.is_empty() {
        return text!("Joints 1 to {count} [deg]", count = count);
    }
    text!("Joints 1 to {count} [deg; {rails} mm]", count = count, rails = rails.join(" "))
}

fn joints_shown(model: &Model, robot: &RobotState) -> String {
    let shown = |(i, &value): (usize, &f64)| value * model.joint_kind(i).shown_per_si();
    numbers::row(&robot.joints_rad.iter().enumerate().map(shown).collect::<Vec<_>>(), 1, 6)
}

/// With tenths only while it is small, so that it does not flicker.
fn age_text(age_s: f64) -> String {
    if age_s < 60.0 { format!("{age_s:.1} s") } else { format!("{:.0} min", age_s / 60.0) }
}
