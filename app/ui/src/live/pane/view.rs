//! One image: where it is on the screen, how it is zoomed and moved, and what is drawn over it.

use egui::{Color32, PointerButton, Pos2, Rect, Response, Sense, Stroke, StrokeKind, TextureHandle, Ui, Vec2};
use egui::{WidgetInfo, WidgetType};

use super::{Shown, feedback, overlays};
use crate::live::place::{LARGEST_ZOOM, Place, held};
use crate::status::STALE_AFTER_S;
use crate::style::marks::{self, Marks};
use crate::style::theme::{self, Palette};
use handeye_workbench::command::Outbox;
use handeye_workbench::live;
use handeye_workbench::model::{ImagePoint, Model, Step, Viewport};

/// Zoom per point of wheel movement; a notch of a wheel is about 50 points.
const ZOOM_PER_POINT: f32 = 0.004;

/// One image.
pub struct Image<'a> {
    /// Its pixels.
    pub texture: Option<&'a TextureHandle>,
    pub name: &'static str,
    /// Everything.
    pub model: &'a Model,
    pub shown: Shown<'a>,
    /// Whether corners and the like are drawn over it.
    pub with_overlays: bool,
}

impl Image<'_> {
    /// Draws it in the middle of the room; returns the pixel of the colour image under the pointer.
    pub fn image_ui(&self, ui: &mut Ui, outbox: &mut Outbox) -> Option<ImagePoint> {
        let texture = self.texture?;
        let room = ui.max_rect();
        let (columns, rows) = self.shown.images.rgb.dimensions();
        let place = Place::new(room, Vec2::new(columns as f32, rows as f32), self.model.viewport);
        let response = ui.interact(place.visible, ui.id().with("image"), Sense::click_and_drag());
        response.widget_info(|| WidgetInfo::labeled(WidgetType::Image, true, self.name));

        let tint = if self.is_stale() { theme::stale_tint() } else { Color32::WHITE };
        let uv = Rect::from_min_max(Pos2::ZERO, Pos2::new(1.0, 1.0));
        let painter = ui.painter().with_clip_rect(place.visible.intersect(ui.clip_rect()));
        painter.image(texture.id(), place.image, uv, tint);
        let exaggeration =
            if self.with_overlays { overlays::paint(ui, &painter, self.model, &self.shown, &place) } else { None };
        if let Some(picked) = self.model.picked.as_ref().filter(|_| self.shown.capture.is_none()) {
            ring(&painter, &place, picked.pixel);
        }
        if let Some(point) = self.model.cursor {
            cross(ui, &painter, &place, point);
        }
        if self.shown.capture.is_some() {
            let stroke = Stroke::new(3.0, Marks::of(ui).review);
            ui.painter().rect_stroke(room.shrink(1.5), 0.0, stroke, StrokeKind::Middle);
        }
        if self.with_overlays {
            feedback::badges_ui(ui, self.model, room, &self.shown, place.points_per_px(), exaggeration);
        }
        feedback::capture_ui(ui, self.model, room, self.with_overlays, outbox);
        self.navigate(ui, &response, room, &place, outbox);
        self.pick(&response, &place, outbox);
        response.hover_pos().filter(|at| place.visible.contains(*at)).map(|at| place.pixel(at))
    }

    fn is_stale(&self) -> bool {
        self.shown.capture.is_none() && self.model.frame_age_s().is_some_and(|age_s| age_s > STALE_AFTER_S)
    }

    /// Wheel, drag and double click.
    fn navigate(&self, ui: &Ui, response: &Response, room: Rect, place: &Place, outbox: &mut Outbox) {
        let now = self.model.viewport;
        let mut next = now;
        if let Some(at) = response.hover_pos() {
            let (scroll, pinch) = ui.input(|input| (input.smooth_scroll_delta().y, input.zoom_delta()));
            let factor = (scroll * ZOOM_PER_POINT).exp() * pinch;
            if (factor - 1.0).abs() > 1e-4 {
                next = zoomed(now, factor, at, room, place);
            }
        }
        let pans = response.dragged_by(PointerButton::Middle)
            || response.dragged_by(PointerButton::Secondary)
            || (response.dragged_by(PointerButton::Primary) && now.zoom > 1.0);
        if pans && response.drag_delta() != Vec2::ZERO {
            let centre = (room.center() - response.drag_delta() - place.image.min) / place.image.size();
            next.centre = held(centre, room.size(), place.image.size()).into();
        }
        if response.double_clicked() {
            next = Viewport::default();
        }
        if next != now {
            outbox.send(live::Command::SetViewport(next));
        }
    }

    /// In the verification step, a click measures the point.
    fn pick(&self, response: &Response, place: &Place, outbox: &mut Outbox) {
        if self.model.step != Step::Verify || self.shown.capture.is_some() || !response.clicked() {
            return;
        }
        if let Some(at) = response.interact_pointer_pos().filter(|at| place.visible.contains(*at)) {
            outbox.send(live::Command::Pick(Some(place.pixel(at))));
        }
    }
}

/// Larger by a factor, with the point under the pointer staying in place.
fn zoomed(now: Viewport, factor: f32, at: Pos2, room: Rect, place: &Place) -> Viewport {
    let zoom = (now.zoom * factor).clamp(1.0, LARGEST_ZOOM);
    // A zoom just above 1 looks like 1, and would make a drag pan.
    let zoom = if zoom < 1.01 { 1.0 } else { zoom };
    let size = place.image.size() * (zoom / now.zoom.clamp(1.0, LARGEST_ZOOM));
    let under = (at - place.image.min) / place.image.size();
    let centre = under + (room.center() - at) / size;
    Viewport { centre: held(centre, room.size(), size).into(), zoom }
}

/// An open cross at a pixel, which leaves the pixel itself visible.
fn cross(ui: &Ui, painter: &egui::Painter, place: &Place, point: ImagePoint) {
    let palette = Palette::of(ui);
    let centre = place.screen(Vec2::new(point.column as f32, point.row as f32));
    let from = 5.0_f32.max(place.points_per_px() * 0.5 + 2.0);
    for stroke in [Stroke::new(3.5, palette.mark_outline.gamma_multiply(0.6)), Stroke::new(1.5, palette.mark)] {
        for direction in [Vec2::RIGHT, Vec2::LEFT, Vec2::UP, Vec2::DOWN] {
            painter.line_segment([centre + direction * from, centre + direction * (from + 8.0)], stroke);
        }
    }
}

/// The point that was picked.
fn ring(painter: &egui::Painter, place: &Place, point: ImagePoint) {
    let centre = place.screen(Vec2::new(point.column as f32, point.row as f32));
    let colour = Marks::over_images().picked;
    painter.circle_stroke(centre, 8.0, Stroke::new(4.0, Color32::from_black_alpha(150)));
    painter.circle_stroke(centre, 8.0, Stroke::new(2.0, colour));
    for direction in [Vec2::RIGHT, Vec2::LEFT, Vec2::UP, Vec2::DOWN] {
        marks::outlined_line(painter, &[centre + direction * 8.0, centre + direction * 14.0], 2.0, colour);
    }
}
