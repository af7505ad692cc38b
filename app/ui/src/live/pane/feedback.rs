//! What is shown over an image in words: how fresh it is, that it is recorded, how a capture goes.

use std::path::PathBuf;

use egui::{
    Align, Align2, Color32, CornerRadius, Id, Layout, Rect, RichText, Sense, Spinner, Stroke, StrokeKind, Ui,
    UiBuilder, Vec2, WidgetInfo, WidgetType,
};
use handeye_session::CaptureId;

use super::Shown;
use crate::capture::rows;
use crate::shell::capturing::{covers_image, waiting};
use crate::status::STALE_AFTER_S;
use crate::style::marks::{self, Marks};
use crate::style::parts;
use crate::style::theme::{CARD_RADIUS, Palette, Tone};
use handeye_wording::text;
use handeye_workbench::command::Outbox;
use handeye_workbench::model::Model;
use handeye_workbench::tr;
use handeye_workbench::{capture, session};

/// Height of the strip over a recorded image.
pub const STRIP: f32 = 34.0;
/// The flash of a capture \[s\].
const FLASH_S: f64 = 0.35;

/// Frame rate, age, zoom and exaggeration, in the corner of the image.
pub fn badges_ui(
    ui: &mut Ui,
    model: &Model,
    room: Rect,
    shown: &Shown<'_>,
    points_per_px: f32,
    exaggeration: Option<f64>,
) {
    let language = model.view.language;
    let mut lines: Vec<(String, Color32)> = Vec::new();
    if let (None, Some(frame)) = (shown.capture, &model.frame) {
        let age_s = model.frame_age_s().unwrap_or_default();
        let stale = age_s > STALE_AFTER_S;
        let rate = if stale { 0.0 } else { frame.info.rate_hz };
        let words = text!("{rate} fps · {age} s old", rate = format!("{rate:.0}"), age = format!("{age_s:.1}"));
        let colour = if stale { Marks::over_images().review } else { Color32::from_gray(215) };
        lines.push((words.in_language(language), colour));
        // An offset below the error that is good enough is no reason to wait.
        if frame.info.image_off_m > model.view.goal.0 {
            let ms = format!("{:.0}", frame.info.image_age_s * 1e3);
            let words = text!("Image up to {ms} ms older than the pose: let the arm stand", ms = ms);
            lines.push((words.in_language(language), Marks::over_images().review));
        }
    }
    if shown.capture.is_none() && model.detection.as_ref().is_some_and(|seen| seen.corners.is_none()) {
        lines.push((tr!(language, "Board not found").to_owned(), Marks::over_images().review));
    }
    if let Some(times) = exaggeration {
        let words = text!("Residuals × {times}", times = format!("{times:.0}"));
        lines.push((words.in_language(language), Marks::over_images().residual));
    }
    if model.viewport.zoom > 1.0 {
        lines.push((format!("{:.0} %", points_per_px * 100.0), Color32::from_gray(215)));
    }
    let mut at = room.min + Vec2::splat(8.0);
    for (number, (words, colour)) in lines.into_iter().enumerate() {
        let rect = marks::plate(ui.painter(), at, &words, colour);
        let response = ui.interact(rect, ui.id().with(("badge", number)), Sense::hover());
        response.widget_info(|| WidgetInfo::labeled(WidgetType::Label, true, &words));
        at.y = rect.bottom() + 4.0;
    }
}

/// The strip that shows that an image is recorded, and the way back.
pub fn review_ui(ui: &mut Ui, model: &Model, id: CaptureId, outbox: &mut Outbox) {
    let language = model.view.language;
    let colours = Marks::of(ui);
    let rect = ui.max_rect();
    ui.painter().rect_filled(rect, CornerRadius::ZERO, colours.review);
    let table = rows::table(ui.ctx(), model);
    let row = table.row(id);
    let name = row.map_or_else(|| id.to_string(), rows::CaptureRow::title);
    let title = text!("Capture {name}, recorded", name = name).in_language(language);
    let rms = row.and_then(|row| row.rms_px).map(|rms_px| {
        let rms = format!("{rms_px:.3}");
        if row.is_some_and(rows::CaptureRow::verifies) {
            text!("prediction error {rms} px", rms = rms).in_language(language)
        } else {
            text!("residual {rms} px", rms = rms).in_language(language)
        }
    });
    let inner = rect.shrink2(Vec2::new(super::INSET, 0.0));
    ui.scope_builder(UiBuilder::new().max_rect(inner).layout(Layout::right_to_left(Align::Center)), |ui| {
        if ui.button(tr!(language, "Back to live")).clicked() {
            outbox.send(session::Command::BackToLive);
        }
        ui.with_layout(Layout::left_to_right(Align::Center), |ui| {
            let words = rms.map_or_else(|| title.clone(), |rms| format!("{title} · {rms}"));
            let label = egui::Label::new(RichText::new(words).strong().color(colours.on_review)).truncate();
            ui.add(label);
        });
    });
}

