//! Poses that guided capture has planned: where the camera, or the board, will be.

use egui::Color32;
use handeye_geometry::frames::{Base, Pose, Tip};

use super::board::{self, Line};
use super::camera::Frustum;
use super::canvas::Canvas;
use super::legend::{Entry, Sign};
use crate::style::theme::Palette;
use handeye_workbench::model::Model;
use handeye_workbench::scene::{Known, PlannedItem};
use handeye_workbench::text::Language;
use handeye_workbench::tr;

/// Length of a frustum [m]: as for a capture, which it becomes.
const LENGTH_M: f64 = 0.06;
/// How strong the poses after the next one are.
const LATER: f32 = 0.45;

/// Draws them, the next one strongest, and returns their line of the legend.
pub fn planned(
    canvas: &mut Canvas,
    model: &Model,
    known: &Known,
    language: Language,
    palette: &Palette,
) -> Option<Entry> {
    let planned = model.planned_poses();
    for (index, proposal) in planned.iter().enumerate() {
        let (width, colour) = if index == 0 { (2.0, palette.text) } else { (1.0, palette.text.gamma_multiply(LATER)) };
        ghost(canvas, known, &proposal.base_from_tip, width, colour);
    }
    (!planned.is_empty()).then(|| Entry {
        sign: Sign::Frustum,
        colour: palette.text,
        name: tr!(language, "Planned poses").to_owned(),
        what: tr!(
            language,
            "Where the camera goes next, chosen by what it adds to the answer; those after the next one may still change"
        )
        .to_owned(),
    })
}

fn ghost(canvas: &mut Canvas, known: &Known, base_from_tip: &Pose<Base, Tip>, width: f32, colour: Color32) {
    match known.planned(base_from_tip) {
        Some(PlannedItem::Board(base_from_target, target)) => {
            board::outlined(canvas, &base_from_target, &target, (width, colour), Line::Dashed);
        }
        Some(PlannedItem::Camera(base_from_camera, intrinsics)) => {
            let frustum = Frustum { base_from_camera, intrinsics: &intrinsics, length_m: LENGTH_M };
            frustum.draw(canvas, width, colour, colour.gamma_multiply(0.06));
        }
        None => canvas.dot(&base_from_tip.translation().into(), 3.0 + width, colour),
    }
}
