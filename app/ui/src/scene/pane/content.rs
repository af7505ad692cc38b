//! What there is to see in the cell, and how it is known.

use egui::{Color32, Stroke, Ui};
use handeye_geometry::frames::Pose;
use handeye_session::CaptureId;
use nalgebra::Point3;

use super::arm;
use super::board::{self, Line};
use super::boxes;
use super::camera::Frustum;
use super::canvas::Canvas;
use super::captures::{self, Spot};
use super::ground::{self, SPACING_MM};
use super::legend::{Entry, Sign};
use super::planned;
use crate::capture::rows::CaptureTable;
use crate::style::marks::Marks;
use crate::style::theme::Palette;
use handeye_wording::text;
use handeye_workbench::model::Model;
use handeye_workbench::scene::{BoardItem, CameraItem, CaptureUse, Known, Role, posed_arm};
use handeye_workbench::text::Language;
use handeye_workbench::tr;

/// Length of the frustum of the live camera \[m\].
const CAMERA_LENGTH_M: f64 = 0.2;
/// Length of the axes of tip and camera \[m\].
const AXES_M: f64 = 0.08;

/// Whether there is anything of the cell to draw.
pub fn is_empty(model: &Model) -> bool {
    model.robot.is_none() && model.document().captures.is_empty() && model.calibrated().is_none()
}

/// What was drawn.
pub struct Drawn {
    /// The meaning of its lines.
    pub entries: Vec<Entry>,
    /// The captures.
    pub spots: Vec<Spot>,
}

/// Draws everything.
pub fn draw(canvas: &mut Canvas, ui: &Ui, model: &Model, table: &CaptureTable, pointed: Option<CaptureId>) -> Drawn {
    let (palette, marks, language) = (Palette::of(ui), Marks::of(ui), model.view.language);
    ground::ground(canvas, palette, marks.axes);
    let mut entries = Vec::new();
    trail(canvas, model, palette, &mut entries);
    let known = Known::of(model);
    if let Some(robot) = model.robot.as_ref().filter(|robot| robot.base_from_tip.is_finite()) {
        if let Some(posed) = posed_arm(model.cell.as_ref(), &robot.base_from_tip, &robot.joints_rad) {
            arm::arm(canvas, &posed, model.is_robot_live(), palette);
        }
        let colours = if model.is_robot_live() { marks.axes } else { marks.axes.map(|_| palette.weak) };
        canvas.axes(robot.base_from_tip.isometry(), AXES_M, 2.2, colours);
    }
    entries.extend(boxes::boxes(canvas, &model.keep_out, language, palette));
    let seen = if model.is_robot_live() { palette.good } else { palette.weak };
    live_camera(canvas, &known, language, seen, &mut entries);
    let spots = captures::captures(canvas, model, &known, palette, marks, pointed);
    entries.extend(planned::planned(canvas, model, &known, language, palette));
    entries.extend(capture_entries(table, language, palette, marks));
    boards(canvas, &known, language, (palette, marks), &mut entries);
    entries.push(grid_entry(palette, language));
    Drawn { entries, spots }
}

/// One for each kind of capture that there is.
fn capture_entries(
    table: &CaptureTable,
    language: Language,
    palette: &Palette,
    marks: &Marks,
) -> impl Iterator<Item = Entry> {
    let kinds = [
        (
            CaptureUse::Fit,
            marks.fit,
            tr!(language, "Captures in the fit"),
            tr!(
                language,
                "From where they were taken. They turn to the colour of a warning as their residual goes to three times the \
                 median or over the outlier line. Click one to look at its image."
            ),
        ),
        (
            CaptureUse::Rejected,
            palette.warning,
            tr!(language, "Outliers"),
            tr!(language, "Captures that do not fit the others, and which the answer is without"),
        ),
        (
            CaptureUse::Verification,
            marks.verify,
            tr!(language, "Captures for verification"),
            tr!(language, "Captures that are not in the fit and verify it"),
        ),
        (
            CaptureUse::Excluded,
            marks.excluded,
            tr!(language, "Excluded captures"),
            tr!(language, "Captures that were taken out by hand"),
        ),
    ];
    kinds.into_iter().filter(|(used_as, ..)| table.count(*used_as) > 0).map(|(_, colour, name, what)| Entry {
        sign: Sign::Frustum,
        colour,
        name: name.to_owned(),
        what: what.to_owned(),
    })
}

