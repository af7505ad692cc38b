//! The bar that shows which colour is which depth.

use egui::{Align2, Color32, FontId, Mesh, Pos2, Rect, Sense, Shape, Stroke, Ui, Vec2, WidgetInfo, WidgetType};
use handeye_geometry::depth::ColourMap;

use crate::style::theme::{self, Palette};
use handeye_wording::text;
use handeye_workbench::text::Language;

/// Height of the colours.
const HEIGHT: f32 = 12.0;
/// Colours across the bar; the graphics card mixes in between.
const STEPS: usize = 64;
/// Marks with numbers, the two ends included.
const TICKS: usize = 5;

/// The bar with its depths in metres, and a mark at the depth under the pointer.
pub fn colour_bar_ui(ui: &mut Ui, map: ColourMap, range_m: [f32; 2], at_cursor_m: Option<f32>, language: Language) {
    let palette = Palette::of(ui);
    let [near_m, far_m] = range_m;
    let (area, response) = ui.allocate_exact_size(ui.available_size(), Sense::hover());
    response.widget_info(|| {
        let (near, far) = (format!("{near_m:.2}"), format!("{far_m:.2}"));
        let label = text!("Depth colours from {near} m to {far} m", near = near, far = far).in_language(language);
        WidgetInfo::labeled(WidgetType::Image, true, label)
    });
    let bar = Rect::from_min_size(area.min + Vec2::new(0.0, 9.0), Vec2::new(area.width(), HEIGHT));
    ui.painter().add(gradient(bar, map));
    for tick in 0..TICKS {
        let part = tick as f32 / (TICKS - 1) as f32;
        let x = bar.left() + part * bar.width();
        let anchor = match tick {
            0 => Align2::LEFT_TOP,
            tick if tick == TICKS - 1 => Align2::RIGHT_TOP,
            _ => Align2::CENTER_TOP,
        };
        let depth_m = near_m + part * (far_m - near_m);
        let at = Pos2::new(x, bar.bottom() + 3.0);
        ui.painter().text(at, anchor, format!("{depth_m:.2} m"), FontId::proportional(theme::CAPTION), palette.weak);
    }
    if let Some(depth_m) = at_cursor_m.filter(|depth_m| (near_m..=far_m).contains(depth_m)) {
        let x = bar.left() + (depth_m - near_m) / (far_m - near_m).max(f32::EPSILON) * bar.width();
        let (top, bottom) = (Pos2::new(x, bar.top() - 4.0), Pos2::new(x, bar.bottom() + 2.0));
        ui.painter().line_segment([top, bottom], Stroke::new(4.0, palette.mark_outline));
        ui.painter().line_segment([top, bottom], Stroke::new(2.0, palette.mark));
    }
}

fn gradient(bar: Rect, map: ColourMap) -> Shape {
    let mut mesh = Mesh::default();
    for step in 0..=STEPS {
        let part = step as f32 / STEPS as f32;
        let colour: Color32 = theme::pixel(map.colour(f64::from(part)));
        let x = bar.left() + part * bar.width();
        mesh.colored_vertex(Pos2::new(x, bar.top()), colour);
        mesh.colored_vertex(Pos2::new(x, bar.bottom()), colour);
        if step > 0 {
            let last = 2 * step as u32 + 1;
            mesh.add_triangle(last - 3, last - 2, last - 1);
            mesh.add_triangle(last - 2, last - 1, last);
        }
    }
    Shape::mesh(mesh)
}
