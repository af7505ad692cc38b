//! What is drawn over the colour image: corners, axes, the predicted board, coverage, residuals.

use egui::{Color32, Id, Painter, Pos2, Rect, Shape, Stroke, Ui, Vec2};
use handeye_estimate::verify::Predictor;
use handeye_geometry::frames::{Camera, Pose, Target};
use handeye_geometry::statistics::median_high;
use handeye_geometry::targets::TargetSpec;
use handeye_geometry::targets::bent::BoardShape;
use handeye_geometry::targets::observation::Corner;
use nalgebra::{Point3, Vector2};

use super::Shown;
use crate::capture::rows::{self, CaptureTable};
use crate::live::place::Place;
use crate::live::project::{Projector, board_lines};
use crate::style::marks::{self, Marks};
use handeye_workbench::model::Model;
use handeye_workbench::tr;

/// How far the axes reach, in squares of the board.
const AXIS_SQUARES: f64 = 3.0;
/// A large residual is drawn as long as corners are apart, within these bounds [points]: shorter ones are not seen, and
/// longer ones cover the board.
const LONG: std::ops::RangeInclusive<f64> = 6.0..=24.0;
/// Factors that are easy for mental arithmetic. Nothing is drawn shorter than it is.
const EXAGGERATIONS: [f64; 10] = [1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0, 200.0, 500.0, 1000.0];
/// Opacity of a detection of the board that is some frames old.
const OLD_SIGHT: f32 = 0.35;

/// The board as it was seen in the image that is shown, or a little earlier.
struct ShownDetection<'a> {
    corners: &'a [Corner],
    camera_from_target: Option<Pose<Camera, Target>>,
    /// 1 if it is of this image, less if it is of an earlier one.
    strength: f32,
}

/// Everything that is switched on; returns by which factor the residuals are exaggerated, if they are drawn.
pub fn paint(ui: &Ui, painter: &Painter, model: &Model, shown: &Shown<'_>, place: &Place) -> Option<f64> {
    let overlays = model.view.overlays;
    if overlays.coverage {
        coverage(painter, &rows::table(ui.ctx(), model), place);
    }
    let target = &model.document().meta.target;
    if overlays.predicted {
        predicted(painter, model, shown, target, place);
        next_board(painter, model, shown, target, place);
    }
    if shown.capture.is_none() {
        crate::by_hand::overlay::paint(painter, model, target, place);
    }
    let sight = sight(model, shown)?;
    if overlays.corners {
        corners(painter, sight.corners, target, place, sight.strength);
    }
    let times = overlays.residuals.then(|| residuals(ui, painter, model, shown, &sight, place)).flatten();
    if let (true, Some(intrinsics), Some(camera_from_target)) =
        (overlays.axes, model.intrinsics(), sight.camera_from_target)
    {
        let projector = Projector { intrinsics: &intrinsics, camera_from_target, place };
        axes(painter, &projector, target, sight.strength);
    }
    times
}

fn sight<'a>(model: &'a Model, shown: &Shown<'_>) -> Option<ShownDetection<'a>> {
    if let Some(id) = shown.capture {
        let corners = model.observed(id)?.corners.as_deref()?;
        return Some(ShownDetection { corners, camera_from_target: recorded_pose(model, shown), strength: 1.0 });
    }
    let detection = model.detection.as_ref()?;
    let frame = model.frame.as_ref()?;
    Some(ShownDetection {
        corners: detection.corners.as_deref()?,
        camera_from_target: detection.camera_from_target,
        strength: strength(frame.info.number.saturating_sub(detection.frame)),
    })
}

/// How strongly a detection of the board is drawn over an image that came this many frames later.
pub fn strength(frames_later: u64) -> f32 {
    (1.0 - 0.2 * frames_later.min(100) as f32).max(OLD_SIGHT)
}

/// The board's pose in a recorded image: as fitted, or as seen by the verification.
fn recorded_pose(model: &Model, shown: &Shown<'_>) -> Option<Pose<Camera, Target>> {
    let solved = model.solve.solved.as_ref()?;
    let id = shown.capture?;
    if let Some(at) = solved.captures.iter().position(|&other| other == id) {
        return solved.calibration.views.get(at)?.camera_from_target;
    }
    let at = solved.verified_captures.iter().position(|&other| other == id)?;
    let verification = solved.verification.as_ref()?.as_ref().ok()?;
    Some(verification.captures.get(at)?.seen_camera_from_target)
}

