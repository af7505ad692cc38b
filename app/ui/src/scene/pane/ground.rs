//! The plane z = 0 of the base and its axes.

use egui::{Color32, Stroke};
use nalgebra::{Isometry3, Point3, Vector3};

use super::canvas::Canvas;
use crate::style::theme::Palette;

/// Distance of the lines \[mm\].
pub const SPACING_MM: i32 = 100;
/// Number of lines at each side of the centre.
const LINES: i32 = 10;
/// Every this many lines one is stronger.
const MAJOR: i32 = 5;
/// Length of the axes \[m\].
const AXES_M: f64 = 0.3;

/// The grid, and the axes of the base with their names.
pub fn ground(canvas: &mut Canvas, palette: &Palette, axes: [Color32; 3]) {
    let metres = |lines: i32| f64::from(lines * SPACING_MM) * 1e-3;
    let end = metres(LINES);
    for line in -LINES..=LINES {
        let at = metres(line);
        let strength = if line % MAJOR == 0 { 1.0 } else { 0.45 };
        let stroke = Stroke::new(1.0, palette.edge.gamma_multiply(strength));
        canvas.ground_line([Point3::new(at, -end, 0.0), Point3::new(at, end, 0.0)], stroke);
        canvas.ground_line([Point3::new(-end, at, 0.0), Point3::new(end, at, 0.0)], stroke);
    }
    canvas.axes(&Isometry3::identity(), AXES_M, 2.0, axes);
    for ((axis, colour), name) in [Vector3::x(), Vector3::y(), Vector3::z()].into_iter().zip(axes).zip(["x", "y", "z"])
    {
        canvas.words(&Point3::from(axis * (AXES_M * 1.1)), name, colour);
    }
}