fn grid_entry(palette: &Palette, language: Language) -> Entry {
    Entry {
        sign: Sign::Grid,
        colour: palette.weak,
        name: text!("Grid: {spacing} mm", spacing = SPACING_MM).in_language(language),
        what: text!(
            "The plane z = 0 of the base; its lines are {spacing} mm apart, the stronger ones 500 mm. Axes: x red, y green, \
             z blue.",
            spacing = SPACING_MM
        )
        .in_language(language),
    }
}

fn live_camera(canvas: &mut Canvas, known: &Known, language: Language, colour: Color32, entries: &mut Vec<Entry>) {
    // A fixed camera is known without the robot.
    let Some(CameraItem { role, place, shape: Some(intrinsics) }) = known.camera() else { return };
    let Some(base_from_camera) = place.in_base(known.base_from_tip.as_ref()).filter(Pose::is_finite) else { return };
    let frustum = Frustum { base_from_camera, intrinsics: &intrinsics, length_m: CAMERA_LENGTH_M };
    frustum.draw(canvas, 1.8, colour, colour.gamma_multiply(0.10));
    let (name, what) = if role == Role::Predictor {
        (
            tr!(language, "Camera"),
            tr!(language, "The camera where the calibration has it, and what it sees up to 200 mm in front of it"),
        )
    } else {
        (
            tr!(language, "Camera, as the cell says"),
            tr!(language, "There is no calibration yet: this is where the simulated cell says that its camera is"),
        )
    };
    entries.push(Entry { sign: Sign::Frustum, colour, name: name.to_owned(), what: what.to_owned() });
}

fn boards(
    canvas: &mut Canvas,
    known: &Known,
    language: Language,
    (palette, marks): (&Palette, &Marks),
    entries: &mut Vec<Entry>,
) {
    // The pattern of a tracked board is already drawn.
    let mut has_pattern = false;
    for BoardItem { role, place, shape } in known.boards() {
        let Some(target) = &shape else { continue };
        let Some(pose) = place.in_base(known.base_from_tip.as_ref()).filter(Pose::is_finite) else { continue };
        let (sign, colour, name, what) = match role {
            Role::Tracked => {
                board::printed(canvas, &pose, target, palette);
                board::outlined(canvas, &pose, target, (2.0, marks.predicted), Line::Solid);
                has_pattern = true;
                let what = tr!(language, "The board where tracking has it now");
                (Sign::Board, marks.predicted, tr!(language, "Board, tracked"), what)
            }
            Role::Predictor | Role::Reported => {
                let sign = if has_pattern {
                    board::outlined(canvas, &pose, target, (1.2, palette.weak), Line::Solid);
                    Sign::Line
                } else {
                    board::printed(canvas, &pose, target, palette);
                    Sign::Board
                };
                let what = tr!(language, "The board where the calibration found it in its captures");
                (sign, palette.weak, tr!(language, "Board, calibrated"), what)
            }
            Role::True => {
                board::outlined(canvas, &pose, target, (1.8, marks.truth), Line::Dashed);
                let what = tr!(language, "Where the simulated cell says that its board is. It is only compared with.");
                (Sign::Dashes, marks.truth, tr!(language, "Board, true"), what)
            }
        };
        entries.push(Entry { sign, colour, name: name.to_owned(), what: what.to_owned() });
    }
}

/// The path of the tip, fainter the older it is.
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
