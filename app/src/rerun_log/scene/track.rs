//! The board as it is tracked.

use handeye_core::handeye::quality;
use rerun::{AsComponents, Points3D, Radius};

use super::camera::lens;
use super::convert::{axes, corner_marks, ellipsoid, no_axes, of_position, outline, point, transform};
use super::error::RecordError;
use super::known::Known;
use super::paths::{self, below};
use super::pen::Pen;
use super::result::number;
use super::{style, truth};
use crate::model::Tracked;

/// What one picture has brought; what it has not is no longer there.
pub(super) fn write(pen: Pen<'_>, known: &Known, tracked: &Tracked) -> Result<(), RecordError> {
    let update = &tracked.update;
    write_estimate(pen, known, tracked)?;
    if let Some(seen) = &update.seen {
        let pose = transform(&seen.base_from_target);
        pen.write(paths::TRACKED_BY_PNP, &[&pose as &dyn AsComponents, &axes(style::SMALL_AXES)])?;
        pen.write(&below(&lens(known), paths::CORNERS), &corner_marks(&seen.corners, style::SEEN))?;
    } else {
        pen.write(paths::TRACKED_BY_PNP, &no_axes())?;
        pen.write(&below(&lens(known), paths::CORNERS), &corner_marks(&[], style::SEEN))?;
    }
    match &update.by_depth {
        Some(by_depth) => {
            let pose = transform(&by_depth.base_from_target);
            pen.write(paths::TRACKED_BY_DEPTH, &[&pose as &dyn AsComponents, &axes(style::SMALL_AXES)])?;
        }
        None => pen.write(paths::TRACKED_BY_DEPTH, &no_axes())?,
    }
    let first_corner = update.by_depth.as_ref().and_then(|by_depth| by_depth.first_corner_in_base);
    let first_corner = Points3D::new(first_corner.iter().map(point))
        .with_colors([style::SEEN])
        .with_radii([Radius::new_ui_points(2.0 * style::CORNER_UI_POINTS)]);
    pen.write(paths::TRACKED_FIRST_CORNER, &first_corner)?;
    if let Some(base_from_target) = &tracked.truth {
        truth::write_board(pen, known, base_from_target)?;
    }
    number(pen, paths::PLOT_LATENCY, Some(tracked.latency_s * 1e3))?;
    number(pen, paths::PLOT_TRACK_RATE, Some(tracked.rate_hz))?;
    number(pen, paths::PLOT_TRACK_ERROR, tracked.error.map(|error| error.position_m * 1e3))?;
    number(pen, paths::PLOT_TRACK_TURN, tracked.error.map(|error| error.rotation_rad.to_degrees()))
}

fn write_estimate(pen: Pen<'_>, known: &Known, tracked: &Tracked) -> Result<(), RecordError> {
    let Some(estimate) = &tracked.update.estimate else { return pen.clear(paths::TRACKED_BOARD) };
    let pose = transform(&estimate.base_from_target);
    pen.write(paths::TRACKED_BOARD, &[&pose as &dyn AsComponents, &axes(style::AXES)])?;
    if let Some(target) = &known.target {
        pen.write(&below(paths::TRACKED_BOARD, paths::OUTLINE), &outline(target, style::TRACKED))?;
    }
    let covariance = of_position(&estimate.covariance);
    let shape = ellipsoid(&covariance, style::TRACK_UNCERTAINTY_FACTOR, style::TRACKED);
    pen.write(&below(paths::TRACKED_BOARD, paths::TRACK_UNCERTAINTY), &shape)?;
    number(pen, paths::PLOT_TRACK_SIGMA, Some(quality::radius_95(&covariance) * 1e3))?;
    number(pen, paths::PLOT_TRACK_SPEED, Some(estimate.velocity_m_s.norm() * 1e3))
}
