//! What there is to see in the cell, and what of it is known how.

use egui::{Color32, Stroke, Ui};
use handeye_core::frames::{Base, Camera, Pose, Target, Tip};
use handeye_core::handeye::HandEye;
use handeye_core::session::CaptureId;
use nalgebra::Point3;

use super::arm;
use super::board::{self, Line};
use super::camera::Frustum;
use super::canvas::Canvas;
use super::captures::{self, Spot};
use super::ground::{self, SPACING_MM};
use super::legend::{Entry, Sign};
use crate::gui::captures::CaptureTable;
use crate::gui::marks::Marks;
use crate::gui::theme::Palette;
use crate::model::Model;
use crate::text::Language;
use crate::{text, tr};

/// Length of the frustum of the live camera \[m\].
const CAMERA_LENGTH_M: f64 = 0.2;
/// Length of the axes of tip and camera \[m\].
const AXES_M: f64 = 0.08;

/// Where a pose comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum KnownBy {
    /// The calibration.
    Calibration,
    /// What the cell says of itself.
    Cell,
}

/// The camera when the robot reports a pose: by the calibration, or else by what the cell says of it.
pub fn base_from_camera(model: &Model, base_from_tip: &Pose<Base, Tip>) -> Option<(Pose<Base, Camera>, KnownBy)> {
    if let Some(calibrated) = model.calibrated() {
        return Some((calibrated.base_from_camera(base_from_tip), KnownBy::Calibration));
    }
    let truth = model.cell.as_ref()?.truth.as_ref()?;
    Some((*base_from_tip * truth.tip_from_camera, KnownBy::Cell))
}

/// The board by the calibration: where it stood, or on the tip where it is now.
fn calibrated_board(model: &Model) -> Option<Pose<Base, Target>> {
    match model.calibrated()?.hand_eye {
        HandEye::EyeInHand { base_from_target, .. } => Some(base_from_target),
        HandEye::EyeToHand { tip_from_target, .. } => Some(model.robot.as_ref()?.base_from_tip * tip_from_target),
    }
}

/// The board as it is tracked now.
fn tracked_board(model: &Model) -> Option<Pose<Base, Target>> {
    let newest = model.track.newest.as_ref().filter(|_| model.track.on)?;
    newest.update.estimate.as_ref().map(|estimate| estimate.base_from_target)
}

/// The board where a simulated cell says that it is, as new as possible.
fn true_board(model: &Model) -> Option<Pose<Base, Target>> {
    let of_frame = model.frame.as_ref().and_then(|frame| frame.info.base_from_target_true);
    of_frame.or_else(|| model.cell.as_ref()?.truth.as_ref()?.base_from_target)
}

/// Whether there is anything of the cell to draw.
pub fn is_empty(model: &Model) -> bool {
    model.robot.is_none() && model.document().captures.is_empty() && model.calibrated().is_none()
}

/// What was drawn.
pub struct Drawn {
    /// What its lines mean.
    pub entries: Vec<Entry>,
    /// The captures.
    pub spots: Vec<Spot>,
}

/// Draws all of it.
pub fn draw(canvas: &mut Canvas, ui: &Ui, model: &Model, table: &CaptureTable, pointed: Option<CaptureId>) -> Drawn {
    let (palette, marks, language) = (Palette::of(ui), Marks::of(ui), model.view.language);
    ground::ground(canvas, palette, marks.axes);
    let mut entries = Vec::new();
    trail(canvas, model, palette, &mut entries);
    arm::arm(canvas, model, palette);
    if let Some(robot) = model.robot.as_ref().filter(|robot| robot.base_from_tip.is_finite()) {
        canvas.axes(robot.base_from_tip.isometry(), AXES_M, 2.2, marks.axes);
    }
    live_camera(canvas, model, palette, &mut entries);
    let spots = captures::captures(canvas, model, table, palette, marks, pointed);
    if !table.rows.is_empty() {
        entries.push(Entry {
            sign: Sign::Frustum,
            colour: marks.fit,
            name: tr!(language, "Capture poses").to_owned(),
            what: tr!(
                language,
                "From where captures were taken. Those of the fit turn to the colour of a warning as their residual goes \
                 to three times the median or over the outlier line, and have it when the estimate set them aside; \
                 verifying and excluded ones have the colours of the charts. Click one to look at its picture."
            )
            .to_owned(),
        });
    }
    boards(canvas, model, palette, marks, &mut entries);
    entries.push(grid_entry(palette, language));
    Drawn { entries, spots }
}

