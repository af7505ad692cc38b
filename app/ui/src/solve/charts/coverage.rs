//! Which part of the image the board has been seen in.

use egui::{Pos2, Rect, RichText, Sense, Shape, Stroke, StrokeKind, Ui, Vec2, WidgetInfo, WidgetType};

use super::{instead_ui, legend};
use crate::capture::rows::CaptureTable;
use crate::style::marks::{self, Marks};
use crate::style::theme::Palette;
use handeye_wording::text;
use handeye_workbench::model::Model;
use handeye_workbench::tr;

/// The map.
pub fn coverage_ui(ui: &mut Ui, model: &Model, table: &CaptureTable) {
    let language = model.view.language;
    let palette = Palette::of(ui);
    let Some(coverage) = &table.coverage else {
        instead_ui(ui, tr!(language, "Coverage appears with the first capture in which the board is found"));
        return;
    };
    let covered = format!("{:.0}", coverage.covered() * 100.0);
    let words =
        text!("Corners in {covered} % of the cells of the image, in pixels", covered = covered).in_language(language);
    ui.label(RichText::new(words).color(palette.text));
    ui.horizontal(|ui| legend::legend_ui(ui, table, language));

    let room = ui.available_rect_before_wrap();
    ui.advance_cursor_after_rect(room);
    let size_px = Vec2::new(table.image_size.0.max(1) as f32, table.image_size.1.max(1) as f32);
    // Room for the numbers of the last column and row.
    let space = (room.size() - Vec2::new(60.0, 20.0)).max(Vec2::splat(1.0));
    let size = size_px * (space.x / size_px.x).min(space.y / size_px.y);
    let image = Rect::from_min_size(Pos2::new(room.center().x - size.x / 2.0, room.top() + 2.0), size);
    let cell = size / Vec2::new(coverage.columns.max(1) as f32, coverage.rows.max(1) as f32);
    let most = coverage.counts.iter().copied().max().unwrap_or(0).max(1) as f32;
    ui.painter().rect_filled(image, 0.0, palette.well);
    for row in 0..coverage.rows {
        for column in 0..coverage.columns {
            let min = image.min + Vec2::new(column as f32, row as f32) * cell;
            let rect = Rect::from_min_size(min, cell).shrink(0.5);
            match coverage.count(column, row) {
                0 => marks::hatch(ui.painter(), rect, palette.warning.gamma_multiply(0.35)),
                count => {
                    let part = 0.12 + 0.48 * (count as f32 / most).sqrt();
                    ui.painter().rect_filled(rect, 0.0, palette.well.lerp_to_gamma(Marks::of(ui).fit, part));
                }
            }
        }
    }
    for (outline, &index) in coverage.outlines.iter().zip(&table.outlined) {
        let Some(row) = table.rows.get(index) else { continue };
        let selected = model.selection.contains(&row.id);
        let colour = marks::of_capture(Marks::of(ui), row.excluded, row.verifies());
        let stroke =
            if selected { Stroke::new(2.5, palette.text) } else { Stroke::new(1.0, colour.gamma_multiply(0.7)) };
        let on_screen = |px: &nalgebra::Vector2<f64>| {
            image.min + (Vec2::new(px.x as f32, px.y as f32) + Vec2::splat(0.5)) / size_px * size
        };
        ui.painter().add(Shape::closed_line(outline.px.iter().map(on_screen).collect(), stroke));
    }
    ui.painter().rect_stroke(image, 0.0, Stroke::new(1.0, palette.edge), StrokeKind::Outside);
    let font = egui::FontId::proportional(crate::style::theme::CAPTION);
    let (width, height) = table.image_size;
    let weak = palette.weak;
    let right = image.right_top() + Vec2::new(4.0, 0.0);
    ui.painter().text(right, egui::Align2::LEFT_TOP, "0 px", font.clone(), weak);
    let bottom = image.right_bottom() + Vec2::new(4.0, 0.0);
    ui.painter().text(bottom, egui::Align2::LEFT_BOTTOM, format!("{height} px"), font.clone(), weak);
    let below = image.left_bottom() + Vec2::new(0.0, 3.0);
    ui.painter().text(below, egui::Align2::LEFT_TOP, "0 px", font.clone(), weak);
    let below = image.right_bottom() + Vec2::new(0.0, 3.0);
    ui.painter().text(below, egui::Align2::RIGHT_TOP, format!("{width} px"), font, weak);

    let response = ui.interact(image, ui.id().with("coverage"), Sense::hover());
    response.widget_info(|| WidgetInfo::labeled(WidgetType::Image, true, tr!(language, "Coverage of the image")));
    if let Some(at) = response.hover_pos() {
        let part = (at - image.min) / cell;
        let (column, row) = (part.x.max(0.0) as usize, part.y.max(0.0) as usize);
        let words = match coverage.count(column, row) {
            0 => text!("No corner was ever seen here: bring the board there"),
            count => text!("{count} {count|corner|corners} seen here", count = count),
        };
        response.on_hover_text_at_pointer(words.in_language(language));
    }
}
