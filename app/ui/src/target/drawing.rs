//! A board as it is printed, on the screen.

use egui::{Align2, CornerRadius, FontId, Id, Pos2, Rect, Sense, Stroke, Ui, Vec2, WidgetInfo, WidgetType};
use handeye_geometry::targets::TargetSpec;
use handeye_print::{Drawing, Shape};
use nalgebra::Vector2;
use std::sync::Arc;

use crate::style::parts;
use crate::style::theme::{CAPTION, Palette};
use handeye_wording::text;
use handeye_workbench::text::Language;

/// What was drawn last: looking up codes of markers takes time.
#[derive(Clone, Default)]
struct Kept(Option<(TargetSpec, Option<Arc<Drawing>>)>);

/// The board with the axes of its frame.
pub fn drawing_ui(ui: &mut Ui, target: &TargetSpec, room: Vec2, language: Language) {
    let palette = Palette::of(ui);
    let (area, response) = ui.allocate_exact_size(room, Sense::hover());
    response.widget_info(|| {
        WidgetInfo::labeled(
            WidgetType::Image,
            true,
            text!("Drawing of the board: {board}", board = target.text()).in_language(language),
        )
    });
    let Some(drawing) = drawing(ui, target) else { return };
    let (low, high) = drawing.bounds();
    let (low, high) = (low.add_scalar(-drawing.quiet_m), high.add_scalar(drawing.quiet_m));
    let extent = high - low;
    // Room for the letters of the axes.
    let inner = area.shrink2(Vec2::new(12.0, 10.0));
    let scale = (inner.width() / extent.x as f32).min(inner.height() / extent.y as f32);
    if !scale.is_finite() {
        return;
    }
    let paper = Rect::from_center_size(area.center(), Vec2::new(extent.x as f32, extent.y as f32) * scale);
    let at = |point: &Vector2<f64>| {
        let from_corner = point - low;
        paper.min + Vec2::new(from_corner.x as f32, from_corner.y as f32) * scale
    };
    let painter = ui.painter();
    let edge = Stroke::new(1.0, palette.edge);
    painter.rect(paper, CornerRadius::same(3), palette.paper, edge, egui::StrokeKind::Outside);
    for shape in &drawing.shapes {
        match shape {
            Shape::Rectangle { corner, size } => {
                let rect = Rect::from_min_max(at(corner), at(&(corner + size)));
                painter.rect_filled(rect, CornerRadius::ZERO, palette.ink);
            }
            Shape::Dot { centre, radius } => {
                painter.circle_filled(at(centre), *radius as f32 * scale, palette.ink);
            }
        }
    }
    let grid = target.grid();
    let point = |index: usize| at(&target.point(index).coords.xy());
    let ends = [point(grid.columns.saturating_sub(1)), point(grid.len().saturating_sub(grid.columns))];
    axes(ui, point(0), paper, ends);
}

/// The axes of the target frame from its origin.
fn axes(ui: &Ui, origin: Pos2, paper: Rect, [end_x, end_y]: [Pos2; 2]) {
    let palette = Palette::of(ui);
    let font = FontId::proportional(CAPTION);
    for (end, colour, name) in [(end_x, palette.axis_x, "x"), (end_y, palette.axis_y, "y")] {
        let tip = origin + (end - origin) * 0.3;
        ui.painter().line_segment([origin, tip], Stroke::new(2.0, colour));
        let (out, anchor) = if name == "x" {
            (Pos2::new(paper.right() + 4.0, origin.y), Align2::LEFT_CENTER)
        } else {
            (Pos2::new(origin.x, paper.bottom()), Align2::CENTER_TOP)
        };
        ui.painter().text(out, anchor, name, font.clone(), colour);
    }
    ui.painter().circle(origin, 3.0, palette.accent, Stroke::new(1.0, palette.paper));
}

fn drawing(ui: &Ui, target: &TargetSpec) -> Option<Arc<Drawing>> {
    let key = Id::new("drawing of the board");
    if let Kept(Some((drawn, drawing))) = parts::remembered::<Kept>(ui, key)
        && drawn == *target
    {
        return drawing;
    }
    let drawing = Drawing::of(target).ok().map(Arc::new);
    parts::remember(ui, key, Kept(Some((*target, drawing.clone()))));
    drawing
}
