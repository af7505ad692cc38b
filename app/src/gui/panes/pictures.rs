//! The live pictures, colour and depth, with the same pixel marked in both.

use egui::{
    Align, Align2, CornerRadius, FontId, Image, Layout, Pos2, Rect, Response, RichText, Sense, Stroke, TextureHandle,
    Ui, UiBuilder, Vec2,
};

use handeye_core::depth::DepthSample;

use super::{colour_bar, empty};
use crate::command::{Command, Outbox};
use crate::gui::status::{self, STALE_AFTER_S};
use crate::gui::textures::LiveTextures;
use crate::gui::theme::{self, Palette};
use crate::model::{DepthScale, ImagePoint, LiveFrame, Model};
use crate::text::Language;
use crate::{text, tr};

/// Height of the line over a picture.
const HEADER: f32 = 32.0;
/// Height of the line under a picture.
const FOOTER: f32 = 46.0;
/// Distance of text to the edge of a card.
const INSET: f32 = 12.0;

/// The colour picture; gives the pixel under the pointer.
pub fn colour_ui(ui: &mut Ui, model: &Model, textures: &LiveTextures, outbox: &mut Outbox) -> Option<ImagePoint> {
    let language = model.view.language;
    let Some(frame) = &model.frame else {
        empty::status_ui(ui, &status::before_first_picture(model), language, outbox);
        return None;
    };
    let picture = Picture { texture: textures.rgb.as_ref(), name: tr!(language, "Colour picture"), model, frame };
    card_ui(
        ui,
        |ui| {
            let (width, height) = frame.images.rgb.dimensions();
            size_ui(ui, width, height);
        },
        |ui| picture.picture_ui(ui),
        |ui| pixel_ui(ui, model, frame),
    )
}

/// The depth picture; gives the pixel of the colour picture under the pointer.
pub fn depth_ui(ui: &mut Ui, model: &Model, textures: &LiveTextures, outbox: &mut Outbox) -> Option<ImagePoint> {
    let language = model.view.language;
    let Some(frame) = &model.frame else {
        let detail = tr!(language, "It comes with the colour picture, if the camera measures depth.");
        empty::empty_ui(ui, tr!(language, "No depth picture yet"), detail);
        return None;
    };
    let picture = Picture { texture: textures.depth.as_ref(), name: tr!(language, "Depth picture"), model, frame };
    card_ui(
        ui,
        |ui| {
            size_ui(ui, frame.images.depth.width, frame.images.depth.height);
            scale_ui(ui, model.view.depth_scale, language, outbox);
        },
        |ui| picture.picture_ui(ui),
        |ui| {
            let at_cursor = model.cursor.map(|point| frame.images.depth_at(point, frame.info.far_plane_m));
            let depth_m = match at_cursor {
                Some(DepthSample::Metres(depth_m)) => Some(depth_m),
                _ => None,
            };
            colour_bar::colour_bar_ui(ui, frame.info.depth_range_m, depth_m, language);
        },
    )
}

/// A line at the top, a picture, and a line at the bottom. Gives what the picture gives.
fn card_ui<R>(
    ui: &mut Ui,
    header_ui: impl FnOnce(&mut Ui),
    picture_ui: impl FnOnce(&mut Ui) -> R,
    footer_ui: impl FnOnce(&mut Ui),
) -> R {
    let palette = Palette::of(ui);
    let rect = ui.available_rect_before_wrap();
    ui.advance_cursor_after_rect(rect);
    let header = Rect::from_min_max(rect.min, Pos2::new(rect.max.x, rect.min.y + HEADER));
    let footer = Rect::from_min_max(Pos2::new(rect.min.x, rect.max.y - FOOTER), rect.max);
    let well = Rect::from_min_max(header.left_bottom(), footer.right_top());
    ui.painter().rect_filled(well, CornerRadius::ZERO, palette.well);
    let row = |rect: Rect| {
        UiBuilder::new().max_rect(rect.shrink2(Vec2::new(INSET, 0.0))).layout(Layout::left_to_right(Align::Center))
    };
    ui.scope_builder(row(header), header_ui);
    let result = ui.scope_builder(UiBuilder::new().max_rect(well), picture_ui).inner;
    ui.scope_builder(row(footer), footer_ui);
    result
}

fn size_ui(ui: &mut Ui, width: u32, height: u32) {
    let weak = Palette::of(ui).weak;
    ui.label(RichText::new(format!("{width} × {height} px")).color(weak));
}

/// One picture with the marked pixel.
struct Picture<'a> {
    texture: Option<&'a TextureHandle>,
    name: &'static str,
    model: &'a Model,
    frame: &'a LiveFrame,
}

