//! The captures in three dimensions: from where each was taken, in the colour of its residual.

use egui::{Color32, Pos2, Stroke};
use handeye_geometry::frames::{Base, Pose, Tip};
use handeye_session::CaptureId;
use nalgebra::Point3;

use super::board::{self, Line};
use super::camera::Frustum;
use super::canvas::Canvas;
use crate::style::marks::Marks;
use crate::style::theme::Palette;
use handeye_workbench::model::Model;
use handeye_workbench::scene::{BAD_AT_MEDIANS, BoardItem, CaptureItem, CaptureUse, Captures, Fixed, Known};

/// Length of a frustum [m]: many of them have to fit next to each other.
const LENGTH_M: f64 = 0.06;
/// Where a capture is on the screen, to point at it.
#[derive(Debug, Clone, Copy)]
pub struct Spot {
    pub id: CaptureId,
    /// Where.
    pub at: Pos2,
    /// Where it was taken: the camera, or the tip while the camera on it is not known, in the base \[m\].
    pub taken_m: Point3<f64>,
}

/// The colour of a capture: by its purpose, and the nearer to the warning colour the larger its residual is relative to
/// the median; in the warning colour above the line between good and bad residuals, and if the estimate excluded it, as
/// in the charts.
fn colour(item: &CaptureItem, line_px: Option<f64>, marks: &Marks, warning: Color32) -> Color32 {
    match item.used_as {
        CaptureUse::Rejected => warning,
        CaptureUse::Verification => marks.verify,
        CaptureUse::Excluded => marks.excluded,
        CaptureUse::Fit if item.rms_px.zip(line_px).is_some_and(|(rms_px, line_px)| rms_px > line_px) => warning,
        CaptureUse::Fit => {
            let over_median = item.times_median.filter(|times| times.is_finite()).map_or(0.0, |times| times - 1.0);
            marks.fit.lerp_to_gamma(warning, (over_median / (BAD_AT_MEDIANS - 1.0)).clamp(0.0, 1.0) as f32)
        }
    }
}

/// Draws all of them and returns where they are on the screen.
pub fn captures(
    canvas: &mut Canvas,
    model: &Model,
    known: &Known,
    palette: &Palette,
    marks: &Marks,
    pointed: Option<CaptureId>,
) -> Vec<Spot> {
    let items = Captures::new(known);
    let mut spots = Vec::new();
    // Without a robot it is not known where the camera was.
    let taken = model.document().captures.iter().filter_map(|record| Some((record, record.base_from_tip?)));
    for (record, base_from_tip) in taken.filter(|(_, base_from_tip)| base_from_tip.is_finite()) {
        let item = items.item(record);
        let plain = colour(&item, model.outlier_line_px, marks, palette.warning);
        let is_selected = model.selection.contains(&record.id);
        let (width, colour, strength) = match (is_selected, pointed == Some(record.id), item.used_as) {
            (true, ..) => (2.4, plain.lerp_to_gamma(palette.text, 0.45), 0.35),
            (_, true, _) => (2.0, plain.lerp_to_gamma(palette.text, 0.3), 0.25),
            (.., CaptureUse::Excluded) => (1.0, plain.gamma_multiply(0.7), 0.05),
            _ => (1.2, plain, 0.12),
        };
        let place = capture(canvas, known, &base_from_tip, &item, (width, colour, colour.gamma_multiply(strength)));
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

/// Draws one; a camera that is fixed has the boards instead, and a camera that is not known the tip.
fn capture(
    canvas: &mut Canvas,
    known: &Known,
    base_from_tip: &Pose<Base, Tip>,
    item: &CaptureItem,
    (width, edge, fill): (f32, Color32, Color32),
) -> Place {
    let tip_m = Point3::from(base_from_tip.translation());
    if let Some(BoardItem { place: Fixed::Tip(tip_from_target), shape: Some(target), .. }) = known.board() {
        let base_from_target = *base_from_tip * tip_from_target;
        board::outlined(canvas, &base_from_target, &target, (width, edge), Line::Solid);
        let middle = base_from_target.isometry() * target.centre();
        return Place { point_at: middle, taken_m: tip_m };
    }
    if let (Some(base_from_camera), Some(intrinsics)) = (item.base_from_camera, known.intrinsics()) {
        let frustum = Frustum { base_from_camera, intrinsics: &intrinsics, length_m: LENGTH_M };
        frustum.draw(canvas, width, edge, fill);
        Place { point_at: frustum.middle(), taken_m: Point3::from(base_from_camera.translation()) }
    } else {
        canvas.dot(&tip_m, 3.0 + width, edge);
        canvas.line([tip_m, base_from_tip.isometry() * Point3::new(0.0, 0.0, LENGTH_M)], Stroke::new(width, edge));
        Place { point_at: tip_m, taken_m: tip_m }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_colour_of_a_capture_tells_its_purpose_and_how_bad_its_residual_is() {
        let marks = Marks::over_images();
        let warning = Color32::from_rgb(240, 176, 64);
        let of = |used_as, times_median: Option<f64>, line_px| {
            let rms_px = times_median.map(|times| 0.2 * times);
            let item = CaptureItem { base_from_camera: None, used_as, rms_px, times_median };
            colour(&item, line_px, marks, warning)
        };
        assert_eq!(of(CaptureUse::Fit, None, None), marks.fit);
        assert_eq!(of(CaptureUse::Fit, Some(0.5), None), marks.fit);
        assert_eq!(of(CaptureUse::Fit, Some(10.0), None), warning);
        let between = of(CaptureUse::Fit, Some(2.0), None);
        assert!(between != marks.fit && between != warning);
        assert_eq!(of(CaptureUse::Fit, Some(1.1), Some(0.2)), warning, "the line of the charts counts here as well");
        assert_eq!(of(CaptureUse::Verification, Some(10.0), None), marks.verify);
        assert_eq!(of(CaptureUse::Rejected, None, None), warning);
        assert_eq!(of(CaptureUse::Excluded, Some(10.0), None), marks.excluded);
    }
}
