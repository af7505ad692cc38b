//! How the tip is jogged: which axes, how far, how fast.

use egui::{Button, RichText, Slider, Ui, WidgetInfo, WidgetType};
use handeye_coppeliasim::cell::{JOG_JOINT_SPEED_RAD_S, JOG_LINE_SPEED_M_S, JOG_TURN_SPEED_RAD_S};

use crate::style::parts;
use crate::style::theme::{self, Palette};
use handeye_link::limits;
use handeye_wording::text;
use handeye_workbench::command::Outbox;
use handeye_workbench::model::{JogFrame, JogSettings, JogStep, Model, Moves};
use handeye_workbench::motion;
use handeye_workbench::text::{Language, Text};
use handeye_workbench::tr;

/// Steps in millimetres, and in degrees for rotations: 50° at once would be a surprise.
const STEPS: [(f64, f64); 5] = [(0.1, 0.1), (1.0, 1.0), (5.0, 5.0), (10.0, 10.0), (50.0, 30.0)];

/// The three rows.
pub fn settings_ui(ui: &mut Ui, model: &Model, outbox: &mut Outbox) {
    let language = model.view.language;
    let settings = model.view.jog;
    frame_ui(ui, settings, language, outbox);
    step_ui(ui, model, outbox);
    speed_ui(ui, model, outbox);
}

/// A frame in words.
pub fn frame_name(frame: JogFrame, language: Language) -> &'static str {
    match frame {
        JogFrame::Base => tr!(language, "Base"),
        JogFrame::Tip => tr!(language, "Tip"),
        JogFrame::Camera => tr!(language, "Camera"),
    }
}

fn frame_ui(ui: &mut Ui, settings: JogSettings, language: Language, outbox: &mut Outbox) {
    parts::row_ui(ui, tr!(language, "Along the axes of"), |ui| {
        ui.spacing_mut().item_spacing.x = 2.0;
        for (frame, what) in [
            (JogFrame::Base, tr!(language, "The axes of the robot's base")),
            (JogFrame::Tip, tr!(language, "The axes of the tip, as it is now")),
            (JogFrame::Camera, tr!(language, "The axes of the camera: x right, y down, z forward; turns are about it")),
        ] {
            let chosen = settings.frame == frame;
            let response = ui.selectable_label(chosen, frame_name(frame, language)).on_hover_text(what);
            if response.clicked() && !chosen {
                outbox.send(motion::Command::SetJog(JogSettings { frame, ..settings }));
            }
        }
    });
}

fn step_ui(ui: &mut Ui, model: &Model, outbox: &mut Outbox) {
    let (settings, language) = (model.view.jog, model.view.language);
    let can_be_held = model.moves() == Moves::Freely;
    parts::row_ui(ui, tr!(language, "Step [mm, °]"), |ui| {
        ui.spacing_mut().item_spacing.x = 2.0;
        ui.spacing_mut().button_padding.x = 7.0;
        let hold =
            (JogStep::Hold, tr!(language, "Hold").to_owned(), tr!(language, "Moves as long as it is held").to_owned());
        let steps = STEPS.map(|(mm, deg)| {
            let step = JogStep::Step { metres: mm * 1e-3, radians: deg.to_radians() };
            (step, format!("{mm}"), text!("Step {mm} mm, {deg}°", mm = mm, deg = deg).in_language(language))
        });
        for (step, name, what) in Some(hold).filter(|_| can_be_held).into_iter().chain(steps) {
            let chosen = model.jog_step() == step;
            let response = ui.add(Button::selectable(chosen, &name).min_size(theme::least(ui, 0.0, 0.0)));
            let label = if step == JogStep::Hold { &name } else { &what };
            response.widget_info(|| WidgetInfo::selected(WidgetType::Button, true, chosen, label));
            if response.on_hover_text(&what).clicked() && !chosen {
                outbox.send(motion::Command::SetJog(JogSettings { step, ..settings }));
            }
        }
    });
}

fn speed_ui(ui: &mut Ui, model: &Model, outbox: &mut Outbox) {
    let (language, settings) = (model.view.language, model.view.jog);
    parts::row_ui(ui, tr!(language, "Speed"), |ui| {
        let mut percent = model.speed() * 100.0;
        ui.spacing_mut().slider_width = 90.0;
        let slider = Slider::new(&mut percent, 1.0..=100.0).step_by(1.0).show_value(false);
        let response = ui.add(slider);
        response.widget_info(|| WidgetInfo::slider(true, percent, tr!(language, "Speed in percent")));
        if response.changed() {
            outbox.send(motion::Command::SetJog(JogSettings { speed: Some(percent / 100.0), ..settings }));
        }
        let (reported, more) = speed_text(model.moves(), percent / 100.0);
        let colour = Palette::of(ui).text;
        ui.label(RichText::new(reported.in_language(language)).color(colour)).on_hover_text(more.in_language(language));
    });
}

/// The speed as far as it is known, and what that means. A controller behind a driver is given a share of its own highest speed,
/// which is not known; a speed of the tip applies only to jogging along a line.
fn speed_text(moves: Moves, share: f64) -> (Text, Text) {
    let percent = format!("{:.0}", share * 100.0);
    if matches!(moves, Moves::OnceArmed { .. }) {
        return (
            text!("{percent} % of the robot's highest", percent = percent),
            text!(
                "The robot's controller plans the speed: how fast tip and joints go is not known here. Set limits on the controller"
            ),
        );
    }
    let line = format!("{:.0}", JOG_LINE_SPEED_M_S * 1e3 * share);
    let more = text!(
        "Jogging: at most {line} mm/s along a line, {turn}°/s about an axis, {joint}°/s for a joint. Moves to a pose or to joint \
         values: up to {pose}°/s for a joint, which takes the tip along faster",
        line = &line,
        turn = format!("{:.1}", JOG_TURN_SPEED_RAD_S.to_degrees() * share),
        joint = format!("{:.1}", JOG_JOINT_SPEED_RAD_S.to_degrees() * share),
        pose = format!("{:.0}", limits::SEQUENCE.joint_velocity.to_degrees() * share)
    );
    (text!("{percent} % · line {line} mm/s", percent = percent, line = line), more)
}