impl Picture<'_> {
    /// Draws it in the middle of the room; gives the pixel of the colour image under the pointer.
    fn picture_ui(&self, ui: &mut Ui) -> Option<ImagePoint> {
        let texture = self.texture?;
        let room = ui.max_rect();
        let [width, height] = texture.size().map(|side| side.max(1) as f32);
        // A window can be dragged smaller than all its bars together.
        let scale = (room.width() / width).min(room.height() / height).max(0.0);
        let rect = Rect::from_center_size(room.center(), Vec2::new(width, height) * scale);
        let mut image = Image::from_texture(texture).fit_to_exact_size(rect.size()).sense(Sense::hover());
        if self.is_stale() {
            image = image.tint(theme::stale_tint());
        }
        let response = ui.put(rect, image.alt_text(self.name));
        let (columns, rows) = self.frame.images.rgb.dimensions();
        if let Some(point) = self.model.cursor {
            mark(ui, rect, Vec2::new(point.column as f32 + 0.5, point.row as f32 + 0.5), columns, rows);
        }
        point_at(&response, columns, rows)
    }

    fn is_stale(&self) -> bool {
        self.model.frame_age_s().is_some_and(|age_s| age_s > STALE_AFTER_S)
    }
}

/// The pixel of an image of `columns` × `rows` that the pointer is over.
fn point_at(response: &Response, columns: u32, rows: u32) -> Option<ImagePoint> {
    let position = response.hover_pos()?;
    let part = (position - response.rect.min) / response.rect.size();
    let index = |part: f32, count: u32| ((part * count as f32) as u32).min(count.saturating_sub(1));
    Some(ImagePoint { column: index(part.x, columns), row: index(part.y, rows) })
}

/// An open cross at a pixel, which leaves the pixel itself visible.
fn mark(ui: &Ui, rect: Rect, at_px: Vec2, columns: u32, rows: u32) {
    const FROM: f32 = 5.0;
    const TO: f32 = 13.0;
    let palette = Palette::of(ui);
    let part = Vec2::new(at_px.x / columns.max(1) as f32, at_px.y / rows.max(1) as f32);
    let centre = rect.min + part * rect.size();
    let painter = ui.painter().with_clip_rect(rect);
    for stroke in [Stroke::new(3.5, palette.mark_outline.gamma_multiply(0.6)), Stroke::new(1.5, palette.mark)] {
        for direction in [Vec2::RIGHT, Vec2::LEFT, Vec2::UP, Vec2::DOWN] {
            painter.line_segment([centre + direction * FROM, centre + direction * TO], stroke);
        }
    }
}

/// The pixel under the pointer in numbers.
fn pixel_ui(ui: &mut Ui, model: &Model, frame: &LiveFrame) {
    let palette = Palette::of(ui);
    let language = model.view.language;
    let found = model.cursor.and_then(|point| Some((point, frame.images.rgb_at(point)?)));
    let Some((point, [red, green, blue])) = found else {
        let hint = tr!(model.view.language, "Point at a picture to read a pixel");
        ui.label(RichText::new(hint).color(palette.weak));
        return;
    };
    let (swatch, _) = ui.allocate_exact_size(Vec2::splat(18.0), Sense::hover());
    let edge = Stroke::new(1.0, palette.edge);
    let fill = theme::pixel([red, green, blue]);
    ui.painter().rect(swatch, CornerRadius::same(4), fill, edge, egui::StrokeKind::Inside);
    let ImagePoint { column, row } = point;
    let far_plane_m = frame.info.far_plane_m;
    let depth = match frame.images.depth_at(point, far_plane_m) {
        DepthSample::Metres(depth_m) => format!("{depth_m:.3} m"),
        DepthSample::Far => text!("over {depth} m", depth = format!("{far_plane_m:.2}")).say(language),
        DepthSample::Invalid => tr!(language, "none").to_owned(),
    };
    for (caption, value) in [
        (tr!(language, "Pixel"), format!("{column:>3}, {row:>3}")),
        ("RGB", format!("{red:>3} {green:>3} {blue:>3}")),
        (tr!(language, "Depth"), depth),
    ] {
        ui.label(RichText::new(caption).color(palette.weak));
        let label = ui.label(RichText::new(&value).monospace());
        label.widget_info(|| {
            let spoken = value.split_whitespace().collect::<Vec<_>>().join(" ");
            egui::WidgetInfo::labeled(egui::WidgetType::Label, true, format!("{caption} {spoken}"))
        });
        ui.add_space(6.0);
    }
}

/// Which depths the colours cover.
fn scale_ui(ui: &mut Ui, scale: DepthScale, language: Language, outbox: &mut Outbox) {
    ui.with_layout(Layout::right_to_left(Align::Center), |ui| {
        ui.spacing_mut().item_spacing.x = 2.0;
        for (choice, name, what) in [
            (
                DepthScale::Full,
                tr!(language, "Full range"),
                tr!(language, "Colours for all depths [m] that the sensor can measure"),
            ),
            (
                DepthScale::Auto,
                tr!(language, "Auto range"),
                tr!(language, "Colours for the depths [m] that are in the picture"),
            ),
        ] {
            if ui.selectable_label(scale == choice, name).on_hover_text(what).clicked() && scale != choice {
                outbox.send(Command::SetDepthScale(choice));
            }
        }
    });
}

/// Text on a picture card's painter, for parts that are not widgets.
pub fn small_text(ui: &Ui, at: Pos2, anchor: Align2, text: &str) -> Rect {
    ui.painter().text(at, anchor, text, FontId::proportional(theme::CAPTION), Palette::of(ui).weak)
}
