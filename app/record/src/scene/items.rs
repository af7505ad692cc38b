//! Cameras and boards of the scene as entities.

use super::convert::{outline, pinhole};
use super::error::RecordError;
use super::paths::{self, below};
use super::pen::Pen;
use super::style;
use handeye_workbench::scene::{BoardItem, CameraItem, Known, Role};

/// A camera with its lens. Without a place there is no lens either, or images would appear in the base.
pub(super) fn write_camera(pen: Pen<'_>, known: &Known, camera: Option<CameraItem>) -> Result<(), RecordError> {
    let Some(CameraItem { role, place, shape }) = camera else { return Ok(()) };
    let path = if role == Role::True { paths::TRUE_CAMERA } else { paths::camera(known.mode()) };
    pen.frame(path, place.isometry(), style::AXES)?;
    let Some(intrinsics) = &shape else { return Ok(()) };
    let lens = pinhole(intrinsics, style::LIVE_IMAGE_PLANE, style::of(role), style::THIN_UI_POINTS);
    pen.write(&below(path, paths::LENS), &lens)
}

/// A board with its outline.
pub(super) fn write_board(pen: Pen<'_>, known: &Known, board: Option<BoardItem>) -> Result<(), RecordError> {
    let Some(BoardItem { role, place, shape }) = board else { return Ok(()) };
    let path = match role {
        Role::Predictor | Role::Reported => paths::board(known.mode()),
        Role::Tracked => paths::TRACKED_BOARD,
        Role::True => paths::TRUE_BOARD,
    };
    pen.frame(path, place.isometry(), style::AXES)?;
    let Some(target) = &shape else { return Ok(()) };
    pen.write(&below(path, paths::OUTLINE), &outline(target, style::of(role)))
}
