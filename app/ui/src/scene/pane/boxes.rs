//! Boxes that the arm keeps out of: those of the user, and the obstacles that the cell reports.

use egui::{Color32, Stroke};
use handeye_plan::{Obstacle, WorkVolume};
use nalgebra::Point3;

use super::canvas::Canvas;
use super::legend::{Entry, Sign};
use crate::style::theme::Palette;
use handeye_workbench::keep_out::state::KeepOut;
use handeye_workbench::text::Language;
use handeye_workbench::tr;

/// Corners of each face, by their indices in [`Obstacle::corners`].
const FACES: [[usize; 4]; 6] = [[0, 1, 3, 2], [4, 5, 7, 6], [0, 1, 5, 4], [2, 3, 7, 6], [0, 2, 6, 4], [1, 3, 7, 5]];
/// Corners that differ in one coordinate.
const EDGES: [[usize; 2]; 12] =
    [[0, 1], [2, 3], [4, 5], [6, 7], [0, 2], [1, 3], [4, 6], [5, 7], [0, 4], [1, 5], [2, 6], [3, 7]];
/// A shape of the scene with a longer edge \[m\] is a floor or a wall, whose box would hide the cell.
const LONGEST_DRAWN_M: f64 = 2.5;

/// Draws them, and returns their lines of the legend.
pub fn boxes(canvas: &mut Canvas, keep_out: &KeepOut, language: Language, palette: &Palette) -> Vec<Entry> {
    let mut entries = Vec::new();
    let scene_obstacles = keep_out.scene_obstacles.iter().flat_map(|scene_obstacles| &scene_obstacles.obstacles);
    let mut small = scene_obstacles.filter(|it| it.size_m.iter().all(|edge_m| *edge_m <= LONGEST_DRAWN_M)).peekable();
    if small.peek().is_some() {
        entries.push(Entry {
            sign: Sign::Line,
            colour: palette.weak,
            name: tr!(language, "Shapes of the scene").to_owned(),
            what: tr!(language, "Boxes about the shapes that the cell says stand around; the arm keeps clear of them")
                .to_owned(),
        });
    }
    for obstacle in small {
        edges(canvas, &obstacle.corners(), Stroke::new(1.0, palette.weak.gamma_multiply(0.6)));
    }
    let own = &keep_out.around;
    for obstacle in &own.obstacles {
        solid(canvas, obstacle, palette.bad, palette);
    }
    if let Some(volume) = &own.volume {
        edges(canvas, &corners(volume), Stroke::new(1.2, palette.bad.gamma_multiply(0.7)));
    }
    if keep_out.unkept.is_none() && (!own.obstacles.is_empty() || own.volume.is_some()) {
        entries.push(Entry {
            sign: Sign::Line,
            colour: palette.bad,
            name: tr!(language, "Keep-out boxes").to_owned(),
            what: tr!(
                language,
                "Boxes of your own, and the work volume; the arm keeps to them from its next motion on"
            )
            .to_owned(),
        });
    }
    entries
}

/// The rectangle of a box that is being drawn.
pub fn rectangle(canvas: &mut Canvas, [from, to]: [Point3<f64>; 2], palette: &Palette) {
    let at = |x: f64, y: f64| Point3::new(x, y, 0.0);
    let corners = [at(from.x, from.y), at(to.x, from.y), at(to.x, to.y), at(from.x, to.y)];
    canvas.face(&corners, palette.bad.gamma_multiply(0.25));
    for side in 0..4 {
        canvas.line([corners[side], corners[(side + 1) % 4]], Stroke::new(1.6, palette.bad));
    }
}

fn solid(canvas: &mut Canvas, obstacle: &Obstacle, colour: Color32, palette: &Palette) {
    let corners = obstacle.corners();
    for face in FACES {
        canvas.face(&face.map(|corner| corners[corner]), colour.gamma_multiply(0.14));
    }
    edges(canvas, &corners, Stroke::new(1.6, colour));
    let top = corners.iter().max_by(|a, b| a.z.total_cmp(&b.z)).expect("eight");
    canvas.words(top, &obstacle.name, palette.text);
}

fn edges(canvas: &mut Canvas, corners: &[Point3<f64>; 8], stroke: Stroke) {
    for [from, to] in EDGES {
        canvas.line([corners[from], corners[to]], stroke);
    }
}

fn corners(volume: &WorkVolume) -> [Point3<f64>; 8] {
    std::array::from_fn(|corner| {
        let side = |axis: usize| if corner >> axis & 1 == 1 { volume.max_m[axis] } else { volume.min_m[axis] };
        Point3::new(side(0), side(1), side(2))
    })
}
