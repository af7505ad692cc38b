//! Colours and sizes of what is shown. A length is in metres unless its name states otherwise.

use rerun::Color;

use handeye_workbench::scene::Role;

/// Uncertainties of a calibration are drawn this many times their size, or they would not be visible.
pub const UNCERTAINTY_FACTOR: f64 = 100.0;
/// The same for a tracked board, which is known less accurately.
pub const TRACK_UNCERTAINTY_FACTOR: f64 = 10.0;
/// Residuals are drawn this many times their length: a tenth of a pixel is five.
pub const RESIDUAL_FACTOR: f64 = 50.0;

/// Axes of base and tip.
pub const LARGE_AXES: f32 = 0.1;
/// Axes of cameras and boards.
pub const AXES: f32 = 0.04;
/// Axes of what is there once per capture.
pub const SMALL_AXES: f32 = 0.02;
/// Distance at which the image of the live camera is shown.
pub const LIVE_IMAGE_PLANE: f32 = 0.12;
/// Distance at which the images of captures are shown.
pub const CAPTURE_IMAGE_PLANE: f32 = 0.04;
/// Lines of frusta and boards [points of the screen].
pub const THIN_UI_POINTS: f32 = 1.0;
/// Lines of what is selected [points of the screen].
pub const THICK_UI_POINTS: f32 = 3.5;
/// Marks of corners [points of the screen].
pub const CORNER_UI_POINTS: f32 = 2.5;

/// The live camera and the board as calibrated.
pub const ESTIMATED: Color = colour(70, 150, 255);
/// The truth from a simulated cell.
pub const TRUE: Color = colour(255, 175, 40);
/// Corners that were found.
pub const SEEN: Color = colour(60, 220, 120);
/// Corners where the calibration predicts them.
pub const PREDICTED: Color = colour(255, 80, 200);
pub const RESIDUAL: Color = colour(255, 230, 80);
/// A capture without residual.
pub const NEUTRAL: Color = colour(130, 160, 200);
/// A capture that is out of the fit.
pub const EXCLUDED: Color = colour(110, 110, 110);
/// A capture that the estimate excluded as an outlier: distinct from the green, yellow and red of residuals.
pub const SET_ASIDE: Color = colour(255, 120, 0);
/// A pose that the arm moves to.
pub const PLANNED: Color = colour(235, 235, 235);
/// The box around an obstacle of the scene.
pub const STANDING: Color = colour(120, 120, 130);
/// A box that the user keeps the arm out of.
pub const KEEP_OUT: Color = colour(220, 60, 60);
/// A capture that is selected.
pub const SELECTED: Color = colour(255, 255, 255);
/// The tracked board.
pub const TRACKED: Color = colour(190, 120, 255);
/// The trail of the tip in the whole session.
pub const PAST_WAY: Color = colour(110, 120, 140);
/// The trail of the tip since the cell was connected.
pub const WAY: Color = colour(90, 200, 230);

/// The colour for how something is known.
pub(super) fn of(role: Role) -> Color {
    match role {
        Role::Predictor | Role::Reported => ESTIMATED,
        Role::Tracked => TRACKED,
        Role::True => TRUE,
    }
}

const fn colour(red: u8, green: u8, blue: u8) -> Color {
    Color(rerun::Rgba32::from_rgb(red, green, blue))
}

/// From green over yellow to red, with `t` from 0 to 1.
pub fn residual_colour(t: f64) -> Color {
    let t = if t.is_nan() { 1.0 } else { t.clamp(0.0, 1.0) };
    let ends: [[f64; 3]; 3] = [[40.0, 190.0, 90.0], [240.0, 200.0, 50.0], [230.0, 50.0, 40.0]];
    let at = t * 2.0;
    let low = (at as usize).min(1);
    let part = at - low as f64;
    let [red, green, blue] =
        std::array::from_fn(|c| (ends[low][c] + part * (ends[low + 1][c] - ends[low][c])).round() as u8);
    Color::from_rgb(red, green, blue)
}
