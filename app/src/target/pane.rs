//! What is looked at, where the camera sits, and what is known of it.

use egui::{Align2, CornerRadius, DragValue, FontId, Pos2, Rect, Sense, Stroke, Ui, Vec2, WidgetInfo, WidgetType};
use handeye_core::estimate::handeye::Mode;
use handeye_core::geometry::camera::{Distortion, Intrinsics};
use handeye_core::project::dataset::CameraInput;
use handeye_core::targets::{Grid, TargetSpec};

use crate::command::{Command, Outbox};
use crate::gui::style::theme::{CAPTION, Palette, Tone};
use crate::gui::style::{form, parts};
use crate::model::Model;
use crate::text::{Language, Text};
use crate::{text, tr};

/// Points of a board along one side: what people print.
const POINTS: std::ops::RangeInclusive<usize> = 2..=40;
/// Size of a square \[mm\].
const SQUARE_MM: std::ops::RangeInclusive<f64> = 0.5..=500.0;
/// Least width that the drawing of the board needs beside the numbers.
const BESIDE: f32 = 470.0;

/// Kinds of boards.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Kind {
    Chessboard,
    Circles,
    /// One that is not set up here.
    Other,
}

/// The pane.
pub fn target_ui(ui: &mut Ui, model: &Model, outbox: &mut Outbox) {
    form::body_ui(ui, |ui| {
        board_ui(ui, model, outbox);
        ui.add_space(4.0);
        mode_ui(ui, model, outbox);
        ui.add_space(4.0);
        camera_ui(ui, model, outbox);
    });
}

fn board_ui(ui: &mut Ui, model: &Model, outbox: &mut Outbox) {
    let language = model.view.language;
    let target = &model.document().meta.target;
    form::heading_ui(ui, tr!(language, "Board"));
    let beside = ui.available_width() >= BESIDE;
    ui.horizontal_top(|ui| {
        ui.vertical(|ui| numbers_ui(ui, target, language, outbox));
        if beside {
            ui.add_space(8.0);
            let width = (ui.available_width() - 4.0).min(220.0);
            preview_ui(ui, target, Vec2::new(width, 128.0), language);
        }
    });
    if !beside {
        let width = ui.available_width().min(300.0);
        preview_ui(ui, target, Vec2::new(width, 128.0), language);
    }
    let hint = match target {
        TargetSpec::Chessboard(grid) => text!(
            "Count inner corners, where four squares meet: {columns} × {rows} corners are {across} × {down} squares.",
            columns = grid.columns,
            rows = grid.rows,
            across = grid.columns + 1,
            down = grid.rows + 1
        ),
        TargetSpec::Circles(_) | TargetSpec::AsymmetricCircles(_) => {
            text!("Count the dots along each side; the distance is from centre to centre.")
        }
        TargetSpec::Charuco(_) | TargetSpec::AprilGrid(_) | TargetSpec::AprilTag(_) => {
            text!("{board}. Its numbers are those of the file that it was opened from.", board = target.to_string())
        }
    };
    parts::hint_ui(ui, &hint.say(language));
    if target.is_symmetric() {
        let title = tr!(language, "This board looks the same after half a turn");
        let detail = match target {
            TargetSpec::Chessboard(_) => {
                tr!(
                    language,
                    "Its two ends look the same. Use one with an odd number of rows plus columns, such as 10 × 7."
                )
            }
            _ => tr!(language, "Its two ends look the same. A chessboard is safer."),
        };
        form::note_ui(ui, Tone::Warning, title, detail);
    }
}

fn numbers_ui(ui: &mut Ui, target: &TargetSpec, language: Language, outbox: &mut Outbox) {
    ui.spacing_mut().item_spacing.y = 6.0;
    // Targets of other kinds come from files; here they can be exchanged for one of these.
    let kind = match target {
        TargetSpec::Chessboard(_) => Kind::Chessboard,
        TargetSpec::Circles(_) => Kind::Circles,
        _ => Kind::Other,
    };
    let mut grid = target.grid();
    let choices = [(Kind::Chessboard, tr!(language, "Chessboard"), ""), (Kind::Circles, tr!(language, "Dots"), "")];
    let chosen = form::choice_ui(ui, kind, &choices);
    if kind == Kind::Other {
        if chosen.is_none() {
            return;
        }
        (grid.columns, grid.rows) = (grid.columns.max(3), grid.rows.max(3));
    }
    let (columns, rows, size) = match kind {
        Kind::Chessboard => {
            (tr!(language, "Inner corners, x"), tr!(language, "Inner corners, y"), tr!(language, "Square"))
        }
        Kind::Circles | Kind::Other => (tr!(language, "Dots, x"), tr!(language, "Dots, y"), tr!(language, "Distance")),
    };
    for (name, count) in [(columns, &mut grid.columns), (rows, &mut grid.rows)] {
        form::row_ui(ui, name, |ui| number_ui(ui, name, DragValue::new(count).range(POINTS).speed(0.05)));
    }
    let mut square_mm = grid.square_m * 1e3;
    form::row_ui(ui, size, |ui| {
        let value = DragValue::new(&mut square_mm).range(SQUARE_MM).speed(0.05).max_decimals(3).suffix(" mm");
        number_ui(ui, size, value).on_hover_text(tr!(
            language,
            "Measure it on the print: printers scale. An error of 1 % here is an error of 1 % in every distance"
        ));
    });
    // Only what was changed is written back, so that what was read keeps its last digit.
    if square_mm != grid.square_m * 1e3 {
        grid.square_m = square_mm * 1e-3;
    }
    let wanted = match chosen.unwrap_or(kind) {
        Kind::Chessboard => TargetSpec::Chessboard(grid),
        Kind::Circles => TargetSpec::Circles(grid),
        Kind::Other => *target,
    };
    if wanted != *target {
        outbox.send(Command::SetTarget(wanted));
    }
}