fn screen(place: &Place, px: &Vector2<f64>) -> Pos2 {
    place.screen(Vec2::new(px.x as f32, px.y as f32))
}

/// Circles and lines row by row in the colours of the rainbow; the first corner has a second ring.
fn corners(painter: &Painter, corners: &[Corner], target: &TargetSpec, place: &Place, strength: f32) {
    let grid = target.grid();
    let columns = grid.columns.max(1);
    let radius = (place.points_per_px() * 1.6).clamp(2.5, 9.0);
    let under = Color32::from_black_alpha((130.0 * strength) as u8);
    let mut shapes = Vec::with_capacity(3 * corners.len());
    for pair in corners.windows(2).filter(|pair| pair[0].index / columns == pair[1].index / columns) {
        let colour = marks::of_board_row(pair[0].index / columns, grid.rows).gamma_multiply(0.8 * strength);
        let line = [screen(place, &pair[0].px), screen(place, &pair[1].px)];
        shapes.push(Shape::line_segment(line, Stroke::new(1.2, colour)));
    }
    for corner in corners {
        let at = screen(place, &corner.px);
        let colour = marks::of_board_row(corner.index / columns, grid.rows).gamma_multiply(strength);
        shapes.push(Shape::circle_stroke(at, radius, Stroke::new(3.0, under)));
        shapes.push(Shape::circle_stroke(at, radius, Stroke::new(1.5, colour)));
    }
    if let Some(first) = corners.iter().find(|corner| corner.index == 0) {
        let at = screen(place, &first.px);
        let colour = Color32::WHITE.gamma_multiply(strength);
        shapes.push(Shape::circle_stroke(at, radius + 4.5, Stroke::new(3.4, under)));
        shapes.push(Shape::circle_stroke(at, radius + 4.5, Stroke::new(1.8, colour)));
    }
    painter.extend(shapes);
}

fn axes(painter: &Painter, projector: &Projector<'_>, target: &TargetSpec, strength: f32) {
    let length_m = AXIS_SQUARES * target.grid().square_m;
    let origin = Point3::origin();
    // z goes into the board.
    let ends = [Point3::new(length_m, 0.0, 0.0), Point3::new(0.0, length_m, 0.0), Point3::new(0.0, 0.0, length_m)];
    for ((end, colour), name) in ends.iter().zip(Marks::over_images().axes).zip(["x", "y", "z"]) {
        let colour = colour.gamma_multiply(strength);
        for piece in projector.line(&origin, end) {
            marks::outlined_line(painter, &piece, 2.4, colour);
        }
        if let Some(at) = projector.point(&(end * 1.14)) {
            let font = egui::FontId::proportional(12.0);
            for (offset, colour) in [(Vec2::splat(1.0), Color32::from_black_alpha(170)), (Vec2::ZERO, colour)] {
                painter.text(at + offset, egui::Align2::CENTER_CENTER, name, font.clone(), colour);
            }
        }
    }
}

/// Where the board is expected in the image that is shown: where tracking finds it in the live one while it is tracked, because it
/// may then be anywhere; otherwise where robot pose and calibration predict it. With the calibration used.
pub fn expected<'a>(model: &'a Model, shown: &Shown<'_>) -> Option<(&'a Predictor, Pose<Camera, Target>)> {
    let base_from_tip = shown.base_from_tip.as_ref()?;
    if shown.capture.is_some() || !model.track.on {
        let calibrated = model.calibrated()?;
        return Some((calibrated, calibrated.camera_from_target(base_from_tip)));
    }
    let by = model.track.by.as_ref()?;
    let info = &model.frame.as_ref()?.info;
    let base_from_tip = by.base_from_tip(*base_from_tip, &info.joints_rad)?;
    let now = model.track.newest.as_ref()?.update.estimate.as_ref()?.carried_to(info.sim_time_s);
    let calibrated = &by.setup.calibrated;
    Some((calibrated, calibrated.base_from_camera(&base_from_tip).inverse() * now.base_from_target))
}

