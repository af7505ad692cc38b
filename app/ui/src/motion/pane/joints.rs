//! The joints: where each is, where it is commanded to, and buttons that jog it.

use egui::{Id, RichText, Shape, Slider, Stroke, Ui, WidgetInfo, WidgetType};
use handeye_arm::{JointKind, JointValues};

use super::blocked::Blocked;
use super::hold::{self, Hold};
use crate::style::numbers;
use crate::style::parts;
use crate::style::theme::{self, Palette};
use handeye_wording::text;
use handeye_workbench::command::Outbox;
use handeye_workbench::model::{Jog, Model, Motion, MotionGoal};
use handeye_workbench::motion;
use handeye_workbench::tr;

/// What a slider covers for a revolute joint without limits \[rad\], and for a prismatic one without limits \[m\].
const ENDLESS_RAD: [f64; 2] = [-std::f64::consts::TAU, std::f64::consts::TAU];
const ENDLESS_M: [f64; 2] = [-2.0, 2.0];
/// A goal is shown this long \[s\] without a motion towards it: by then it was refused.
const GOAL_SHOWN_S: f64 = 0.5;

/// Where the joints are commanded to, while they are moving.
#[derive(Debug, Clone, Copy)]
struct Goal {
    joints: JointValues,
    /// When it was sent; `None` while a slider is dragged.
    sent_s: Option<f64>,
}

fn id() -> Id {
    Id::new("goal of the joint sliders")
}

/// Limits of a joint in degrees, or in millimetres of a prismatic one.
pub fn shown_range(model: &Model, index: usize) -> [f64; 2] {
    let kind = model.joint_kind(index);
    let known = model.cell.as_ref().and_then(|cell| cell.joints.get(index)?.range);
    let range = known.unwrap_or(match kind {
        JointKind::Revolute => ENDLESS_RAD,
        JointKind::Prismatic => ENDLESS_M,
    });
    range.map(|end| end * kind.shown_per_si())
}

/// A row for each joint.
pub fn joints_ui(ui: &mut Ui, model: &Model, blocked: &Blocked, hold: &mut Hold, outbox: &mut Outbox) {
    let language = model.view.language;
    parts::section_ui(ui, tr!(language, "Joints"));
    let Some(robot) = &model.robot else {
        parts::hint_ui(ui, tr!(language, "Not read yet"));
        return;
    };
    let live = robot.joints_rad;
    let mut goal: Option<Goal> = parts::remembered(ui, id());
    if goal.is_some_and(|goal| is_over(model, &goal)) || blocked.arm.is_some() {
        goal = None;
    }
    ui.add_enabled_ui(blocked.arm.is_none(), |ui| {
        if !model.is_robot_live() {
            ui.visuals_mut().override_text_color = Some(Palette::of(ui).weak);
        }
        for index in 0..live.len() {
            row_ui(ui, model, index, &live, &mut goal, hold, outbox);
        }
    });
    parts::remember(ui, id(), goal);
}

fn is_over(model: &Model, goal: &Goal) -> bool {
    let Some(sent_s) = goal.sent_s else { return false };
    !matches!(model.motion, Motion::Moving { .. }) && model.now_s - sent_s > GOAL_SHOWN_S
}

