//! The arm, its joints, and the trail of the tip.

use handeye_arm::JointKind;
use handeye_cell::render::{Shape, Solid};
use nalgebra::Vector3;
use rerun::{Capsules3D, Color, Cylinders3D, FillMode, LineStrips3D, Radius, Scalars, SeriesLines};

use super::convert::{point, quaternion, transform, vector};
use super::error::RecordError;
use super::pen::Pen;
use super::{paths, style};
use handeye_workbench::scene::PosedArm;

/// Where the arm's foot is and how its links have moved.
pub(super) fn write_arm(pen: Pen<'_>, arm: &PosedArm) -> Result<(), RecordError> {
    pen.write(paths::ARM, &transform(&arm.base_from_arm))?;
    arm.links.iter().enumerate().try_for_each(|(link, moved)| pen.write(&paths::link(link), &transform(moved)))
}

/// The solids of each link with all joints zero, replacing those that are written already.
pub(super) fn write_solids(
    pen: Pen<'_>,
    bodies: &[(usize, Solid)],
    written: &[(usize, Solid)],
) -> Result<(), RecordError> {
    let last = bodies.iter().chain(written).map(|(link, _)| *link).max().unwrap_or(0);
    for index in 0..=last {
        let link = paths::link(index);
        let had = |is_kind: fn(&Shape) -> bool| written.iter().any(|(link, s)| *link == index && is_kind(&s.shape));
        let (mut cylinders, mut capsules) = (Vec::new(), Vec::new());
        for (_, solid) in bodies.iter().filter(|(link, _)| *link == index) {
            match solid.shape {
                Shape::Cylinder { radius, half_height } => {
                    cylinders.push((solid, radius as f32, (2.0 * half_height) as f32));
                }
                Shape::Capsule { a, b, radius } => {
                    let ends = [a, b].map(|end| point(&(solid.world_from_shape * end)));
                    capsules.push((solid, ends, radius as f32));
                }
                // The arm has no other shapes; the image of one that had some would lack them.
                Shape::Sphere { .. } | Shape::Box { .. } | Shape::Plane => {}
            }
        }
        if !cylinders.is_empty() || had(|shape| matches!(shape, Shape::Cylinder { .. })) {
            let housings = Cylinders3D::from_lengths_and_radii(
                cylinders.iter().map(|(_, _, length)| *length),
                cylinders.iter().map(|(_, radius, _)| *radius),
            )
            .with_centers(cylinders.iter().map(|(solid, ..)| vector(&solid.world_from_shape.translation.vector)))
            .with_quaternions(cylinders.iter().map(|(solid, ..)| quaternion(&solid.world_from_shape.rotation)))
            .with_colors(cylinders.iter().map(|(solid, ..)| colour(solid)))
            .with_fill_mode(FillMode::Solid);
            pen.write_static(&paths::below(&link, "housings"), &housings)?;
        }
        if !capsules.is_empty() || had(|shape| matches!(shape, Shape::Capsule { .. })) {
            let tubes = Capsules3D::from_endpoints_and_radii(
                capsules.iter().map(|(_, [a, _], _)| *a),
                capsules.iter().map(|(_, [_, b], _)| *b),
                capsules.iter().map(|(.., radius)| *radius),
            )
            .with_colors(capsules.iter().map(|(solid, ..)| colour(solid)))
            .with_fill_mode(FillMode::Solid);
            pen.write_static(&paths::below(&link, "tubes"), &tubes)?;
        }
    }
    Ok(())
}

fn colour(solid: &Solid) -> Color {
    let [red, green, blue] = solid.colour.map(|c| (c.clamp(0.0, 1.0) * 255.0) as u8);
    Color::from_rgb(red, green, blue)
}

/// The joint values as numbers, and names for the joints in the plot if they differ from `named`.
pub(super) fn write_joints(
    pen: Pen<'_>,
    joints: &[f64],
    kind: impl Fn(usize) -> JointKind,
    named: &mut Vec<JointKind>,
) -> Result<(), RecordError> {
    if joints.is_empty() {
        return Ok(());
    }
    let kinds: Vec<JointKind> = (0..joints.len()).map(kind).collect();
    if *named != kinds {
        pen.write_static(paths::PLOT_JOINTS, &joint_series(&kinds))?;
        named.clone_from(&kinds);
    }
    let shown = joints.iter().zip(&kinds).map(|(value, kind)| value * kind.shown_per_si());
    pen.write(paths::PLOT_JOINTS, &Scalars::new(shown))
}

/// Names of the joints in the plot.
fn joint_series(kinds: &[JointKind]) -> SeriesLines {
    let name = |(i, kind): (usize, &JointKind)| format!("joint {} [{}]", i + 1, kind.unit().trim_start());
    SeriesLines::new().with_names(kinds.iter().enumerate().map(name))
}

/// A line that grows, in blocks, so that what was written once is not written again with every point.
#[derive(Debug)]
pub(super) struct Trail {
    path: &'static str,
    colour: Color,
    blocks: usize,
    newest: Vec<Vector3<f64>>,
}

impl Trail {
    /// Points closer together than this \[m\] are merged: the distance is less than the line width on the screen.
    const SPACING_M: f64 = 2e-3;
    /// A tip that jumps farther \[m\] was not seen in between, and there is no line.
    const JUMP_M: f64 = 0.3;
    /// Points of a block.
    const BLOCK: usize = 100;

    pub fn new(path: &'static str, colour: Color) -> Self {
        Self { path, colour, blocks: 0, newest: Vec::new() }
    }

    /// Starts again.
    pub fn restart(&mut self, pen: Pen<'_>) -> Result<(), RecordError> {
        if self.newest.is_empty() {
            return Ok(());
        }
        *self = Self::new(self.path, self.colour);
        pen.clear(self.path)
    }

    /// The tip is there now.
    pub fn go(&mut self, pen: Pen<'_>, to: &Vector3<f64>) -> Result<(), RecordError> {
        if let Some(last) = self.newest.last().copied() {
            let distance = (to - last).norm();
            if distance.is_nan() || distance < Self::SPACING_M {
                return Ok(());
            }
            if distance > Self::JUMP_M {
                self.next_block(None);
            } else if self.newest.len() >= Self::BLOCK {
                self.next_block(Some(last));
            }
        }
        self.newest.push(*to);
        let strip = LineStrips3D::new([self.newest.iter().map(vector).collect::<Vec<_>>()])
            .with_colors([self.colour])
            .with_radii([Radius::new_ui_points(style::THIN_UI_POINTS)]);
        pen.write(&paths::below(self.path, &self.blocks.to_string()), &strip)
    }

    fn next_block(&mut self, first: Option<Vector3<f64>>) {
        self.blocks += 1;
        self.newest.clear();
        self.newest.extend(first);
    }
}