/// The board where it is expected.
fn predicted(painter: &Painter, model: &Model, shown: &Shown<'_>, target: &TargetSpec, place: &Place) {
    let Some((calibrated, camera_from_target)) = expected(model, shown) else { return };
    let projector = Projector { intrinsics: &calibrated.intrinsics, camera_from_target, place };
    // An answer for another set of captures is drawn dimmed.
    let colour = Marks::over_images().predicted.gamma_multiply(if model.solve.fresh { 1.0 } else { 0.5 });
    let lines = board_lines(target);
    for [from, to] in &lines.inside {
        for piece in projector.line(from, to) {
            painter.line(piece, Stroke::new(1.0, colour.gamma_multiply(0.45)));
        }
    }
    for [from, to] in &lines.around {
        for piece in projector.line(from, to) {
            marks::outlined_line(painter, &piece, 1.8, colour);
        }
    }
}

/// Where the board will be at the next pose of guided capture.
fn next_board(painter: &Painter, model: &Model, shown: &Shown<'_>, target: &TargetSpec, place: &Place) {
    let next = model.planned_poses().first().filter(|_| shown.capture.is_none());
    let (Some(calibrated), Some(next)) = (model.calibrated(), next) else { return };
    let camera_from_target = calibrated.camera_from_target(&next.base_from_tip);
    let projector = Projector { intrinsics: &calibrated.intrinsics, camera_from_target, place };
    let palette = Marks::over_images();
    for [from, to] in &board_lines(target).around {
        for piece in projector.line(from, to) {
            painter.line(piece.clone(), Stroke::new(3.2, Color32::from_black_alpha(90)));
            painter.extend(Shape::dashed_line(&piece, Stroke::new(1.8, palette.planned), 7.0, 5.0));
        }
    }
    if let Some(at) = projector.point(&target.centre()) {
        let words = tr!(model.view.language, "Next pose");
        marks::plate(painter, at, words, palette.planned);
    }
}

/// Where boards were in past captures, and where none ever was.
fn coverage(painter: &Painter, table: &CaptureTable, place: &Place) {
    let Some(coverage) = &table.coverage else { return };
    let (columns, rows) = (coverage.columns, coverage.rows);
    let cell = place.image.size() / Vec2::new(columns.max(1) as f32, rows.max(1) as f32);
    for row in 0..rows {
        for column in 0..columns {
            if coverage.count(column, row) == 0 {
                let min = place.image.min + Vec2::new(column as f32, row as f32) * cell;
                painter.rect_filled(Rect::from_min_size(min, cell).shrink(0.5), 0.0, Color32::from_black_alpha(90));
            }
        }
    }
    let (width, height) = table.image_size;
    // Images of another size, of an older camera setting, are stretched like the cells.
    let scale = place.size_px / Vec2::new(width.max(1) as f32, height.max(1) as f32);
    for (outline, &row) in coverage.outlines.iter().zip(&table.outlined) {
        let Some(row) = table.rows.get(row) else { continue };
        let colour = marks::of_capture(Marks::over_images(), row.excluded, row.verifies()).gamma_multiply(0.75);
        let points: Vec<Pos2> = outline
            .px
            .iter()
            .map(|px| place.screen(Vec2::new(px.x as f32 + 0.5, px.y as f32 + 0.5) * scale - Vec2::splat(0.5)))
            .collect();
        painter.add(Shape::closed_line(points, Stroke::new(1.2, colour)));
    }
}

/// Where the corners of the live image should be: from the board's pose in this one image while it is tracked, since
/// the calibrated board is no longer there; otherwise from robot and calibration alone.
pub fn live_chain(model: &Model) -> Option<Pose<Camera, Target>> {
    let (calibrated, detection) = (model.calibrated()?, model.detection.as_ref()?);
    if model.track.on {
        detection.camera_from_target
    } else {
        Some(calibrated.camera_from_target(detection.base_from_tip.as_ref()?))
    }
}

