//! Cameras as the pyramids that they see.

use egui::{Color32, Stroke};
use handeye_geometry::camera::Intrinsics;
use handeye_geometry::frames::{Base, Camera, Pose};
use nalgebra::Point3;

use super::canvas::Canvas;
use handeye_workbench::scene::frustum_end;

/// A camera in the base.
#[derive(Debug, Clone, Copy)]
pub struct Frustum<'a> {
    /// Where it is.
    pub base_from_camera: Pose<Base, Camera>,
    /// Its intrinsics; lens distortion is not drawn.
    pub intrinsics: &'a Intrinsics,
    /// How far its pyramid is drawn \[m\].
    pub length_m: f64,
}

impl Frustum<'_> {
    /// The tip of the pyramid and the corners of its end: top left, top right, bottom right, bottom left.
    fn points(&self) -> (Point3<f64>, [Point3<f64>; 4]) {
        let corners =
            frustum_end(self.intrinsics, self.length_m).map(|corner| self.base_from_camera.isometry() * corner);
        (Point3::from(self.base_from_camera.translation()), corners)
    }

    /// A point in its middle, where the pointer picks it.
    pub fn middle(&self) -> Point3<f64> {
        self.base_from_camera.isometry() * Point3::new(0.0, 0.0, 0.6 * self.length_m)
    }

    /// Draws the pyramid, and over the top edge of the image a small roof that marks the top.
    pub fn draw(&self, canvas: &mut Canvas, width: f32, edge: Color32, fill: Color32) {
        let (apex, corners) = self.points();
        let stroke = Stroke::new(width, edge);
        for index in 0..4 {
            let (corner, next) = (corners[index], corners[(index + 1) % 4]);
            canvas.face(&[apex, corner, next], fill);
            canvas.line([apex, corner], stroke);
            canvas.line([corner, next], stroke);
        }
        canvas.face(&corners, fill);
        let [left, right, _, below] = corners;
        let inset = (right - left) * 0.28;
        let (from, to) = (left + inset, right - inset);
        let ridge = nalgebra::center(&left, &right) + (left - below) * 0.28;
        canvas.face(&[from, to, ridge], edge.gamma_multiply(0.8));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_end_of_a_frustum_is_the_edge_of_the_image_at_its_distance() {
        let intrinsics = Intrinsics::pinhole(640, 480, 589.37);
        let base_from_camera = Pose::from_translation_xyzw([0.1, 0.2, 0.3], [0.0, 1.0, 0.0, 0.0]);
        let frustum = Frustum { base_from_camera, intrinsics: &intrinsics, length_m: 0.2 };
        let (apex, corners) = frustum.points();
        assert!((apex - Point3::new(0.1, 0.2, 0.3)).norm() < 1e-12);
        let camera_from_base = base_from_camera.inverse();
        for (corner, (u, v)) in corners.iter().zip([(-0.5, -0.5), (639.5, -0.5), (639.5, 479.5), (-0.5, 479.5)]) {
            let in_camera = camera_from_base.isometry() * corner;
            assert!((in_camera.z - 0.2).abs() < 1e-12);
            let px = intrinsics.project(&in_camera).expect("in front");
            assert!((px.x - u).abs() < 1e-9 && (px.y - v).abs() < 1e-9, "{px}");
        }
    }
}
