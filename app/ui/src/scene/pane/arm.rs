//! The bodies of the arm.

use egui::Color32;
use handeye_cell::props;
use handeye_cell::render::Shape;
use nalgebra::Point3;

use super::canvas::{Canvas, Cylinder};
use crate::style::theme::Palette;
use handeye_workbench::scene::PosedArm;

/// Draws them; in grey if the arm is not known to be there now.
pub fn arm(canvas: &mut Canvas, arm: &PosedArm, is_live: bool, palette: &Palette) {
    let tone = |colour, palette| if is_live { tone(colour, palette) } else { grey(palette) };
    // The ends of tubes are inside the housings of an arm that has some.
    let has_housings = arm.bodies.iter().any(|(_, solid)| matches!(solid.shape, Shape::Cylinder { .. }));
    for (link, solid) in &arm.bodies {
        let base_from_shape = arm.base_from_arm * arm.links[*link] * solid.world_from_shape;
        let (ends, radius_m, closed) = match solid.shape {
            Shape::Capsule { a, b, radius } => ([a, b], radius, false),
            Shape::Cylinder { radius, half_height } => {
                ([-half_height, half_height].map(|z| Point3::new(0.0, 0.0, z)), radius, true)
            }
            // The arm has no others.
            Shape::Sphere { .. } | Shape::Box { .. } | Shape::Plane => continue,
        };
        let ends = ends.map(|end| base_from_shape * end);
        if !has_housings {
            for end in &ends {
                canvas.ball(end, radius_m, tone(solid.colour, palette));
            }
        }
        let body = Cylinder { ends, radius_m, closed };
        canvas.cylinder(&body, tone(solid.colour, palette));
    }
}

/// Colour of what is not known.
fn grey(palette: &Palette) -> Color32 {
    palette.well.lerp_to_gamma(palette.weak, 0.35)
}

/// A body in the theme of the window: bright, dark or a cover.
fn tone(colour: [f32; 3], palette: &Palette) -> Color32 {
    match colour {
        props::COVER_BLUE => palette.accent,
        props::GRAPHITE => palette.paper.lerp_to_gamma(palette.ink, 0.55),
        _ => palette.paper,
    }
}
