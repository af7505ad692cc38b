//! The tracked board.

use handeye_geometry::point_error;
use rerun::{Points3D, Radius};

use super::camera::lens;
use super::convert::{corner_marks, ellipsoid, of_position, point};
use super::error::RecordError;
use super::items::write_board;
use super::paths::{self, below};
use super::pen::Pen;
use super::result::number;
use super::style;
use handeye_workbench::model::Tracked;
use handeye_workbench::scene::Known;

/// The result of one image; what it lacks is no longer there.
pub(super) fn write(pen: Pen<'_>, known: &Known, tracked: &Tracked) -> Result<(), RecordError> {
    let update = &tracked.update;
    write_estimate(pen, known, tracked)?;
    let seen = update.seen.as_ref();
    pen.frame_if(paths::TRACKED_BY_PNP, seen.map(|seen| &seen.base_from_target), style::SMALL_AXES)?;
    let corners = seen.map_or(&[][..], |seen| &seen.corners);
    pen.write(&below(&lens(known), paths::CORNERS), &corner_marks(corners, style::SEEN))?;
    let by_depth = update.by_depth.as_ref();
    pen.frame_if(paths::TRACKED_BY_DEPTH, by_depth.map(|it| &it.base_from_target), style::SMALL_AXES)?;
    let first_corner = by_depth.and_then(|by_depth| by_depth.first_corner_in_base);
    let first_corner = Points3D::new(first_corner.iter().map(point))
        .with_colors([style::SEEN])
        .with_radii([Radius::new_ui_points(2.0 * style::CORNER_UI_POINTS)]);
    pen.write(paths::TRACKED_FIRST_CORNER, &first_corner)?;
    if tracked.truth.is_some() {
        write_board(pen, known, known.true_board())?;
    }
    number(pen, paths::PLOT_LATENCY, Some(tracked.latency_s * 1e3))?;
    number(pen, paths::PLOT_TRACK_RATE, Some(tracked.rate_hz))?;
    number(pen, paths::PLOT_TRACK_ERROR, tracked.error.map(|error| error.position_m * 1e3))?;
    number(pen, paths::PLOT_TRACK_TURN, tracked.error.map(|error| error.rotation_rad.to_degrees()))
}

fn write_estimate(pen: Pen<'_>, known: &Known, tracked: &Tracked) -> Result<(), RecordError> {
    let Some(estimate) = &tracked.update.estimate else { return pen.clear(paths::TRACKED_BOARD) };
    write_board(pen, known, known.tracked_board())?;
    let covariance = of_position(&estimate.covariance);
    let shape = ellipsoid(&covariance, style::TRACK_UNCERTAINTY_FACTOR, style::TRACKED);
    pen.write(&below(paths::TRACKED_BOARD, paths::TRACK_UNCERTAINTY), &shape)?;
    number(pen, paths::PLOT_TRACK_SIGMA, Some(point_error::radius_95(&covariance) * 1e3))?;
    number(pen, paths::PLOT_TRACK_SPEED, Some(estimate.velocity_m_s.norm() * 1e3))
}