fn number_ui(ui: &mut Ui, name: &str, value: DragValue<'_>) -> egui::Response {
    let response = ui.add_sized(Vec2::new(92.0, 26.0), value);
    response.widget_info(|| WidgetInfo::labeled(WidgetType::DragValue, true, name));
    response
}

/// The board as it is printed, with its points and the axes of its frame.
fn preview_ui(ui: &mut Ui, target: &TargetSpec, room: Vec2, language: Language) {
    let palette = Palette::of(ui);
    let (area, response) = ui.allocate_exact_size(room, Sense::hover());
    response.widget_info(|| {
        WidgetInfo::labeled(
            WidgetType::Image,
            true,
            text!("Drawing of the board: {board}", board = target.to_string()).say(language),
        )
    });
    let Grid { columns, rows, .. } = target.grid();
    let (across, down) = (columns as f32 + 1.0, rows as f32 + 1.0);
    // Room for the letters of the axes.
    let inner = area.shrink2(Vec2::new(12.0, 10.0));
    let square = (inner.width() / across).min(inner.height() / down);
    let board = Rect::from_center_size(area.center(), Vec2::new(across, down) * square);
    let (paper, ink) = (palette.paper, palette.ink);
    ui.painter().rect(
        board.expand(4.0),
        CornerRadius::same(3),
        paper,
        Stroke::new(1.0, palette.edge),
        egui::StrokeKind::Outside,
    );
    let origin = board.min + Vec2::splat(square);
    let at = |column: usize, row: usize| origin + Vec2::new(column as f32, row as f32) * square;
    match target {
        TargetSpec::Chessboard(_) => {
            for row in 0..=rows {
                for column in 0..=columns {
                    // The square between the points (0, 0) and (1, 1) is dark.
                    if (row + column) % 2 == 0 {
                        let corner = board.min + Vec2::new(column as f32, row as f32) * square;
                        let cell = Rect::from_min_size(corner, Vec2::splat(square));
                        ui.painter().rect_filled(cell, CornerRadius::ZERO, ink);
                    }
                }
            }
        }
        // Points by their place in the lattice: enough to see how many there are and which is the first.
        _ => {
            for row in 0..rows {
                for column in 0..columns {
                    ui.painter().circle_filled(at(column, row), square * 0.3, ink);
                }
            }
        }
    }
    axes(ui, origin, square, at(columns - 1, 0), at(0, rows - 1));
}

/// The axes of the target frame from its origin.
fn axes(ui: &Ui, origin: Pos2, square: f32, end_x: Pos2, end_y: Pos2) {
    let palette = Palette::of(ui);
    let font = FontId::proportional(CAPTION);
    for (end, colour, name, anchor) in
        [(end_x, palette.axis_x, "x", Align2::LEFT_CENTER), (end_y, palette.axis_y, "y", Align2::CENTER_TOP)]
    {
        let direction = (end - origin).normalized();
        let tip = origin + direction * (2.2 * square).min((end - origin).length());
        ui.painter().line_segment([origin, tip], Stroke::new(2.0, colour));
        let out = end + direction * (square + 7.0);
        ui.painter().text(out, anchor, name, font.clone(), colour);
    }
    ui.painter().circle(origin, 3.0, palette.accent, Stroke::new(1.0, palette.paper));
}

fn mode_ui(ui: &mut Ui, model: &Model, outbox: &mut Outbox) {
    let language = model.view.language;
    let mode = model.document().meta.mode;
    form::heading_ui(ui, tr!(language, "Where the camera sits"));
    let choices =
        [(Mode::EyeInHand, tr!(language, "Eye in hand"), ""), (Mode::EyeToHand, tr!(language, "Eye to hand"), "")];
    if let Some(mode) = form::choice_ui(ui, mode, &choices) {
        outbox.send(Command::SetMode(mode));
    }
    parts::hint_ui(
        ui,
        match mode {
            Mode::EyeInHand => tr!(
                language,
                "The camera is on the robot, the board stands still. The answer is the pose of the camera in the tip frame."
            ),
            Mode::EyeToHand => tr!(
                language,
                "The camera stands still, the robot holds the board. The answer is the pose of the camera in the base frame."
            ),
        },
    );
}

