//! The bar at the top: what this is, what it is connected to, the session, undo and redo, the menu, and STOP.

use egui::{Align, Button, Label, Layout, RichText, Sense, Stroke, Ui, Vec2, WidgetInfo, WidgetType};

use super::menu;
use crate::rerun_button::rerun_button_ui;
use crate::status::{self, STALE_AFTER_S, Status};
use crate::stop_button::{Face, stop_button_ui};
use crate::style::icons::{self, Icon};
use crate::style::theme::{self, Palette};
use handeye_wording::text;
use handeye_workbench::command::{Command, Outbox};
use handeye_workbench::model::Model;
use handeye_workbench::session::facts::SessionFacts;
use handeye_workbench::session::facts::of;
use handeye_workbench::text::{Language, Text};
use handeye_workbench::tr;
use handeye_workbench::{motion, session};

/// Height of the buttons.
const HEIGHT: f32 = 30.0;

pub fn top_bar_ui(ui: &mut Ui, model: &Model, outbox: &mut Outbox) {
    let palette = Palette::of(ui);
    let language = model.view.language;
    let session = of(model);
    ui.horizontal(|ui| {
        ui.set_min_height(HEIGHT);
        ui.label(theme::title("Handeye", 17.0).color(palette.text));
        divider_ui(ui);
        // From the right, so that the buttons keep their place and the text in between gives way.
        ui.with_layout(Layout::right_to_left(Align::Center), |ui| {
            stop_ui(ui, model, outbox);
            ui.add_space(4.0);
            menu::menu_ui(ui, model, outbox);
            ui.spacing_mut().item_spacing.x = 4.0;
            let redo = (tr!(language, "Redo"), session.redo.as_ref(), Command::Session(session::Command::Redo));
            history_ui(ui, Icon::Redo, redo, language, outbox);
            let undo = (tr!(language, "Undo"), session.undo.as_ref(), Command::Session(session::Command::Undo));
            history_ui(ui, Icon::Undo, undo, language, outbox);
            rerun_button_ui(ui, &model.rerun, language, outbox);
            ui.spacing_mut().item_spacing.x = 8.0;
            ui.with_layout(Layout::left_to_right(Align::Center), |ui| {
                connection_ui(ui, &status::connection(model), language);
                frame_rate_ui(ui, model);
                divider_ui(ui);
                session_ui(ui, &session, language);
            });
        });
    });
}

fn divider_ui(ui: &mut Ui) {
    ui.add_space(4.0);
    let (rect, _) = ui.allocate_exact_size(Vec2::new(1.0, 18.0), Sense::hover());
    ui.painter().vline(rect.center().x, rect.y_range(), Stroke::new(1.0, Palette::of(ui).edge));
    ui.add_space(4.0);
}

fn connection_ui(ui: &mut Ui, status: &Status, language: Language) {
    let palette = Palette::of(ui);
    let (rect, _) = ui.allocate_exact_size(Vec2::splat(12.0), Sense::hover());
    let colour = palette.tone(status.tone);
    ui.painter().circle_filled(rect.center(), 6.0, colour.gamma_multiply(0.25));
    ui.painter().circle_filled(rect.center(), 4.0, colour);
    // The widgets to the right of it keep their room.
    let room = (ui.available_width() - 230.0).max(60.0);
    ui.scope(|ui| {
        ui.set_max_width(room);
        ui.add(Label::new(status.title.in_language(language)).truncate().sense(Sense::hover()))
            .on_hover_text(status.detail.in_language(language));
    });
}

fn frame_rate_ui(ui: &mut Ui, model: &Model) {
    let Some(frame) = &model.frame else { return };
    let palette = Palette::of(ui);
    let language = model.view.language;
    let text = match model.frame_age_s() {
        Some(age_s) if age_s > STALE_AFTER_S => tr!(language, "no new images").to_owned(),
        _ => text!("{rate} fps", rate = format!("{:.0}", frame.info.rate_hz)).in_language(language),
    };
    ui.label(RichText::new("·").color(palette.weak));
    let what = text!(
        "Images that arrive per second. The window draws the newest; {count} were replaced by a newer one before they were drawn",
        count = model.dropped_frames
    );
    ui.label(RichText::new(text).color(palette.weak)).on_hover_text(what.in_language(language));
}

fn session_ui(ui: &mut Ui, session: &SessionFacts, language: Language) {
    let palette = Palette::of(ui);
    let Some(name) = &session.name else {
        let hint = tr!(language, "A session keeps captures and results; it begins with the first capture");
        ui.add(Label::new(RichText::new(tr!(language, "No session")).color(palette.weak)).truncate())
            .on_hover_text(hint);
        return;
    };
    let saved = if session.saved { tr!(language, "saved") } else { tr!(language, "unsaved") };
    ui.label(RichText::new(saved).color(if session.saved { palette.weak } else { palette.warning }));
    ui.label(RichText::new("·").color(palette.weak));
    ui.add(Label::new(name).truncate());
}

/// A button with a sign instead of words.
pub fn icon_button_ui(ui: &mut Ui, icon: Icon, name: &str, enabled: bool) -> egui::Response {
    let palette = Palette::of(ui);
    let response = ui.add_enabled(enabled, Button::new("").min_size(theme::least(ui, 34.0, HEIGHT)).frame(false));
    let ink = match (enabled, response.hovered() || response.has_focus()) {
        (false, _) => palette.weak.gamma_multiply(0.45),
        (true, true) => palette.text,
        (true, false) => palette.text.gamma_multiply(0.8),
    };
    if enabled && (response.hovered() || response.has_focus()) {
        ui.painter().rect_filled(response.rect, 6.0, palette.card.lerp_to_gamma(palette.text, 0.08));
    }
    icons::draw(ui.painter(), icon, response.rect, 15.0, ink);
    response.widget_info(|| WidgetInfo::labeled(WidgetType::Button, enabled, name));
    response
}

/// Undo or redo: its name, the step that it would take, and the command.
fn history_ui(
    ui: &mut Ui,
    icon: Icon,
    (name, step, command): (&str, Option<&Text>, Command),
    language: Language,
    outbox: &mut Outbox,
) {
    let response = icon_button_ui(ui, icon, name, step.is_some());
    let hint = match step {
        Some(step) => text!("{what}: {step}", what = name, step = step.in_language(language)).in_language(language),
        None => text!("{what}: nothing", what = name).in_language(language),
    };
    if response.on_hover_text(&hint).on_disabled_hover_text(&hint).clicked() {
        outbox.send(command);
    }
}

fn stop_ui(ui: &mut Ui, model: &Model, outbox: &mut Outbox) {
    let face = Face::of(ui, model, tr!(model.view.language, "STOP"));
    // All its texts have room in it, so that it keeps its place.
    let letters = if face.can_act { 13.5 } else { 11.0 };
    let button = Button::new(theme::title(face.words, letters).color(face.ink))
        .fill(face.fill)
        .stroke(Stroke::NONE)
        .min_size(Vec2::new(104.0, HEIGHT));
    if stop_button_ui(ui, button).on_hover_text(face.hint).clicked() {
        outbox.send(motion::Command::Stop);
    }
}
