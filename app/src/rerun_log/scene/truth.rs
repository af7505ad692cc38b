//! What a simulated cell says is true: its camera and its board, in another colour.

use handeye_core::frames::{Base, Pose, Target, Tip};
use rerun::AsComponents;

use super::convert::{axes, outline, pinhole, transform};
use super::error::RecordError;
use super::known::Known;
use super::paths::{self, below};
use super::pen::Pen;
use super::style;

/// Camera and board where they truly are with the tip there; nothing where the cell does not say.
pub(super) fn write(pen: Pen<'_>, known: &Known, base_from_tip: &Pose<Base, Tip>) -> Result<(), RecordError> {
    let Some(truth) = known.truth() else { return Ok(()) };
    let camera = transform(&truth.base_from_camera(base_from_tip));
    pen.write(paths::TRUE_CAMERA, &[&camera as &dyn AsComponents, &axes(style::AXES)])?;
    if let Some(intrinsics) = &truth.intrinsics {
        let lens = pinhole(intrinsics, style::LIVE_IMAGE_PLANE, style::TRUE, style::THIN_UI_POINTS);
        pen.write(&below(paths::TRUE_CAMERA, paths::LENS), &lens)?;
    }
    truth.base_from_target(base_from_tip).map_or(Ok(()), |board| write_board(pen, known, &board))
}

/// The camera alone, as often as the tip moves.
pub(super) fn write_camera(pen: Pen<'_>, known: &Known, base_from_tip: &Pose<Base, Tip>) -> Result<(), RecordError> {
    let Some(truth) = known.truth() else { return Ok(()) };
    let camera = transform(&truth.base_from_camera(base_from_tip));
    pen.write(paths::TRUE_CAMERA, &[&camera as &dyn AsComponents, &axes(style::AXES)])
}

/// The board, which a cell may move.
pub(super) fn write_board(
    pen: Pen<'_>,
    known: &Known,
    base_from_target: &Pose<Base, Target>,
) -> Result<(), RecordError> {
    pen.write(paths::TRUE_BOARD, &[&transform(base_from_target) as &dyn AsComponents, &axes(style::AXES)])?;
    let Some(target) = &known.target else { return Ok(()) };
    pen.write(&below(paths::TRUE_BOARD, paths::OUTLINE), &outline(target, style::TRUE))
}
