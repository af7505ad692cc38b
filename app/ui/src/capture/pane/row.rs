//! One row of the table.

use egui::{
    Align2, Checkbox, Color32, CornerRadius, FontFamily, FontId, Pos2, Rect, Response, Sense, Stroke, StrokeKind, Ui,
    Vec2, WidgetInfo, WidgetType,
};

use super::columns::Column;
use super::flags::{self, Circumstances, Flag};
use crate::capture::rows::CaptureRow;
use crate::live::textures::Thumbnails;
use crate::style::marks::{self, Marks};
use crate::style::numbers;
use crate::style::theme::{CAPTION, Palette, Tone};
use handeye_wording::text;
use handeye_workbench::command::Outbox;
use handeye_workbench::model::Model;
use handeye_workbench::session;
use handeye_workbench::text::Language;
use handeye_workbench::tr;

/// Height of a row with the pose below the number.
pub const HEIGHT: f32 = 40.0;
/// The same with both in one line.
pub const LOW_HEIGHT: f32 = 28.0;

/// Draws a row in its place; returns the pointer's interaction.
pub fn row_ui(
    ui: &mut Ui,
    model: &Model,
    row: &CaptureRow,
    place: Rect,
    circumstances: Circumstances,
    thumbnails: &mut Thumbnails,
    outbox: &mut Outbox,
) -> Response {
    let palette = Palette::of(ui);
    let language = model.view.language;
    let selected = model.selection.contains(&row.id);
    let name = text!("Capture {name}", name = row.title()).in_language(language);
    // Rows are reached by the arrow keys, not by Tab: there may be a thousand of them.
    let response = ui.interact(place, ui.id().with(("capture", row.id)), Sense::CLICK);
    response.widget_info(|| {
        WidgetInfo::selected(WidgetType::SelectableLabel, true, selected, spoken(row, &name, language))
    });
    if selected {
        ui.painter().rect_filled(place, CornerRadius::ZERO, ui.visuals().selection.bg_fill);
    } else {
        let plain = row.is_rejected().then(|| palette.tinted(Tone::Warning));
        let fill = if response.hovered() {
            Some(plain.unwrap_or(palette.card).lerp_to_gamma(palette.text, 0.05))
        } else {
            plain
        };
        if let Some(fill) = fill {
            ui.painter().rect_filled(place, CornerRadius::ZERO, fill);
        }
    }
    if model.review.as_ref().is_some_and(|review| review.id == row.id) {
        let bar = Rect::from_min_size(place.min, Vec2::new(3.0, place.height()));
        ui.painter().rect_filled(bar, CornerRadius::ZERO, Marks::of(ui).review);
    }
    let line = Stroke::new(1.0, palette.edge.gamma_multiply(0.6));
    ui.painter().hline(place.x_range(), place.bottom() - 0.5, line);

    for (column, x) in Column::places(place.width()) {
        let cell = Rect::from_x_y_ranges(place.left() + x.min..=place.left() + x.max, place.y_range());
        match column {
            Column::Image => image(ui, model, row, cell, thumbnails),
            Column::Name => title(ui, row, cell),
            Column::Use => use_ui(ui, row, cell, language, outbox),
            Column::Purpose => {
                let (words, colour) = if row.is_rejected() {
                    (tr!(language, "outlier"), palette.warning)
                } else {
                    let words = if row.verifies() { tr!(language, "verify") } else { tr!(language, "fit") };
                    (words, marks::of_capture(Marks::of(ui), row.excluded, row.verifies()))
                };
                let at = Pos2::new(cell.left() + 6.0, cell.center().y);
                ui.painter().text(at, Align2::LEFT_CENTER, words, FontId::proportional(13.0), colour);
            }
            Column::Flags => {
                let flags = flags::flags(row, circumstances, language);
                flags_ui(ui, row, cell, &flags);
            }
            Column::Rms | Column::Correction | Column::Turn | Column::Influence | Column::Noise => {
                number(ui, model, row, cell, column);
            }
        }
    }
    match hidden(row, place.width(), language) {
        Some(words) => response.on_hover_text_at_pointer(words),
        None => response,
    }
}

/// The values of a row in columns that do not fit.
fn hidden(row: &CaptureRow, width: f32, language: Language) -> Option<String> {
    let reported = |column: Column| {
        let value = numbers::fixed(column.number(row)?, column.decimals(), 0);
        Some(format!("{}: {value} {}", column.name(language), column.unit()))
    };
    let lines: Vec<String> = Column::hidden(width).filter_map(reported).collect();
    (!lines.is_empty()).then(|| lines.join("\n"))
}

fn spoken(row: &CaptureRow, name: &str, language: Language) -> String {
    let rejected = if row.is_rejected() { format!(", {}", tr!(language, "outlier")) } else { String::new() };
    match row.rms_px {
        Some(rms_px) => format!("{name}{rejected}, {rms_px:.3} px"),
        None => format!("{name}{rejected}"),
    }
}

