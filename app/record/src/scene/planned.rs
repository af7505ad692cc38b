//! Poses that guided capture moves to: a frustum where the camera will be, or an outline where the board on the tip will
//! be.

use handeye_geometry::frames::{Base, Pose, Tip};
use nalgebra::Isometry3;
use rerun::{AsComponents, LineStrips3D, Radius};

use super::convert::{no_lines, outline, point, transform};
use super::error::RecordError;
use super::paths;
use super::pen::Pen;
use super::style;
use handeye_workbench::scene::{Known, PlannedItem, frustum_end};

/// Keeps how many are written, so that those that are no longer planned are removed.
#[derive(Debug, Default)]
pub(super) struct Planned {
    written: usize,
}

impl Planned {
    /// Writes what is planned now, the next one thickest.
    pub fn write(&mut self, pen: Pen<'_>, known: &Known, poses: &[Pose<Base, Tip>]) -> Result<(), RecordError> {
        let drawn: Vec<(Isometry3<f64>, LineStrips3D)> = poses.iter().filter_map(|pose| shape(known, pose)).collect();
        for index in drawn.len()..self.written {
            pen.write(&paths::planned(index), &no_lines())?;
        }
        self.written = drawn.len();
        for (index, (base_from_it, lines)) in drawn.into_iter().enumerate() {
            let width = if index == 0 { style::THICK_UI_POINTS } else { style::THIN_UI_POINTS };
            let lines = lines.with_radii([Radius::new_ui_points(width)]);
            pen.write(&paths::planned(index), &[&transform(&base_from_it) as &dyn AsComponents, &lines])?;
        }
        Ok(())
    }
}

/// What will be there, in its own frame; `None` if its mounting on the tip is not known.
fn shape(known: &Known, base_from_tip: &Pose<Base, Tip>) -> Option<(Isometry3<f64>, LineStrips3D)> {
    Some(match known.planned(base_from_tip)? {
        PlannedItem::Board(base_from_target, target) => {
            (*base_from_target.isometry(), outline(&target, style::PLANNED))
        }
        PlannedItem::Camera(base_from_camera, intrinsics) => {
            let end = frustum_end(&intrinsics, f64::from(style::CAPTURE_IMAGE_PLANE));
            let [a, b, c, d] = end.map(|corner| point(&corner));
            let eye = [0.0_f32; 3];
            let edges = [vec![a, b, c, d, a], vec![eye, a], vec![eye, b], vec![eye, c], vec![eye, d]];
            (*base_from_camera.isometry(), LineStrips3D::new(edges).with_colors([style::PLANNED]))
        }
    })
}
