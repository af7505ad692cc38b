//! A calibration: the board, how uncertain it is, the numbers, and the report.

use nalgebra::Matrix6;
use rerun::{Scalars, SeriesLines, TextDocument};

use super::convert::{board_points, ellipsoid, of_position};
use super::error::RecordError;
use super::items::{write_board, write_camera};
use super::paths::{self, below};
use super::pen::Pen;
use super::style;
use handeye_workbench::model::Solved;
use handeye_workbench::report;
use handeye_workbench::scene::Known;

/// Names of the series, for all times.
pub(super) const SERIES: [(&str, &str); 11] = [
    (paths::PLOT_RMS, "residual of the fit [px]"),
    (paths::PLOT_HELDOUT, "residual of views held out [px]"),
    (paths::PLOT_VERIFIED, "error of prediction, verification [px]"),
    (paths::PLOT_EXPECTED, "expected error, 95 % [mm]"),
    (paths::PLOT_LATENCY, "image to pose [ms]"),
    (paths::PLOT_SEARCH, "search for the board [ms]"),
    (paths::PLOT_TRACK_ERROR, "tracked position against the truth [mm]"),
    (paths::PLOT_TRACK_TURN, "tracked orientation against the truth [°]"),
    (paths::PLOT_TRACK_SIGMA, "stated for the position, 95 % [mm]"),
    (paths::PLOT_TRACK_RATE, "poses per second [1/s]"),
    (paths::PLOT_TRACK_SPEED, "speed of the board [mm/s]"),
];

/// A number of a plot.
pub(super) fn number(pen: Pen<'_>, path: &str, value: Option<f64>) -> Result<(), RecordError> {
    match value.filter(|value| value.is_finite()) {
        Some(value) => pen.write(path, &Scalars::single(value)),
        None => Ok(()),
    }
}

pub(super) fn named(name: &str) -> SeriesLines {
    SeriesLines::new().with_names([name])
}

/// The calibration that was just added to `known`.
pub(super) fn write(pen: Pen<'_>, known: &Known, solved: &Solved) -> Result<(), RecordError> {
    let calibration = &solved.calibration;
    let links = calibration.link_covariances();
    write_camera(pen, known, known.camera())?;
    if let Some(board) = known.board() {
        if let Some(target) = &board.shape {
            write_board(pen, known, Some(board))?;
            let path = paths::board(known.mode());
            pen.write(&below(path, paths::CORNERS), &board_points(target, style::ESTIMATED))?;
            write_uncertainty(pen, path, links.as_ref().map(|links| &links.target))?;
        }
        write_uncertainty(pen, paths::camera(known.mode()), links.as_ref().map(|links| &links.hand_eye))?;
    }
    number(pen, paths::PLOT_RMS, calibration.rms_px)?;
    number(pen, paths::PLOT_HELDOUT, calibration.joint.as_ref().and_then(|joint| joint.heldout_rms_px))?;
    number(pen, paths::PLOT_EXPECTED, calibration.tip_error_95_m().map(|metres| metres * 1e3))?;
    let verification = solved.verification.as_ref().and_then(|outcome| outcome.as_ref().ok());
    number(pen, paths::PLOT_VERIFIED, verification.map(|verification| verification.rms_px))?;
    pen.write(paths::REPORT, &TextDocument::from_markdown(report::markdown(solved)))?;
    let json = solved.result.to_json().map_err(|error| RecordError::Result { reason: error.to_string() })?;
    pen.write(paths::RESULT, &TextDocument::new(json))
}

/// The region in which a camera or a board may be.
fn write_uncertainty(pen: Pen<'_>, path: &str, covariance: Option<&Matrix6<f64>>) -> Result<(), RecordError> {
    let path = below(path, paths::UNCERTAINTY);
    match covariance {
        Some(c) => pen.write(&path, &ellipsoid(&of_position(c), style::UNCERTAINTY_FACTOR, style::ESTIMATED)),
        None => pen.clear(&path),
    }
}
