//! The information of the depths of a target on its pose.

use nalgebra::{Isometry3, Matrix3, Matrix3x6, Point3, Vector3};

use super::{FreeParameters, PoseEquations, ViewInput};
use crate::camera::Intrinsics;
use crate::targets::bent::BoardShape;
use crate::targets::depth_plane::DepthPlane;

/// Errors of a depth camera: its depth of a point `(x, y, z)` in the camera's frame is
/// `z + offset + scale z + slope g + tilt_x y − tilt_y x`, where `g` is by how much the depth changes from one pixel to the next,
/// along the row or the column, whichever is more (as polygon offsets in OpenGL 4.6, §14.6.5).
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct DepthBias {
    /// Added to every depth, metres.
    pub offset_m: f64,
    /// Fraction of the depth that is added to it.
    pub scale: f64,
    /// What is added to the depth of a slanted surface, in pixels' worth of its slope.
    pub slope_px: f64,
    /// Rotation of the scene by the depths about the camera's x and y, radians.
    pub tilt_rad: [f64; 2],
}

impl DepthBias {
    /// Number of errors.
    pub const COUNT: usize = 5;

    /// The bias with offset, scale, slope and both tilts, in the order of the columns: metres, a fraction, pixels,
    /// radians.
    pub fn new([offset_m, scale, slope_px, tilt_x, tilt_y]: [f64; Self::COUNT]) -> Self {
        Self { offset_m, scale, slope_px, tilt_rad: [tilt_x, tilt_y] }
    }

    /// The values in the same order.
    pub fn values(&self) -> [f64; Self::COUNT] {
        let [tilt_x, tilt_y] = self.tilt_rad;
        [self.offset_m, self.scale, self.slope_px, tilt_x, tilt_y]
    }
}

/// The plane of a target by its depths.
#[derive(Debug, Clone, Copy)]
pub struct MeasuredDepths<'a> {
    /// The plane as measured.
    pub plane: &'a DepthPlane,
    /// Estimated errors of the depth camera.
    pub bias: &'a DepthBias,
    /// Pixels of corner error that count as much as a metre of the plane's error.
    pub px_per_m: f64,
}

/// Depths of a target's plane that a pose predicts, as in [`DepthPlane::depth`], and their derivatives by pose, size of the
/// target and bias.
pub struct PredictedDepths {
    /// As [`DepthPlane::depth`].
    pub depth: Vector3<f64>,
    by_pose: Matrix3x6<f64>,
    by_scale: Vector3<f64>,
    /// Its derivatives by the bias.
    pub by_bias: [Vector3<f64>; DepthBias::COUNT],
}

impl PredictedDepths {
    /// The target counts as flat: a bend moves its mean depth by much less than what the free offset absorbs.
    pub fn new(
        intrinsics: &Intrinsics,
        shape: &BoardShape,
        plane: &DepthPlane,
        bias: &DepthBias,
        camera_from_target: &Isometry3<f64>,
    ) -> Self {
        let rotation = camera_from_target.rotation.to_rotation_matrix().into_inner();
        let [across, down, row] = [0, 1, 2].map(|axis| rotation.row(axis).transpose());
        let size = shape.scale;
        let place = Point3::new(plane.place_m.x * size, plane.place_m.y * size, 0.0);
        let there = camera_from_target * place;
        // From pixel to pixel: z² times the slope of the inverse depth. Its derivative by the pose is left out: it would change
        // the effect of a pixel's worth of it by a thousandth of the slope.
        let normal = rotation.column(2);
        let towards = normal.dot(&there.coords) / there.z;
        let steepest = (normal.x / intrinsics.fx).abs().max((normal.y / intrinsics.fy).abs());
        let slant = steepest / towards.abs().max(f64::EPSILON);
        let longer = 1.0 + bias.scale;
        // The measured depth is linear in the place with these for the third row of the rotation: at one place, and from place to
        // place, where the slope's part grows twice as fast as the depth.
        let [tilt_x, tilt_y] = bias.tilt_rad;
        let tilted = down * tilt_x - across * tilt_y;
        let there_row = row * (longer + bias.slope_px * slant) + tilted;
        let slope_row = row * (longer + 2.0 * bias.slope_px * slant) + tilted;
        let at_origin = camera_from_target.translation.vector;
        let origin = at_origin.z * (longer + bias.slope_px * slant) + tilt_x * at_origin.y - tilt_y * at_origin.x;
        let slopes = slope_row.xy() * size;
        let depth = Vector3::new(origin + there_row.dot(&place.coords) + bias.offset_m, slopes.x, slopes.y);
        let mut by_pose = Matrix3x6::zeros();
        by_pose.fixed_view_mut::<1, 3>(0, 0).copy_from(&there_row.transpose());
        by_pose.fixed_view_mut::<1, 3>(0, 3).copy_from(&place.coords.cross(&there_row).transpose());
        // A turn φ of the target makes a row r of the rotation r + r × φ.
        let r = slope_row * size;
        let by_turn = Matrix3::new(0.0, -r.z, r.y, r.z, 0.0, -r.x, -r.y, r.x, 0.0);
        by_pose.fixed_view_mut::<2, 3>(1, 3).copy_from(&by_turn.fixed_rows::<2>(0));
        let with_slopes = |there: f64, row: &Vector3<f64>| Vector3::new(there, row.x * size, row.y * size);
        Self {
            depth,
            by_pose,
            by_scale: Vector3::new(there_row.dot(&place.coords), slopes.x, slopes.y) / size,
            by_bias: [
                Vector3::x(),
                with_slopes(there.z, &row),
                with_slopes(there.z * slant, &(row * (2.0 * slant))),
                with_slopes(there.y, &down),
                -with_slopes(there.x, &across),
            ],
        }
    }
}