/// Measured minus predicted, exaggerated: a recorded image has those of its fit or verification, the live one those of
/// the bare chain, or of the pose of the tracked board. Returns the factor.
fn residuals(
    ui: &Ui,
    painter: &Painter,
    model: &Model,
    shown: &Shown<'_>,
    sight: &ShownDetection<'_>,
    place: &Place,
) -> Option<f64> {
    let arrows: Vec<(Vector2<f64>, Vector2<f64>)> = match shown.capture {
        Some(id) => rows::residuals(model, id).iter().map(|it| (it.px, it.residual_px)).collect(),
        None => live_residuals(model, sight.corners),
    };
    // Without the zoom, so that they grow with the image.
    let scale = f64::from(place.points_per_px() / model.viewport.zoom.max(1.0));
    let key = Id::new("exaggeration of residuals");
    let long = (apart_px(sight.corners) * scale).clamp(*LONG.start(), *LONG.end());
    let times = exaggeration(arrows.iter().map(|(_, residual_px)| residual_px.norm() * scale), long, kept(ui, key))?;
    ui.data_mut(|data| data.insert_temp(key, times));
    let colour = Marks::over_images().residual.gamma_multiply(sight.strength);
    for (px, residual_px) in &arrows {
        let (from, to) = (screen(place, px), screen(place, &(px + residual_px * times)));
        if !(to.x.is_finite() && to.y.is_finite()) {
            continue;
        }
        marks::outlined_line(painter, &[from, to], 1.4, colour);
        let along = to - from;
        if along.length() > 5.0 {
            let back = -along.normalized() * 4.0;
            for side in [back.rot90(), -back.rot90()] {
                painter.line_segment([to, to + back + side * 0.6], Stroke::new(1.4, colour));
            }
        }
    }
    Some(times)
}

fn kept(ui: &Ui, key: Id) -> Option<f64> {
    ui.data(|data| data.get_temp(key))
}

/// Distance of neighbours in a row; 0 without any.
fn apart_px(corners: &[Corner]) -> f64 {
    let neighbours = corners.windows(2).filter(|pair| pair[0].index + 1 == pair[1].index);
    median_high(neighbours.map(|pair| (pair[1].px - pair[0].px).norm())).unwrap_or(0.0)
}

/// By which factor residuals of these lengths on the screen are exaggerated, so that nine of ten are no longer than
/// `long`. The last factor is kept while it does about the same: it would flicker in a live image otherwise. `None`
/// without residuals.
fn exaggeration(lengths: impl Iterator<Item = f64>, long: f64, kept: Option<f64>) -> Option<f64> {
    let mut lengths: Vec<f64> = lengths.filter(|length| length.is_finite()).collect();
    lengths.sort_by(f64::total_cmp);
    let large = *lengths.get(lengths.len() * 9 / 10)?;
    let suits = |times: f64| (long / 4.0..=long * 1.2).contains(&(large * times));
    if let Some(kept) = kept.filter(|&kept| suits(kept)) {
        return Some(kept);
    }
    let fits = |times: &f64| large * times <= long;
    Some(EXAGGERATIONS.into_iter().rev().find(fits).unwrap_or(1.0))
}

/// Corners of the live image, and measured minus predicted.
pub fn live_residuals(model: &Model, corners: &[Corner]) -> Vec<(Vector2<f64>, Vector2<f64>)> {
    let (Some(calibrated), Some(camera_from_target)) = (model.calibrated(), live_chain(model)) else {
        return Vec::new();
    };
    // The pose of a tracked board assumes a flat one of the stated size.
    let shape = if model.track.on { BoardShape::default() } else { calibrated.shape };
    let board = calibrated.board(&model.document().meta.target);
    let residual = |corner: &Corner| {
        let point = camera_from_target.isometry() * board.point(corner.index, &shape);
        let predicted_px = calibrated.intrinsics.project(&point).ok()?;
        Some((corner.px, corner.px - predicted_px))
    };
    corners.iter().filter(|corner| corner.index < board.len()).filter_map(residual).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn large_residuals_are_drawn_as_they_are_and_small_ones_so_that_they_can_be_seen() {
        let times = |length: f64, kept| exaggeration((1..=20).map(|_| length), 24.0, kept);
        assert_eq!(times(0.1, None), Some(200.0));
        assert_eq!(times(0.5, None), Some(20.0));
        assert_eq!(times(300.0, None), Some(1.0));
        assert_eq!(times(0.0, None), Some(1000.0));
        assert_eq!(times(0.13, Some(200.0)), Some(200.0), "it stands still while it does about the same");
        assert_eq!(times(1.0, Some(200.0)), Some(20.0));
        assert_eq!(exaggeration(std::iter::empty(), 24.0, Some(5.0)), None);
    }

    #[test]
    fn one_wrong_corner_does_not_shrink_all_others() {
        let lengths = || (1..=19).map(|_| 0.1).chain([500.0]);
        assert_eq!(exaggeration(lengths(), 24.0, None), Some(200.0));
    }
}