/// A recorded image that is not there yet.
pub fn reading_ui(ui: &mut Ui, model: &Model, id: CaptureId, outbox: &mut Outbox) {
    let rect = ui.available_rect_before_wrap();
    ui.advance_cursor_after_rect(rect);
    let strip = Rect::from_min_size(rect.min, Vec2::new(rect.width(), STRIP));
    ui.scope_builder(UiBuilder::new().max_rect(strip), |ui| review_ui(ui, model, id, outbox));
    let below = Rect::from_min_max(strip.left_bottom(), rect.max);
    ui.painter().rect_stroke(below.shrink(1.5), 0.0, Stroke::new(3.0, Marks::of(ui).review), StrokeKind::Middle);
    ui.scope_builder(UiBuilder::new().max_rect(below).layout(Layout::top_down(Align::Center)), |ui| {
        ui.add_space((below.height() * 0.4).max(0.0));
        ui.add(Spinner::new().size(26.0));
        ui.label(tr!(model.view.language, "Reading the images of this capture…"));
    });
}

/// The state of the capture that is under way, or why the last one was refused; and a flash when there is a new one.
pub fn capture_ui(ui: &mut Ui, model: &Model, room: Rect, in_words: bool, outbox: &mut Outbox) {
    if model.review.is_none() {
        flash(ui, model, room);
    }
    if !in_words {
        return;
    }
    let language = model.view.language;
    if let Some(capture) = &model.capture {
        let words = waiting(capture).in_language(language);
        plate_ui(ui, room, Tone::Busy, &words, |ui| {
            if ui.add(parts::small_button(ui, tr!(language, "Cancel"))).clicked() {
                outbox.send(capture::Command::Cancel);
            }
        });
    } else if let Some(refused) = model.refused.as_ref().filter(|_| covers_image(model)) {
        let words = text!("No capture: {why}", why = refused.why.clone()).in_language(language);
        plate_ui(ui, room, Tone::Warning, &words, |_| {});
    }
}

/// Words on a plate at the bottom of the image.
fn plate_ui(ui: &mut Ui, room: Rect, tone: Tone, words: &str, action_ui: impl FnOnce(&mut Ui)) {
    const HEIGHT: f32 = 40.0;
    let palette = Palette::of(ui);
    let width = (room.width() - 24.0).clamp(0.0, 560.0);
    let galley = ui.painter().layout(
        words.to_owned(),
        egui::FontId::proportional(14.0),
        palette.text,
        (width - 130.0).max(60.0),
    );
    let size = Vec2::new((galley.size().x + 130.0).min(width), HEIGHT.max(galley.size().y + 18.0));
    let rect = Align2::CENTER_BOTTOM.align_size_within_rect(size, room.shrink(12.0));
    let edge = Stroke::new(1.0, palette.tone(tone));
    ui.painter().rect(rect, CornerRadius::same(CARD_RADIUS), palette.tinted(tone), edge, StrokeKind::Inside);
    let inner = rect.shrink2(Vec2::new(14.0, 0.0));
    ui.scope_builder(UiBuilder::new().max_rect(inner).layout(Layout::right_to_left(Align::Center)), |ui| {
        action_ui(ui);
        ui.with_layout(Layout::left_to_right(Align::Center), |ui| {
            if tone == Tone::Busy {
                ui.add(Spinner::new().size(16.0).color(palette.busy));
            }
            ui.add(egui::Label::new(RichText::new(words).color(palette.text)).wrap());
        });
    });
}

/// What is remembered to see that a capture is new.
#[derive(Debug, Clone)]
struct Newest {
    session: Option<PathBuf>,
    id: Option<CaptureId>,
    since_s: f64,
}

/// A short flash over the image when a capture was added.
fn flash(ui: &Ui, model: &Model, room: Rect) {
    let key = Id::new("newest capture");
    let id = model.document().captures.last().map(|capture| capture.id);
    let now_s = ui.input(|input| input.time);
    let kept: Option<Newest> = ui.data(|data| data.get_temp(key));
    let since_s = match &kept {
        Some(kept) if kept.session != model.session.folder => f64::NEG_INFINITY,
        Some(kept) if id > kept.id => now_s,
        Some(kept) => kept.since_s,
        // What was there when the window opened is not new.
        None => f64::NEG_INFINITY,
    };
    let newest = Newest { session: model.session.folder.clone(), id, since_s };
    ui.data_mut(|data| data.insert_temp(key, newest));
    let part = (now_s - since_s) / FLASH_S;
    if (0.0..1.0).contains(&part) {
        let alpha = (110.0 * (1.0 - part)) as u8;
        ui.painter().rect_filled(room, CornerRadius::ZERO, Color32::from_white_alpha(alpha));
        ui.request_repaint();
    }
}