fn row_ui(
    ui: &mut Ui,
    model: &Model,
    index: usize,
    live: &JointValues,
    goal: &mut Option<Goal>,
    hold: &mut Hold,
    outbox: &mut Outbox,
) {
    let language = model.view.language;
    let joint = index + 1;
    let palette = Palette::of(ui);
    ui.horizontal(|ui| {
        ui.spacing_mut().item_spacing.x = 5.0;
        ui.label(RichText::new(format!("J{joint}")).color(palette.weak));
        for (sign, forward) in [("−", false), ("+", true)] {
            let response =
                ui.add(hold::button(RichText::new(sign).strong()).min_size(theme::least(ui, 26.0, 24.0)).small());
            let name = text!("Jog joint {joint} {sign}", joint = joint, sign = sign).in_language(language);
            let enabled = ui.is_enabled();
            response.widget_info(|| WidgetInfo::labeled(WidgetType::Button, enabled, &name));
            hold.button(ui, &response, Jog::Joint { index, forward });
            response.on_hover_text(text!("{name}. Hold to move", name = &name).in_language(language));
        }
        let kind = model.joint_kind(index);
        let shown = |joints: &JointValues| joints[index] * kind.shown_per_si();
        let sent = goal.map(|goal| shown(&goal.joints));
        slider_ui(ui, model, index, live, goal, outbox);
        let here = shown(live);
        let reported = numbers::fixed(here, 1, 7);
        let caption = text!("Joint {joint} is at", joint = joint).in_language(language);
        parts::value_ui(ui, &caption, &format!("{reported}{}", kind.unit()), palette.text);
        // The goal, only if it differs.
        if let Some(goal) = sent.filter(|goal| (goal - here).abs() > 0.05) {
            let caption = text!("Joint {joint} goes to", joint = joint).in_language(language);
            let reported = format!("→{}{}", numbers::fixed(goal, 1, 6), kind.unit());
            parts::value_ui(ui, &caption, &reported, palette.accent);
        }
    });
}

fn slider_ui(
    ui: &mut Ui,
    model: &Model,
    index: usize,
    live: &JointValues,
    goal: &mut Option<Goal>,
    outbox: &mut Outbox,
) {
    let language = model.view.language;
    let kind = model.joint_kind(index);
    let [low, high] = shown_range(model, index);
    let here = live[index] * kind.shown_per_si();
    let mut chosen = goal.map_or(here, |goal| goal.joints[index] * kind.shown_per_si());
    // Room for both numbers, so that showing a goal does not shift the layout.
    ui.spacing_mut().slider_width = (ui.available_width() - 146.0).max(60.0);
    let slider = Slider::new(&mut chosen, low..=high).show_value(false).smart_aim(false);
    // The position of the arm may be outside its range, and must not be changed by being shown.
    let response = ui.add(slider.clamping(egui::SliderClamping::Edits));
    let name = match kind {
        JointKind::Revolute => text!("Goal of joint {joint} in degrees", joint = index + 1),
        JointKind::Prismatic => text!("Goal of joint {joint} in millimetres", joint = index + 1),
    };
    let name = name.in_language(language);
    let enabled = ui.is_enabled();
    response.widget_info(|| WidgetInfo::slider(enabled, chosen, &name));
    live_mark_ui(ui, response.rect, ((here - low) / (high - low)).clamp(0.0, 1.0) as f32);
    let is_sent = response.drag_stopped() || (response.changed() && !response.dragged());
    if response.changed() || response.dragged() || response.drag_stopped() {
        let mut joints = goal.map_or(*live, |goal| goal.joints);
        joints[index] = chosen.clamp(low, high) / kind.shown_per_si();
        *goal = Some(Goal { joints, sent_s: is_sent.then_some(model.now_s) });
        if is_sent {
            let place = format!("{:.1}", kind.quantity(joints[index]));
            let what = text!("joint {joint} at {place}", joint = index + 1, place = place);
            outbox.send(motion::Command::Move { goal: MotionGoal::Joints(joints), what });
        }
    }
    let limits = text!(
        "From {low} to {high}. Drag to choose, let go to move there; the mark is where the joint is",
        low = format!("{}{}", numbers::fixed(low, 0, 0), kind.unit()),
        high = format!("{}{}", numbers::fixed(high, 0, 0), kind.unit())
    );
    response.on_hover_text(limits.in_language(language));
}

/// A mark over the rail of a slider.
fn live_mark_ui(ui: &Ui, rect: egui::Rect, part: f32) {
    // As the slider places its handle.
    let rail = rect.x_range().shrink(rect.height() / 2.5);
    let tip = egui::pos2(rail.min + part * rail.span(), rect.center().y + 3.0);
    let palette = Palette::of(ui);
    let base = rect.bottom();
    let corners = vec![tip, egui::pos2(tip.x + 4.0, base), egui::pos2(tip.x - 4.0, base)];
    ui.painter().add(Shape::convex_polygon(corners, palette.good, Stroke::new(1.0, palette.card)));
}
