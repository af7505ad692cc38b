//! The steps at the left: what is done, what comes next, and what is missing.

use egui::{Align2, Color32, CornerRadius, FontId, Rect, Sense, Stroke, Ui, Vec2, WidgetInfo, WidgetType};

use crate::steps::{self, StepState, StepStatus};
use crate::style::fonts;
use crate::style::icons::{self, Icon};
use crate::style::theme::{CAPTION, CARD_RADIUS, Palette};
use handeye_workbench::command::Outbox;
use handeye_workbench::model::Model;
use handeye_workbench::shell;
use handeye_workbench::text::Language;
use handeye_workbench::tr;

/// Width of the rail.
pub const WIDTH: f32 = 190.0;
/// Height of a step.
const ROW: f32 = 54.0;
/// Diameter of the number of a step.
const BADGE: f32 = 24.0;
/// Distance between the steps.
const BETWEEN: f32 = 2.0;

pub fn rail_ui(ui: &mut Ui, model: &Model, outbox: &mut Outbox) {
    let language = model.view.language;
    let steps = steps::steps(model);
    let next = steps::next(&steps);
    ui.spacing_mut().item_spacing.y = BETWEEN;
    for (index, status) in steps.iter().enumerate() {
        let is_next = next == Some(status.step);
        if step_ui(ui, index, status, is_next, language) {
            outbox.send(shell::Command::GoToStep(status.step));
        }
    }
}

/// One step; whether it was clicked.
fn step_ui(ui: &mut Ui, index: usize, status: &StepStatus, is_next: bool, language: Language) -> bool {
    let palette = Palette::of(ui);
    let (rect, response) = ui.allocate_exact_size(Vec2::new(ui.available_width(), ROW), Sense::click());
    let name = crate::shell::step_name(status.step, language);
    let line = status.line.in_language(language);
    response.widget_info(|| {
        let label = format!("{} {name}: {} ({line})", index + 1, state_name(status.state, language));
        WidgetInfo::labeled(WidgetType::Button, true, label)
    });
    let badge = Rect::from_center_size(rect.left_center() + Vec2::new(10.0 + BADGE / 2.0, 0.0), Vec2::splat(BADGE));
    let painter = ui.painter();
    if index > 0 {
        let top = badge.center_top();
        let line = [top - Vec2::new(0.0, ROW - BADGE + BETWEEN - 4.0), top - Vec2::new(0.0, 4.0)];
        painter.line_segment(line, Stroke::new(1.5, palette.edge));
    }
    let fill = match (is_next, response.hovered() || response.has_focus()) {
        (true, _) => palette.card.lerp_to_gamma(palette.accent, 0.14),
        (false, true) => palette.raised(),
        (false, false) => Color32::TRANSPARENT,
    };
    painter.rect_filled(rect.shrink2(Vec2::new(0.0, 3.0)), CornerRadius::same(CARD_RADIUS), fill);
    badge_ui(ui, badge, index, status.state, is_next);
    let name_colour = if status.state == StepState::Blocked { palette.weak } else { palette.text };
    let left = badge.right() + 12.0;
    let text_width = rect.right() - left - 6.0;
    let painter = ui.painter().with_clip_rect(Rect::from_x_y_ranges(left..=left + text_width, rect.y_range()));
    let title = FontId::new(13.5, fonts::semibold());
    let middle = rect.center().y;
    painter.text(egui::pos2(left, middle - 1.0), Align2::LEFT_BOTTOM, name, title, name_colour);
    let line_colour = if is_next { palette.accent } else { palette.weak };
    let small = FontId::proportional(CAPTION);
    painter.text(egui::pos2(left, middle + 2.0), Align2::LEFT_TOP, &line, small, line_colour);
    let clicked = response.clicked();
    response.on_hover_text(line);
    clicked
}

fn badge_ui(ui: &Ui, badge: Rect, index: usize, state: StepState, is_next: bool) {
    let palette = Palette::of(ui);
    let painter = ui.painter();
    let (centre, radius) = (badge.center(), BADGE / 2.0);
    let (fill, edge, text) = match (state, is_next) {
        (StepState::Done, _) => (palette.good.gamma_multiply(0.18), palette.good.gamma_multiply(0.55), palette.good),
        (_, true) => (palette.accent, palette.accent, palette.on_accent),
        (StepState::Now, false) => (Color32::TRANSPARENT, palette.text.gamma_multiply(0.6), palette.text),
        (StepState::Blocked, false) => (Color32::TRANSPARENT, palette.edge, palette.weak),
    };
    painter.circle(centre, radius - 0.5, fill, Stroke::new(1.0, edge));
    if state == StepState::Done {
        icons::draw(painter, Icon::Check, badge, 13.0, text);
    } else {
        let font = FontId::new(12.0, fonts::semibold());
        painter.text(centre, Align2::CENTER_CENTER, index + 1, font, text);
    }
}

/// For screen readers.
fn state_name(state: StepState, language: Language) -> &'static str {
    match state {
        StepState::Done => tr!(language, "done"),
        StepState::Now => tr!(language, "can be done"),
        StepState::Blocked => tr!(language, "blocked"),
    }
}
