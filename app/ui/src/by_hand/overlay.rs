//! The wanted view, over the live image: an outline, an arrow from each corner of the board to where it has to go, and what to
//! change in words.

use egui::{Align2, Color32, Painter, Pos2, Shape, Stroke};
use handeye_geometry::frames::{Camera, Pose, Target};
use handeye_geometry::targets::TargetSpec;

use super::section::to_do;
use crate::live::{
    place::Place,
    project::{Projector, board_lines},
};
use crate::style::marks::{self, Marks};
use handeye_workbench::by_hand::state::HandWaits;
use handeye_workbench::model::Model;

/// Size of the words over the image.
const WORDS: f32 = 16.0;
/// A shorter arrow is not drawn.
const SHORTEST: f32 = 10.0;

pub fn paint(painter: &Painter, model: &Model, target: &TargetSpec, place: &Place) {
    let Some(hand) = model.by_hand.as_deref() else { return };
    let is_good = hand.judged.is_some_and(|judged| judged.is_good) || hand.waits == HandWaits::Capture;
    let colours = Marks::over_images();
    let colour = if is_good { colours.axes[1] } else { colours.planned };
    if let Some(wanted) = &hand.wanted {
        let projector = |pose: &Pose<Camera, Target>| Projector {
            intrinsics: wanted.intrinsics(),
            camera_from_target: *pose,
            place,
        };
        let goal = projector(&wanted.camera_from_target);
        let now = hand.judged.and_then(|judged| judged.present).map(|present| projector(&present));
        for [from, to] in &board_lines(target).around {
            for piece in goal.line(from, to) {
                painter.line(piece.clone(), Stroke::new(4.0, Color32::from_black_alpha(90)));
                painter.extend(Shape::dashed_line(&piece, Stroke::new(2.4, colour), 9.0, 5.0));
            }
            let ends = now.as_ref().and_then(|now| Some((now.point(from)?, goal.point(from)?)));
            if let Some((start, end)) = ends.filter(|(start, end)| start.distance(*end) > SHORTEST) {
                arrow(painter, start, end, colour);
            }
        }
    }
    let words = to_do(hand).in_language(model.view.language);
    let at = Pos2::new(place.visible.center().x, place.visible.bottom() - 8.0);
    marks::plate_at(painter, (Align2::CENTER_BOTTOM, at), &words, WORDS, colour);
}

fn arrow(painter: &Painter, from: Pos2, to: Pos2, colour: Color32) {
    painter.arrow(from, to - from, Stroke::new(3.6, Color32::from_black_alpha(110)));
    painter.arrow(from, to - from, Stroke::new(1.8, colour));
}
