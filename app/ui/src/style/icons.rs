//! Small icons that are drawn, so that they are crisp and the same with every font.

use std::f32::consts::PI;

use egui::{Color32, Painter, Pos2, Rect, Shape, Stroke, Vec2};

/// An icon.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Icon {
    /// Three bars.
    Menu,
    /// An arrow that turns back.
    Undo,
    /// An arrow that turns forth.
    Redo,
    /// Done.
    Check,
    /// A cross that closes.
    Close,
}

/// Draws a sign in the middle of a rectangle, `size` points large.
pub fn draw(painter: &Painter, icon: Icon, rect: Rect, size: f32, colour: Color32) {
    let centre = rect.center();
    let at = |x: f32, y: f32| centre + Vec2::new(x, y) * size;
    let stroke = Stroke::new((size / 8.5).max(1.4), colour);
    match icon {
        Icon::Menu => {
            for y in [-0.32, 0.0, 0.32] {
                painter.line_segment([at(-0.45, y), at(0.45, y)], stroke);
            }
        }
        Icon::Undo => turn(painter, centre, size, -1.0, stroke),
        Icon::Redo => turn(painter, centre, size, 1.0, stroke),
        Icon::Check => {
            painter.add(Shape::line(vec![at(-0.36, 0.02), at(-0.1, 0.28), at(0.38, -0.28)], stroke));
        }
        Icon::Close => {
            painter.line_segment([at(-0.3, -0.3), at(0.3, 0.3)], stroke);
            painter.line_segment([at(-0.3, 0.3), at(0.3, -0.3)], stroke);
        }
    }
}

/// Half a turn with an arrow head: to the left for −1, to the right for 1.
fn turn(painter: &Painter, centre: Pos2, size: f32, side: f32, stroke: Stroke) {
    let radius = 0.30 * size;
    let middle = centre + Vec2::new(-0.04 * side * size, 0.08 * size);
    let points = (0..=16)
        .map(|i| {
            let angle = PI * (-0.5 + i as f32 / 16.0);
            middle + Vec2::new(-side * angle.cos(), angle.sin()) * radius
        })
        .collect::<Vec<_>>();
    let tip = middle + Vec2::new(0.42 * side * size, -radius);
    let end = middle + Vec2::new(0.22 * side * size, radius);
    let mut line = vec![tip];
    line.extend(points);
    line.push(end);
    painter.add(Shape::line(line, stroke));
    let head = 0.2 * size;
    let back = Vec2::new(-side * head, 0.0);
    painter.add(Shape::line(vec![tip + back + Vec2::new(0.0, -head), tip, tip + back + Vec2::new(0.0, head)], stroke));
}