fn image(ui: &Ui, model: &Model, row: &CaptureRow, cell: Rect, thumbnails: &mut Thumbnails) {
    let palette = Palette::of(ui);
    let frame = Rect::from_center_size(cell.center(), Vec2::new(44.0, 33.0).min(cell.size() - Vec2::splat(4.0)));
    match model.observed(row.id) {
        None => {
            ui.painter().rect_filled(frame, CornerRadius::same(3), palette.well);
        }
        Some(observed) => {
            let texture = thumbnails.of(ui.ctx(), row.id, observed);
            let [width, height] = texture.size().map(|side| side.max(1) as f32);
            let scale = (frame.width() / width).min(frame.height() / height);
            let rect = Rect::from_center_size(frame.center(), Vec2::new(width, height) * scale);
            let uv = Rect::from_min_max(Pos2::ZERO, Pos2::new(1.0, 1.0));
            let tint = if row.excluded { Color32::from_gray(110) } else { Color32::WHITE };
            ui.painter().image(texture.id(), rect, uv, tint);
            ui.painter().rect_stroke(rect, CornerRadius::ZERO, Stroke::new(1.0, palette.edge), StrokeKind::Outside);
        }
    }
}

fn title(ui: &Ui, row: &CaptureRow, cell: Rect) {
    let palette = Palette::of(ui);
    let colour = if row.excluded { palette.weak } else { palette.text };
    let painter = ui.painter().with_clip_rect(cell.shrink2(Vec2::new(2.0, 0.0)).intersect(ui.clip_rect()));
    let x = cell.left() + 6.0;
    let number = row.id.to_string();
    match &row.pose_name {
        None => {
            let at = Pos2::new(x, cell.center().y);
            painter.text(at, Align2::LEFT_CENTER, number, FontId::proportional(14.0), colour);
        }
        Some(_) if cell.height() < HEIGHT => {
            let at = Pos2::new(x, cell.center().y);
            painter.text(at, Align2::LEFT_CENTER, row.title(), FontId::proportional(13.0), colour);
        }
        Some(name) => {
            let at = Pos2::new(x, cell.center().y - 1.0);
            painter.text(at, Align2::LEFT_BOTTOM, number, FontId::proportional(14.0), colour);
            let at = Pos2::new(x, cell.center().y + 2.0);
            painter.text(at, Align2::LEFT_TOP, name, FontId::proportional(CAPTION), palette.weak);
        }
    }
}

fn use_ui(ui: &mut Ui, row: &CaptureRow, cell: Rect, language: Language, outbox: &mut Outbox) {
    let mut used = !row.excluded;
    let place = Rect::from_center_size(cell.center(), Vec2::splat(ui.spacing().interact_size.y));
    let response = ui.put(place, Checkbox::without_text(&mut used));
    let name = text!("Use capture {id}", id = row.id).in_language(language);
    response.widget_info(|| WidgetInfo::selected(WidgetType::Checkbox, true, used, &name));
    if response.changed() {
        outbox.send(session::Command::SetExcluded { ids: vec![row.id], excluded: !used });
    }
}

fn number(ui: &Ui, model: &Model, row: &CaptureRow, cell: Rect, column: Column) {
    let value = column.number(row);
    let palette = Palette::of(ui);
    // What belongs to another set of captures is drawn dimmed.
    let is_current = model.solve.fresh && !row.excluded;
    let colour = if is_current && value.is_some() { palette.text } else { palette.weak };
    let words = value.map_or_else(|| "–".to_owned(), |value| numbers::fixed(value, column.decimals(), 0));
    let at = Pos2::new(cell.right() - 6.0, cell.center().y);
    ui.painter().text(at, Align2::RIGHT_CENTER, words, FontId::new(13.0, FontFamily::Monospace), colour);
}

/// The worst remark in words, and how many more there are.
fn flags_ui(ui: &Ui, row: &CaptureRow, cell: Rect, flags: &[Flag]) {
    let Some(worst) = flags.first() else { return };
    let palette = Palette::of(ui);
    let (ink, fill) = match worst.tone {
        Some(tone) => (palette.tone(tone), palette.tinted(tone)),
        None => (palette.weak, palette.well),
    };
    let painter = ui.painter().with_clip_rect(cell.intersect(ui.clip_rect()));
    let words = match flags.len() {
        1 => worst.name.to_owned(),
        more => format!("{} +{}", worst.name, more - 1),
    };
    let galley = painter.layout_no_wrap(words, FontId::proportional(CAPTION), ink);
    let size = galley.size() + Vec2::new(12.0, 6.0);
    let pill = Rect::from_min_size(Pos2::new(cell.left() + 6.0, cell.center().y - size.y / 2.0), size);
    painter.rect_filled(pill, CornerRadius::same(8), fill);
    painter.galley(pill.min + Vec2::new(6.0, 3.0), galley, ink);
    let response = ui.interact(pill.intersect(cell), ui.id().with(("flags", row.id)), Sense::HOVER);
    let all: Vec<&str> = flags.iter().map(|flag| flag.name).collect();
    response.widget_info(|| WidgetInfo::labeled(WidgetType::Label, true, format!("{}: {}", row.id, all.join(", "))));
    response.on_hover_ui(|ui| {
        ui.set_max_width(340.0);
        for flag in flags {
            ui.label(egui::RichText::new(flag.name).strong());
            ui.label(&flag.why);
        }
    });
}
