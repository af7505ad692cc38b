//! The pixel under the pointer in numbers: colour, depth, and the point in space.

use egui::{CornerRadius, RichText, Sense, Stroke, StrokeKind, Ui, Vec2, WidgetInfo, WidgetType};
use handeye_geometry::depth::DepthSample;
use nalgebra::{Point3, Vector2};

use super::Shown;
use crate::style::numbers;
use crate::style::theme::{self, Palette};
use handeye_wording::text;
use handeye_workbench::model::{ImagePoint, Model};
use handeye_workbench::tr;

/// The lines.
pub fn readout_ui(ui: &mut Ui, model: &Model, shown: &Shown<'_>) {
    let palette = Palette::of(ui);
    let language = model.view.language;
    let found = model.cursor.and_then(|point| Some((point, shown.images.rgb_at(point)?)));
    let Some((point, rgb)) = found else {
        let hint = if theme::is_for_fingers(ui) {
            tr!(language, "Touch an image to read a pixel; two fingers zoom, a double tap fits")
        } else {
            tr!(language, "Point at an image to read a pixel; the wheel zooms, a double click fits")
        };
        ui.add(egui::Label::new(RichText::new(hint).color(palette.weak)).wrap());
        return;
    };
    ui.spacing_mut().item_spacing.y = 2.0;
    // Lines of text, lower than a row of buttons.
    ui.spacing_mut().interact_size.y = 17.0;
    ui.vertical(|ui| {
        ui.add_space(4.0);
        ui.horizontal(|ui| pixel_ui(ui, model, shown, point, rgb));
        ui.horizontal(|ui| space_ui(ui, model, shown, point));
    });
}

fn pixel_ui(ui: &mut Ui, model: &Model, shown: &Shown<'_>, point: ImagePoint, [red, green, blue]: [u8; 3]) {
    let palette = Palette::of(ui);
    let language = model.view.language;
    let (swatch, _) = ui.allocate_exact_size(Vec2::splat(15.0), Sense::hover());
    let edge = Stroke::new(1.0, palette.edge);
    ui.painter().rect(swatch, CornerRadius::same(3), theme::pixel([red, green, blue]), edge, StrokeKind::Inside);
    let far_plane_m = shown.far_plane_m;
    let depth = match shown.images.depth_at(point, far_plane_m) {
        DepthSample::Metres(depth_m) => format!("{depth_m:.3} m"),
        DepthSample::Far => text!("over {depth} m", depth = format!("{far_plane_m:.2}")).in_language(language),
        DepthSample::Invalid => tr!(language, "none").to_owned(),
    };
    let ImagePoint { column, row } = point;
    value_ui(ui, tr!(language, "Pixel"), &format!("{column:>3}, {row:>3}"));
    value_ui(ui, "RGB", &format!("{red:>3} {green:>3} {blue:>3}"));
    value_ui(ui, tr!(language, "Depth"), &depth);
}

/// The point in camera and base, if depth, camera and calibration determine it.
fn space_ui(ui: &mut Ui, model: &Model, shown: &Shown<'_>, point: ImagePoint) {
    const UNKNOWN: &str = "–";
    let language = model.view.language;
    let in_camera = shown.depth_m(point).and_then(|depth_m| in_camera(model, point, depth_m));
    let millimetres = |point: &Point3<f64>| numbers::row((point.coords * 1e3).as_slice(), 1, 6);
    let camera = in_camera.as_ref().map_or_else(|| UNKNOWN.to_owned(), millimetres);
    value_ui(ui, tr!(language, "Camera [mm]"), &camera)
        .on_hover_text(tr!(language, "The point at this pixel in camera coordinates: x right, y down, z forward"));
    let Some(calibrated) = model.calibrated() else {
        value_ui(ui, tr!(language, "Base [mm]"), UNKNOWN)
            .on_hover_text(tr!(language, "Known as soon as there is a calibration"));
        return;
    };
    let in_base = in_camera
        .zip(shown.base_from_tip)
        .map(|(point, base_from_tip)| calibrated.base_from_camera(&base_from_tip).isometry() * point);
    let base = in_base.as_ref().map_or_else(|| UNKNOWN.to_owned(), millimetres);
    value_ui(ui, tr!(language, "Base [mm]"), &base)
        .on_hover_text(tr!(language, "The point at this pixel in base coordinates, by the newest calibration"));
}

/// The point seen at a pixel at this depth; `None` without a camera, and outside the lens model.
pub fn in_camera(model: &Model, point: ImagePoint, depth_m: f32) -> Option<Point3<f64>> {
    let px = Vector2::new(f64::from(point.column), f64::from(point.row));
    let ray = model.intrinsics()?.unproject(&px).ok()?;
    (ray.z > 0.0).then(|| Point3::from(ray.into_inner() * (f64::from(depth_m) / ray.z)))
}

/// A caption and a value, read together by a screen reader.
fn value_ui(ui: &mut Ui, caption: &str, value: &str) -> egui::Response {
    ui.label(RichText::new(caption).color(Palette::of(ui).weak));
    let response = ui.label(RichText::new(value).monospace());
    response.widget_info(|| {
        let spoken = value.split_whitespace().collect::<Vec<_>>().join(" ");
        WidgetInfo::labeled(WidgetType::Label, true, format!("{caption} {spoken}"))
    });
    ui.add_space(4.0);
    response
}
