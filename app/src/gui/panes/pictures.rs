//! The live pictures: colour and depth side by side, with the same pixel marked in both.

use egui::{
    Align, Align2, CornerRadius, FontId, Image, Layout, Pos2, Rect, Response, RichText, Sense, Stroke, TextureHandle,
    Ui, UiBuilder, Vec2,
};

use handeye_core::depth::DepthSample;

use super::colour_bar;
use crate::command::{Command, Outbox};
use crate::gui::status::STALE_AFTER_S;
use crate::gui::textures::LiveTextures;
use crate::gui::theme::{self, CARD_RADIUS, GAP, Palette};
use crate::model::{DepthScale, ImagePoint, LiveFrame, Model};

/// Height of the line over a picture.
const HEADER: f32 = 36.0;
/// Height of the line under a picture.
const FOOTER: f32 = 46.0;
/// Distance of text to the edge of a card.
const INSET: f32 = 12.0;

/// Both pictures, as large as there is room.
pub fn pictures_ui(ui: &mut Ui, model: &Model, textures: &LiveTextures, outbox: &mut Outbox) {
    let Some(frame) = &model.frame else { return };
    let area = ui.available_rect_before_wrap();
    let width = ((area.width() - GAP) / 2.0).max(1.0);
    let left = Rect::from_min_size(area.min, Vec2::new(width, area.height()));
    let right = left.translate(Vec2::new(width + GAP, 0.0));
    ui.advance_cursor_after_rect(area);
    let picture = |texture, name| Picture { texture, name, model, frame };

    let colour = picture(textures.rgb.as_ref(), "Colour picture");
    let over_colour = card_ui(
        ui,
        left,
        |ui| {
            let (width, height) = frame.images.rgb.dimensions();
            title_ui(ui, "RGB", &format!("{width} × {height}"));
        },
        |ui| colour.picture_ui(ui),
        |ui| pixel_ui(ui, model, frame),
    );
    let depth = picture(textures.depth.as_ref(), "Depth picture");
    let over_depth = card_ui(
        ui,
        right,
        |ui| {
            let (width, height) = (frame.images.depth.width, frame.images.depth.height);
            title_ui(ui, "Depth", &format!("{width} × {height}"));
            scale_ui(ui, model.view.depth_scale, outbox);
        },
        |ui| depth.picture_ui(ui),
        |ui| {
            let at_cursor = model.cursor.map(|point| frame.images.depth_at(point, frame.info.far_plane_m));
            let depth_m = match at_cursor {
                Some(DepthSample::Metres(depth_m)) => Some(depth_m),
                _ => None,
            };
            colour_bar::colour_bar_ui(ui, frame.info.depth_range_m, depth_m);
        },
    );
    let pointed = over_colour.or(over_depth);
    if pointed != model.cursor {
        outbox.send(Command::PointAt(pointed));
    }
}

/// A card with a line at the top, a picture, and a line at the bottom. Gives what the picture gives.
fn card_ui<R>(
    ui: &mut Ui,
    rect: Rect,
    header_ui: impl FnOnce(&mut Ui),
    picture_ui: impl FnOnce(&mut Ui) -> R,
    footer_ui: impl FnOnce(&mut Ui),
) -> R {
    let palette = Palette::of(ui);
    let radius = CornerRadius::same(CARD_RADIUS);
    ui.painter().rect(rect, radius, palette.card, Stroke::new(1.0, palette.edge), egui::StrokeKind::Inside);
    let header = Rect::from_min_max(rect.min, Pos2::new(rect.max.x, rect.min.y + HEADER));
    let footer = Rect::from_min_max(Pos2::new(rect.min.x, rect.max.y - FOOTER), rect.max);
    let well = Rect::from_min_max(header.left_bottom(), footer.right_top()).shrink2(Vec2::new(1.0, 0.0));
    ui.painter().rect_filled(well, CornerRadius::ZERO, palette.well);
    let row = |rect: Rect| {
        UiBuilder::new().max_rect(rect.shrink2(Vec2::new(INSET, 0.0))).layout(Layout::left_to_right(Align::Center))
    };
    ui.scope_builder(row(header), header_ui);
    let result = ui.scope_builder(UiBuilder::new().max_rect(well), picture_ui).inner;
    ui.scope_builder(row(footer), footer_ui);
    result
}

fn title_ui(ui: &mut Ui, title: &str, size: &str) {
    let palette = Palette::of(ui);
    ui.label(RichText::new(title).strong().size(15.0));
    ui.label(RichText::new(size).color(palette.weak));
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
    let found = model.cursor.and_then(|point| Some((point, frame.images.rgb_at(point)?)));
    let Some((point, [red, green, blue])) = found else {
        ui.label(RichText::new("Point at a picture to read a pixel").color(palette.weak));
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
        DepthSample::Far => format!("over {far_plane_m:.2} m"),
        DepthSample::Invalid => "none".to_owned(),
    };
    for (caption, value) in [
        ("Pixel", format!("{column:>3}, {row:>3}")),
        ("RGB", format!("{red:>3} {green:>3} {blue:>3}")),
        ("Depth", depth),
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
fn scale_ui(ui: &mut Ui, scale: DepthScale, outbox: &mut Outbox) {
    ui.with_layout(Layout::right_to_left(Align::Center), |ui| {
        ui.spacing_mut().item_spacing.x = 2.0;
        for (choice, name, what) in [
            (DepthScale::Full, "Full range", "Colours for all depths that the sensor can measure"),
            (DepthScale::Auto, "Auto range", "Colours for the depths that are in the picture"),
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
