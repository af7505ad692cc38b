//! From our conventions to those of Rerun.

use handeye_geometry::camera::Intrinsics;
use handeye_geometry::targets::TargetSpec;
use handeye_geometry::targets::observation::Corner;
use nalgebra::{Isometry3, Matrix3, Matrix6, Point3, Rotation3, SymmetricEigen, UnitQuaternion, Vector2, Vector3};
use rerun::{Color, Ellipsoids3D, LineStrips3D, Pinhole, Points2D, Points3D, Quaternion, Radius, Transform3D};
use rerun::{FillMode, TransformAxes3D};

use super::style;
use handeye_workbench::scene;

/// Squared radius that holds 95 % of a Gaussian in three dimensions: the quantile of chi square.
const CHI_SQUARE_3_95: f64 = 7.814_728;

/// Rerun's pixel (0, 0) is the corner of the image, ours the middle of its first pixel.
const PIXEL_SHIFT: f64 = 0.5;

/// A pose as a transform along the tree of entities.
pub(super) fn transform(isometry: &Isometry3<f64>) -> Transform3D {
    Transform3D::from_translation_rotation(vector(&isometry.translation.vector), quaternion(&isometry.rotation))
}

pub(super) fn quaternion(rotation: &UnitQuaternion<f64>) -> Quaternion {
    let q = rotation.coords;
    Quaternion::from_xyzw([q.x as f32, q.y as f32, q.z as f32, q.w as f32])
}

pub(super) fn vector(v: &Vector3<f64>) -> [f32; 3] {
    [v.x as f32, v.y as f32, v.z as f32]
}

pub(super) fn point(p: &Point3<f64>) -> [f32; 3] {
    vector(&p.coords)
}

/// A pixel of ours where Rerun draws it.
pub(super) fn pixel(px: &Vector2<f64>) -> [f32; 2] {
    [(px.x + PIXEL_SHIFT) as f32, (px.y + PIXEL_SHIFT) as f32]
}

/// Axes of a length in metres.
pub(super) fn axes(length: f32) -> TransformAxes3D {
    TransformAxes3D::new(length)
}

/// Replaces axes that no longer exist. [`rerun::Clear`] is for what never comes back: a viewer of version 0.36 puts an
/// entity at the origin that has a new transform at the very time at which it was cleared.
pub(super) fn no_axes() -> TransformAxes3D {
    TransformAxes3D::new(0.0)
}

/// Replaces lines that no longer exist, see [`no_axes`].
pub(super) fn no_lines() -> LineStrips3D {
    LineStrips3D::new(Vec::<Vec<[f32; 3]>>::new())
}

/// A projection. Rerun does not support distortion; `result` has it.
pub(super) fn pinhole(intrinsics: &Intrinsics, image_plane_m: f32, colour: Color, line_ui_points: f32) -> Pinhole {
    let [fx, fy] = [intrinsics.fx, intrinsics.fy].map(|v| v as f32);
    let [cx, cy] = [intrinsics.cx, intrinsics.cy].map(|v| (v + PIXEL_SHIFT) as f32);
    Pinhole::new([[fx, 0.0, 0.0], [0.0, fy, 0.0], [cx, cy, 1.0]])
        .with_resolution([intrinsics.width as f32, intrinsics.height as f32])
        .with_camera_xyz(rerun::components::ViewCoordinates::RDF)
        .with_image_plane_distance(image_plane_m)
        .with_color(colour)
        .with_line_width(Radius::new_ui_points(line_ui_points))
}

/// Marks in an image; an empty set clears the earlier ones.
pub(super) fn marks(pixels: impl IntoIterator<Item = Vector2<f64>>, colour: Color) -> Points2D {
    let pixels: Vec<[f32; 2]> = pixels.into_iter().map(|px| pixel(&px)).collect();
    Points2D::new(pixels).with_colors([colour]).with_radii([Radius::new_ui_points(style::CORNER_UI_POINTS)])
}

pub(super) fn corner_marks(corners: &[Corner], colour: Color) -> Points2D {
    marks(corners.iter().map(|corner| corner.px), colour)
}

/// The outer edge of a board.
pub(super) fn outline(target: &TargetSpec, colour: Color) -> LineStrips3D {
    let [first, second, third, fourth] = scene::outline(target, 0.0).map(|corner| point(&corner));
    LineStrips3D::new([[first, second, third, fourth, first]])
        .with_colors([colour])
        .with_radii([Radius::new_ui_points(style::THIN_UI_POINTS)])
}

pub(super) fn board_points(target: &TargetSpec, colour: Color) -> Points3D {
    Points3D::new(target.points().iter().map(point))
        .with_colors([colour])
        .with_radii([Radius::new_ui_points(style::CORNER_UI_POINTS)])
}

/// Where something is with a probability of 95 %, `factor` times larger, in the axes of the covariance.
pub(super) fn ellipsoid(covariance_m2: &Matrix3<f64>, factor: f64, colour: Color) -> Ellipsoids3D {
    let eigen = SymmetricEigen::new(*covariance_m2);
    let half = eigen.eigenvalues.map(|v| factor * (CHI_SQUARE_3_95 * v.max(0.0)).sqrt());
    let mut axes = eigen.eigenvectors;
    if axes.determinant() < 0.0 {
        axes.column_mut(2).neg_mut();
    }
    let turn = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(axes));
    Ellipsoids3D::from_half_sizes([vector(&half)])
        .with_quaternions([quaternion(&turn)])
        .with_colors([colour])
        .with_fill_mode(FillMode::MajorWireframe)
        .with_labels([format!("95 %, {factor} times larger")])
}

/// The part of a covariance `[t; r]` that is about the position.
pub(super) fn of_position(covariance: &Matrix6<f64>) -> Matrix3<f64> {
    covariance.fixed_view::<3, 3>(0, 0).into_owned()
}