fn camera_ui(ui: &mut Ui, model: &Model, outbox: &mut Outbox) {
    let language = model.view.language;
    let camera = model.document().meta.camera;
    let fixed = camera.is_some_and(|camera| camera.fixed);
    form::heading_ui(ui, tr!(language, "Camera intrinsics"));
    let choices = [
        (false, tr!(language, "Estimate"), tr!(language, "From the same captures as the hand-eye")),
        (true, tr!(language, "Fixed"), tr!(language, "Known from an earlier calibration, and taken as exact")),
    ];
    if let Some(fixed) = form::choice_ui(ui, fixed, &choices) {
        let intrinsics = start(model);
        outbox.send(Command::SetCamera(Some(match camera {
            Some(camera) => CameraInput { fixed, intrinsics: camera.intrinsics.or(Some(intrinsics)), ..camera },
            None => CameraInput { fixed, intrinsics: Some(intrinsics), model: intrinsics.distortion },
        })));
    }
    let Some(CameraInput { intrinsics: Some(before), .. }) = camera.filter(|camera| camera.fixed) else {
        parts::hint_ui(ui, tr!(language, "Focal lengths, principal point and lens are estimated with the hand-eye."));
        return;
    };
    let mut now = before;
    let size = tr!(language, "Image size");
    form::row_ui(ui, size, |ui| {
        number_ui(ui, tr!(language, "Image width"), DragValue::new(&mut now.width).range(16..=20000).suffix(" px"));
        number_ui(ui, tr!(language, "Image height"), DragValue::new(&mut now.height).range(16..=20000).suffix(" px"));
    });
    for (caption, [first, second]) in [
        (tr!(language, "Focal length"), [("fx", &mut now.fx), ("fy", &mut now.fy)]),
        (tr!(language, "Principal point"), [("cx", &mut now.cx), ("cy", &mut now.cy)]),
    ] {
        form::row_ui(ui, caption, |ui| {
            for (name, value) in [first, second] {
                let value = DragValue::new(value).speed(0.1).max_decimals(4).prefix(format!("{name} ")).suffix(" px");
                number_ui(ui, name, value).on_hover_text(text!("{name} in pixels", name = name).say(language));
            }
        });
    }
    lens_ui(ui, &mut now, language);
    if now != before {
        let known = CameraInput { fixed: true, intrinsics: Some(now), model: now.distortion };
        outbox.send(Command::SetCamera(Some(known)));
    }
    if let Err(error) = now.validate() {
        form::note_ui(ui, Tone::Bad, tr!(language, "These intrinsics cannot be"), &Text::from(error).say(language));
    }
}

fn lens_ui(ui: &mut Ui, camera: &mut Intrinsics, language: Language) {
    let choices = [
        (Distortion::None.name(), tr!(language, "None"), ""),
        ("brown_conrady", "Brown-Conrady", "k1 k2 p1 p2 k3"),
        ("rational", tr!(language, "Rational"), "k1 k2 p1 p2 k3 k4 k5 k6"),
        ("fisheye", tr!(language, "Fisheye"), "k1 k2 k3 k4"),
    ];
    ui.label(egui::RichText::new(tr!(language, "Lens model")).color(Palette::of(ui).weak));
    let chosen = form::choice_ui(ui, camera.distortion.name(), &choices);
    if let Some(model) = chosen.and_then(Distortion::from_name) {
        camera.distortion = model;
    }
    let names: &[&str] = match camera.distortion {
        Distortion::Fisheye(_) => &["k1", "k2", "k3", "k4"],
        _ => &["k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6"],
    };
    let mut coefficients = camera.distortion.coefficients().to_vec();
    ui.horizontal_wrapped(|ui| {
        for (value, name) in coefficients.iter_mut().zip(names) {
            let value = DragValue::new(value).speed(0.0005).max_decimals(8).prefix(format!("{name} "));
            number_ui(ui, name, value);
        }
    });
    camera.distortion = camera.distortion.with_coefficients(&coefficients);
}

/// Where entering intrinsics starts: what the cell says of its camera, or else a lens of 57° for the picture at hand.
fn start(model: &Model) -> Intrinsics {
    if let Some(nominal) = model.cell.as_ref().and_then(|cell| cell.nominal_intrinsics) {
        return nominal;
    }
    let (width, height) = model.frame.as_ref().map_or((640, 480), |frame| frame.images.rgb.dimensions());
    Intrinsics::from_view_angle(width, height, 57.0_f64.to_radians())
}