fn grid_entry(palette: &Palette, language: Language) -> Entry {
    Entry {
        sign: Sign::Grid,
        colour: palette.weak,
        name: text!("Grid: {spacing} mm", spacing = SPACING_MM).say(language),
        what: text!(
            "The plane z = 0 of the base; its lines are {spacing} mm apart, the stronger ones 500 mm. Axes: x red, y green, \
             z blue.",
            spacing = SPACING_MM
        )
        .say(language),
    }
}

fn live_camera(canvas: &mut Canvas, model: &Model, palette: &Palette, entries: &mut Vec<Entry>) {
    let language = model.view.language;
    // A camera that stands still is known without the robot.
    let base_from_tip = model.robot.as_ref().map_or_else(Pose::identity, |robot| robot.base_from_tip);
    let is_fixed = matches!(model.calibrated().map(|it| it.hand_eye), Some(HandEye::EyeToHand { .. }));
    if (model.robot.is_none() && !is_fixed) || !base_from_tip.is_finite() {
        return;
    }
    let (Some((base_from_camera, from)), Some(intrinsics)) =
        (base_from_camera(model, &base_from_tip), model.intrinsics())
    else {
        return;
    };
    let frustum = Frustum { base_from_camera, intrinsics: &intrinsics, length_m: CAMERA_LENGTH_M };
    let colour = palette.good;
    frustum.draw(canvas, 1.8, colour, colour.gamma_multiply(0.10));
    let (name, what) = match from {
        KnownBy::Calibration => (
            tr!(language, "Camera"),
            tr!(language, "The camera where the calibration has it, and what it sees up to 200 mm in front of it"),
        ),
        KnownBy::Cell => (
            tr!(language, "Camera, as the cell says"),
            tr!(language, "There is no calibration yet: this is where the simulated cell says that its camera is"),
        ),
    };
    entries.push(Entry { sign: Sign::Frustum, colour, name: name.to_owned(), what: what.to_owned() });
}

fn boards(canvas: &mut Canvas, model: &Model, palette: &Palette, marks: &Marks, entries: &mut Vec<Entry>) {
    let language = model.view.language;
    let target = model.document().meta.target;
    let (calibrated, tracked) = (calibrated_board(model), tracked_board(model));
    if let Some(pose) = tracked.filter(Pose::is_finite) {
        board::printed(canvas, &pose, &target, palette);
        board::outlined(canvas, &pose, &target, (2.0, marks.predicted), Line::Solid);
        entries.push(Entry {
            sign: Sign::Board,
            colour: marks.predicted,
            name: tr!(language, "Board, tracked").to_owned(),
            what: tr!(language, "The board where tracking has it now").to_owned(),
        });
    }
    if let Some(pose) = calibrated.filter(Pose::is_finite) {
        if tracked.is_none() {
            board::printed(canvas, &pose, &target, palette);
        } else {
            board::outlined(canvas, &pose, &target, (1.2, palette.weak), Line::Solid);
        }
        entries.push(Entry {
            sign: if tracked.is_none() { Sign::Board } else { Sign::Line },
            colour: palette.weak,
            name: tr!(language, "Board, calibrated").to_owned(),
            what: tr!(language, "The board where the calibration found it in its captures").to_owned(),
        });
    }
    if let Some(pose) = true_board(model).filter(Pose::is_finite) {
        board::outlined(canvas, &pose, &target, (1.8, marks.truth), Line::Dashed);
        entries.push(Entry {
            sign: Sign::Dashes,
            colour: marks.truth,
            name: tr!(language, "Board, true").to_owned(),
            what: tr!(language, "Where the simulated cell says that its board is. It is only compared with.")
                .to_owned(),
        });
    }
}

/// The path of the tip, fainter the longer ago it went there.
fn trail(canvas: &mut Canvas, model: &Model, palette: &Palette, entries: &mut Vec<Entry>) {
    let points: Vec<Point3<f64>> = model.trail.points_m().map(Point3::from).collect();
    let colour: Color32 = palette.warning;
    for (index, ends) in points.windows(2).enumerate() {
        let age = 1.0 - (index + 1) as f32 / points.len() as f32;
        canvas.line([ends[0], ends[1]], Stroke::new(1.8, colour.gamma_multiply(0.95 - 0.8 * age)));
    }
    if points.len() > 1 {
        let language = model.view.language;
        entries.push(Entry {
            sign: Sign::Line,
            colour,
            name: tr!(language, "Path of the tip").to_owned(),
            what: tr!(language, "Where the tip went last, fainter the longer ago that was").to_owned(),
        });
    }
}