impl MeasuredDepths<'_> {
    /// Adds the three residuals of a view to its equations.
    pub(crate) fn add_to(
        &self,
        equations: &mut PoseEquations,
        seen: &ViewInput<'_>,
        camera_from_target: &Isometry3<f64>,
        free: FreeParameters,
    ) {
        let predicted = PredictedDepths::new(seen.intrinsics, seen.shape, self.plane, self.bias, camera_from_target);
        let information = self.plane.information * self.px_per_m.powi(2);
        let residual = predicted.depth - self.plane.depth;
        let weighted = information * residual;
        let weighted_pose = information * predicted.by_pose;
        equations.pose += predicted.by_pose.transpose() * weighted_pose;
        equations.pose_gradient += predicted.by_pose.transpose() * weighted;
        equations.squared_px += residual.dot(&weighted);
        equations.depths = 3;
        let mut columns: Vec<(usize, Vector3<f64>)> = Vec::with_capacity(1 + DepthBias::COUNT);
        if free.scale {
            columns.push((free.scale_at(seen.intrinsics), predicted.by_scale));
        }
        if free.depth {
            let at = free.depth_at(seen.intrinsics);
            columns.extend(predicted.by_bias.iter().enumerate().map(|(k, column)| (at + k, *column)));
        }
        for (i, column) in &columns {
            let mut by_pose = equations.pose_by_form.column_mut(*i);
            by_pose += weighted_pose.transpose() * column;
            equations.form_gradient[*i] += column.dot(&weighted);
            for (j, other) in &columns {
                equations.form[(*i, *j)] += column.dot(&(information * other));
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{Vector2, Vector6};

    use super::*;
    use crate::se3;

    /// Compared with differences of the prediction: by pose, size and every error of the depth camera. The effect of a pixel's
    /// worth of the slope changes with the pose by less than the tolerance here.
    #[test]
    fn depths_turn_with_pose_size_and_bias_as_differences_say() {
        const STEP: f64 = 1e-6;
        let lens = Intrinsics { fy: 575.0, ..Intrinsics::pinhole(640, 480, 581.0) };
        let plane = DepthPlane {
            place_m: Vector2::new(0.05, 0.03),
            depth: Vector3::zeros(),
            information: Matrix3::identity(),
            scatter_m: 0.0,
            fill: 1.0,
        };
        let pose = Isometry3::new(Vector3::new(-0.05, -0.08, 0.4), Vector3::new(0.5, -0.4, 0.2));
        let shape = BoardShape { warp_m: [0.0; 2], scale: 1.02 };
        let bias = DepthBias::new([0.004, 0.01, 0.5, 0.005, -0.008]);
        let at = |pose: &Isometry3<f64>, scale: f64, bias: &DepthBias| {
            PredictedDepths::new(&lens, &BoardShape { scale, ..shape }, &plane, bias, pose).depth
        };
        let there = PredictedDepths::new(&lens, &shape, &plane, &bias, &pose);
        let difference = |up: Vector3<f64>, down: Vector3<f64>| (up - down) / (2.0 * STEP);
        for k in 0..6 {
            let moved = |sign: f64| pose * se3::exp(&Vector6::ith(k, sign * STEP));
            let expected = difference(at(&moved(1.0), shape.scale, &bias), at(&moved(-1.0), shape.scale, &bias));
            let off = there.by_pose.column(k) - expected;
            assert!(off.norm() < 5e-3, "{k}: {off:?}");
            let straight = DepthBias { slope_px: 0.0, ..bias };
            let exact = PredictedDepths::new(&lens, &shape, &plane, &straight, &pose).by_pose.column(k).into_owned();
            let expected =
                difference(at(&moved(1.0), shape.scale, &straight), at(&moved(-1.0), shape.scale, &straight));
            assert!((exact - expected).norm() < 1e-8, "{k}: {exact:?} {expected:?}");
        }
        for k in 0..DepthBias::COUNT {
            let changed = |sign: f64| {
                let mut values = bias.values();
                values[k] += sign * STEP;
                DepthBias::new(values)
            };
            let expected = difference(at(&pose, shape.scale, &changed(1.0)), at(&pose, shape.scale, &changed(-1.0)));
            assert!((there.by_bias[k] - expected).norm() < 1e-8, "{k}");
        }
        let straight = DepthBias { slope_px: 0.0, ..bias };
        let exact = PredictedDepths::new(&lens, &shape, &plane, &straight, &pose).by_scale;
        let expected = difference(at(&pose, shape.scale + STEP, &straight), at(&pose, shape.scale - STEP, &straight));
        assert!((exact - expected).norm() < 1e-8, "{exact:?} {expected:?}");
    }
}
