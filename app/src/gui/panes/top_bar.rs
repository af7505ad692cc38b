//! The bar at the top: what this is, what it is connected to, the theme, and STOP.

use egui::{Align, Button, Label, Layout, RichText, Sense, Stroke, Ui, Vec2, WidgetInfo, WidgetType};

use crate::command::{Command, Outbox};
use crate::gui::status::{self, STALE_AFTER_S, Status};
use crate::gui::theme::{Palette, Tone};
use crate::model::{Model, ThemeChoice};

/// The bar.
pub fn top_bar_ui(ui: &mut Ui, model: &Model, outbox: &mut Outbox) {
    let palette = Palette::of(ui);
    ui.horizontal(|ui| {
        ui.set_min_height(30.0);
        ui.label(RichText::new("Handeye").heading().color(palette.text));
        ui.add_space(6.0);
        ui.separator();
        ui.add_space(6.0);
        // From the right, so that the buttons keep their place and the text in between gives way.
        ui.with_layout(Layout::right_to_left(Align::Center), |ui| {
            stop_ui(ui, model, outbox);
            theme_switch_ui(ui, model.view.theme, outbox);
            ui.with_layout(Layout::left_to_right(Align::Center), |ui| {
                connection_ui(ui, &status::connection(model));
                frame_rate_ui(ui, model);
            });
        });
    });
}

fn connection_ui(ui: &mut Ui, status: &Status) {
    let palette = Palette::of(ui);
    let (rect, _) = ui.allocate_exact_size(Vec2::splat(12.0), Sense::hover());
    let colour = palette.tone(status.tone);
    ui.painter().circle_filled(rect.center(), 6.0, colour.gamma_multiply(0.25));
    ui.painter().circle_filled(rect.center(), 4.0, colour);
    ui.add(Label::new(&status.title).truncate().sense(Sense::hover())).on_hover_text(&status.detail);
}

fn frame_rate_ui(ui: &mut Ui, model: &Model) {
    let Some(frame) = &model.frame else { return };
    let palette = Palette::of(ui);
    let text = match model.frame_age_s() {
        Some(age_s) if age_s > STALE_AFTER_S => "no new pictures".to_owned(),
        _ => format!("{:.0} fps", frame.info.rate_hz),
    };
    ui.label(RichText::new("·").color(palette.weak));
    ui.label(RichText::new(text).color(palette.weak)).on_hover_text("Pictures that arrive per second");
}

fn stop_ui(ui: &mut Ui, model: &Model, outbox: &mut Outbox) {
    let palette = Palette::of(ui);
    let text = if model.stop_pending { "STOPPING…" } else { "STOP" };
    let button = Button::new(RichText::new(text).color(palette.on_bad).strong())
        .fill(palette.tone(Tone::Bad))
        .stroke(Stroke::NONE)
        .min_size(Vec2::new(96.0, 30.0));
    if ui.add(button).on_hover_text("Have the arm stay where it is. No substitute for an emergency stop").clicked() {
        outbox.send(Command::Stop);
    }
}

fn theme_switch_ui(ui: &mut Ui, theme: ThemeChoice, outbox: &mut Outbox) {
    let (sign, name) = match theme {
        ThemeChoice::Dark => ("☀", "Light theme"),
        ThemeChoice::Light => ("🌙", "Dark theme"),
    };
    let response = ui.add(Button::new(sign).min_size(Vec2::new(34.0, 30.0))).on_hover_text(name);
    response.widget_info(|| WidgetInfo::labeled(WidgetType::Button, true, name));
    if response.clicked() {
        outbox.send(Command::SetTheme(theme.other()));
    }
}
