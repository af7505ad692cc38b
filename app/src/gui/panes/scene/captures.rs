//! The captures in three dimensions: from where each was taken, in the colour of its residual.

use egui::{Color32, Pos2, Stroke};
use handeye_core::handeye::HandEye;
use handeye_core::session::{CaptureId, CaptureRecord};
use handeye_core::statistics::median_high;
use nalgebra::Point3;

use super::board::{self, Line};
use super::camera::Frustum;
use super::canvas::Canvas;
use super::content;
use crate::gui::captures::{CaptureRow, CaptureTable};
use crate::gui::marks::{self, Marks};
use crate::gui::theme::Palette;
use crate::model::Model;

/// Length of a frustum [m]: many of them have to stand beside each other.
const LENGTH_M: f64 = 0.06;
/// Residuals this many times the median have the colour of a warning.
const BAD: f64 = 3.0;

/// Where a capture is on the screen, to point at it.
#[derive(Debug, Clone, Copy)]
pub struct Spot {
    /// Which.
    pub id: CaptureId,
    /// Where.
    pub at: Pos2,
    /// Where it was taken: the camera, or the tip while the camera on it is not known, in the base \[m\].
    pub taken_m: Point3<f64>,
}

/// The median residual of the captures of the fit \[px\].
fn median_px(table: &CaptureTable) -> Option<f64> {
    let fitted = table.rows.iter().filter(|row| !row.excluded && !row.verifies());
    median_high(fitted.filter_map(|row| row.rms_px)).filter(|median| *median > 0.0)
}

/// The colour of a capture: by what it is for, and the nearer to that of a warning the larger its residual is against
/// the median; in it above the line between good and bad residuals, and when the estimate set it aside, as in the charts.
pub fn colour(
    row: &CaptureRow,
    median_px: Option<f64>,
    line_px: Option<f64>,
    marks: &Marks,
    warning: Color32,
) -> Color32 {
    if row.is_aside() {
        return warning;
    }
    let plain = marks::of_capture(marks, row.excluded, row.verifies());
    let Some(rms_px) = row.rms_px.filter(|_| !row.excluded && !row.verifies()) else { return plain };
    if line_px.is_some_and(|line_px| rms_px > line_px) {
        return warning;
    }
    let Some(median_px) = median_px else { return plain };
    let part = ((rms_px / median_px - 1.0) / (BAD - 1.0)).clamp(0.0, 1.0);
    plain.lerp_to_gamma(warning, part as f32)
}

/// Draws all of them and gives where they are on the screen.
pub fn captures(
    canvas: &mut Canvas,
    model: &Model,
    table: &CaptureTable,
    palette: &Palette,
    marks: &Marks,
    pointed: Option<CaptureId>,
) -> Vec<Spot> {
    let median_px = median_px(table);
    let mut spots = Vec::with_capacity(table.rows.len());
    for (record, row) in model.document().captures.iter().zip(&table.rows) {
        if !record.base_from_tip.is_finite() {
            continue;
        }
        let plain = colour(row, median_px, model.outlier_line_px, marks, palette.warning);
        let is_selected = model.selection.contains(&record.id);
        let (width, colour, strength) = match (is_selected, pointed == Some(record.id), row.excluded) {
            (true, ..) => (2.4, plain.lerp_to_gamma(palette.text, 0.45), 0.35),
            (_, true, _) => (2.0, plain.lerp_to_gamma(palette.text, 0.3), 0.25),
            (.., true) => (1.0, plain.gamma_multiply(0.7), 0.05),
            (.., false) => (1.2, plain, 0.12),
        };
        let place = capture(canvas, model, record, (width, colour, colour.gamma_multiply(strength)));
        if let Some(seen) = canvas.eye.point(&place.point_at) {
            spots.push(Spot { id: record.id, at: seen.at, taken_m: place.taken_m });
        }
    }
    spots
}

struct Place {
    point_at: Point3<f64>,
    taken_m: Point3<f64>,
}

/// Draws one; a camera that stands still has the boards instead, and a camera that is not known the tip.
fn capture(
    canvas: &mut Canvas,
    model: &Model,
    record: &CaptureRecord,
    (width, edge, fill): (f32, Color32, Color32),
) -> Place {
    let tip_m = Point3::from(record.base_from_tip.translation());
    if let Some(HandEye::EyeToHand { tip_from_target, .. }) = model.calibrated().map(|calibrated| calibrated.hand_eye) {
        let target = &model.document().meta.target;
        let base_from_target = record.base_from_tip * tip_from_target;
        board::outlined(canvas, &base_from_target, target, (width, edge), Line::Solid);
        let middle = base_from_target.isometry() * target.centre();
        return Place { point_at: middle, taken_m: tip_m };
    }
    if let (Some((base_from_camera, _)), Some(intrinsics)) =
        (content::base_from_camera(model, &record.base_from_tip), model.intrinsics())
    {
        let frustum = Frustum { base_from_camera, intrinsics: &intrinsics, length_m: LENGTH_M };
        frustum.draw(canvas, width, edge, fill);
        Place { point_at: frustum.middle(), taken_m: Point3::from(base_from_camera.translation()) }
    } else {
        canvas.dot(&tip_m, 3.0 + width, edge);
        canvas
            .line([tip_m, record.base_from_tip.isometry() * Point3::new(0.0, 0.0, LENGTH_M)], Stroke::new(width, edge));
        Place { point_at: tip_m, taken_m: tip_m }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gui::{captures, sample};

    #[test]
    fn the_colour_of_a_capture_tells_its_purpose_and_how_bad_its_residual_is() {
        let table = captures::table(&egui::Context::default(), &sample::solved());
        let median = median_px(&table).expect("residuals");
        let marks = Marks::over_pictures();
        let warning = Color32::from_rgb(240, 176, 64);
        let of = |rms_px: f64, line_px| {
            let row = CaptureRow { rms_px: Some(rms_px), ..table.rows[0].clone() };
            colour(&row, Some(median), line_px, marks, warning)
        };
        assert_eq!(of(0.5 * median, None), marks.fit);
        assert_eq!(of(10.0 * median, None), warning);
        let between = of(2.0 * median, None);
        assert!(between != marks.fit && between != warning);
        assert_eq!(of(1.1 * median, Some(median)), warning, "the line of the charts counts here as well");
        let verifying = &table.rows[sample::FITTED as usize];
        assert_eq!(colour(verifying, Some(median), None, marks, warning), marks.verify);
        let aside = captures::Aside { board_off: None };
        let aside = CaptureRow { aside: Some(aside), rms_px: None, ..table.rows[0].clone() };
        assert_eq!(colour(&aside, Some(median), None, marks, warning), warning);
        let excluded = CaptureRow { excluded: true, rms_px: Some(1e3), ..table.rows[0].clone() };
        assert_eq!(colour(&excluded, Some(median), None, marks, warning), marks.excluded);
    }
}
