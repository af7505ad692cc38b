//! Where a hypothesis has the tip in every view, drawn in the base.

use egui::{Align2, Color32, CornerRadius, FontId, Pos2, Rect, Sense, Stroke, Ui, Vec2, WidgetInfo, WidgetType};
use handeye_import::Hypothesis;
use nalgebra::{Point3, Vector3};

use crate::style::theme::{CAPTION, Palette};
use handeye_wording::text;
use handeye_workbench::model::Found;
use handeye_workbench::text::Language;

/// Side of the drawing.
pub const SIDE: f32 = 220.0;
/// Length of the axes of a tip as a part of what is drawn.
const AXIS: f64 = 0.07;

/// The drawing: the base, and the axes of the tip in every view, seen from the front, the left and above.
pub fn places_ui(ui: &mut Ui, found: &Found, h: &Hypothesis, language: Language) {
    let palette = Palette::of(ui);
    let (area, response) = ui.allocate_exact_size(Vec2::splat(SIDE), Sense::hover());
    let samples = &found.recording.tracks[h.robot].samples;
    let paired = samples.iter().zip(&h.pairing.image_of).filter(|(_, image)| image.is_some());
    let poses: Vec<_> = paired.filter_map(|(sample, _)| h.base_from_tip(sample)).collect();
    let reported = text!("Tip of the robot in {count} {count|view|views}, in its base", count = poses.len());
    response.widget_info(|| WidgetInfo::labeled(WidgetType::Image, true, reported.in_language(language)));
    let edge = Stroke::new(1.0, palette.edge);
    ui.painter().rect(area, CornerRadius::same(6), palette.paper.gamma_multiply(0.06), edge, egui::StrokeKind::Inside);
    let mut corners: Vec<Point3<f64>> = poses.iter().map(|pose| Point3::from(pose.translation())).collect();
    corners.push(Point3::origin());
    let flat: Vec<[f64; 2]> = corners.iter().map(flattened).collect();
    let bound = |axis: usize, pick: fn(f64, f64) -> f64| flat.iter().map(|p| p[axis]).fold(flat[0][axis], pick);
    let (low, high) = ([bound(0, f64::min), bound(1, f64::min)], [bound(0, f64::max), bound(1, f64::max)]);
    let span = (high[0] - low[0]).max(high[1] - low[1]).max(1e-6) * 1.25;
    let at = |point: &Point3<f64>| -> Pos2 {
        let [x, y] = flattened(point);
        let middle = [0.5 * (low[0] + high[0]), 0.5 * (low[1] + high[1])];
        let scale = SIDE / span as f32;
        area.center() + Vec2::new((x - middle[0]) as f32 * scale, (y - middle[1]) as f32 * scale)
    };
    let painter = ui.painter().with_clip_rect(area);
    let axes = |origin: Point3<f64>, directions: [Vector3<f64>; 3], length: f64, width: f32| {
        let colours: [Color32; 3] = [palette.axis_x, palette.axis_y, palette.accent];
        for (direction, colour) in directions.into_iter().zip(colours) {
            painter.line_segment([at(&origin), at(&(origin + direction * length))], Stroke::new(width, colour));
        }
    };
    for pose in &poses {
        let turned = [Vector3::x(), Vector3::y(), Vector3::z()].map(|axis| pose.rotation() * axis);
        axes(Point3::from(pose.translation()), turned, AXIS * span, 1.2);
    }
    axes(Point3::origin(), [Vector3::x(), Vector3::y(), Vector3::z()], 0.15 * span, 2.4);
    let caption = Rect::from_min_size(area.min + Vec2::new(6.0, 4.0), Vec2::new(SIDE, 14.0));
    let size = text!("{mm} mm across", mm = format!("{:.0}", span * 1e3)).in_language(language);
    painter.text(caption.min, Align2::LEFT_TOP, size, FontId::proportional(CAPTION), palette.weak);
}

/// A point as it is drawn: x to the right and down, y to the right and up, z up.
fn flattened(point: &Point3<f64>) -> [f64; 2] {
    const SLANT: (f64, f64) = (0.866, 0.4);
    [SLANT.0 * (point.y - point.x), SLANT.1 * (point.x + point.y) - point.z]
}
