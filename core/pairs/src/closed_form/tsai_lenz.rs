//! Tsai & Lenz: rotation, then translation, from modified Rodrigues vectors.

use nalgebra::{Matrix3, Quaternion, SMatrix, UnitQuaternion, Vector3};

use super::linear::Rows;
use super::pairing::{self, Motion};
use super::{ClosedForm, ClosedFormSolution, Method, check};
use crate::{HandEyeError, PosePair};
use handeye_geometry::se3::skew;

/// Motions whose chord `2 sin(θ/2)` is below this (17.3°) are left out, as OpenCV does since 4.10: their axes are
/// noisy and the linear system would count them as fully as a wide turn.
const SMALLEST_CHORD: f64 = 0.3;

/// Motions whose chord is above this (116.4°) are left out, as OpenCV does: towards a half turn the sign of the axis
/// becomes arbitrary.
const LARGEST_CHORD: f64 = 1.7;

/// Estimates `mount_from_camera` from relative motions, the rotation first and the translation with it.
///
/// Solves `A X = X B` with `A = mount_j_from_mount_i`, `B = camera_j_from_camera_i`, `X = mount_from_camera` for all
/// pairs `i < j`. With `P = 2 sin(θ/2)` times the rotation axis, the rotation is the least-squares solution of
/// `[P_A + P_B]× x = P_B - P_A`, where `x` is the axis of `X` times `tan(θ_X / 2)`; the translation that of
/// `(I - R_A) t = t_A - R_X t_B`. `anchor_from_target` is the mean over the views.
///
/// # Frames and units
/// Views hold `anchor_from_mount` and `camera_from_target`, metres. The result maps camera to mount coordinates.
/// # Needs
/// Three views, turned about two axes that are not parallel by 17.3° to 116.4°, seen by both robot and camera; other
/// motions are left out. Near a half turn of the camera on its mount `x` grows without bound and noise pulls the angle
/// below 180°, so another method is then the better one. When `x` does not exist within rounding (condition number
/// 1e10), the camera is turned by the half turn about x, y or z that conditions the system best, and turned back.
/// # Errors
/// As [`ClosedForm::solve`]; [`HandEyeError::NoSolution`] when the turns of that size do not span two axes (OpenCV
/// returns the identity).
/// # Reference
/// Tsai & Lenz 1989, "A new technique for fully autonomous and efficient 3D robotics hand/eye calibration", eqs. 12,
/// 14 and 15, doi:10.1109/70.34770. The selection of motions is OpenCV's.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct TsaiLenz;

impl ClosedForm for TsaiLenz {
    fn name(&self) -> &'static str {
        "tsai_lenz"
    }

    fn solve(&self, pairs: &[PosePair]) -> Result<ClosedFormSolution, HandEyeError> {
        check(pairs)?;
        let method = Method { name: self.name(), views: pairs.len() };
        let motions: Vec<_> = pairing::motions(pairs).into_iter().filter(is_informative).collect();
        if !pairing::spans_two_axes(&motions) {
            return Err(method.fails("the turns between 17° and 116° are about fewer than two axes"));
        }
        let rotation =
            rotation(&motions).ok_or_else(|| method.fails("the motions of robot and camera do not match"))?;
        pairing::completed(&method, pairs, &motions, rotation)
    }
}

fn is_informative(motion: &Motion) -> bool {
    let informative = SMALLEST_CHORD..=LARGEST_CHORD;
    let chord = |rotation: &UnitQuaternion<f64>| 2.0 * rotation.imag().norm();
    informative.contains(&chord(&motion.mount.rotation())) && informative.contains(&chord(&motion.camera.rotation()))
}

/// Rotation of `mount_from_camera`.
fn rotation(motions: &[Motion]) -> Option<UnitQuaternion<f64>> {
    let axes = [Vector3::x_axis(), Vector3::y_axis(), Vector3::z_axis()];
    let half_turns = axes.map(|axis| UnitQuaternion::from_axis_angle(&axis, std::f64::consts::PI));
    rodrigues(motions, &UnitQuaternion::identity()).map(|x| to_rotation(&x)).or_else(|| {
        half_turns
            .iter()
            .filter_map(|turned_from_camera| Some((rodrigues(motions, turned_from_camera)?, turned_from_camera)))
            // The shortest vector is the one farthest from a half turn.
            .min_by(|(x, _), (y, _)| x.norm().total_cmp(&y.norm()))
            .map(|(x, turned_from_camera)| to_rotation(&x) * turned_from_camera)
    })
}

/// Axis of `mount_from_turned` times the tangent of half its angle, when the camera frame is turned first.
fn rodrigues(motions: &[Motion], turned_from_camera: &UnitQuaternion<f64>) -> Option<Vector3<f64>> {
    let mut rows = Rows::<4>::new();
    for motion in motions {
        let p_a = 2.0 * motion.mount.rotation().imag();
        let p_b = turned_from_camera * (2.0 * motion.camera.rotation().imag());
        let mut block = SMatrix::<f64, 3, 4>::zeros();
        let cross: Matrix3<f64> = skew(&(p_a + p_b));
        block.fixed_columns_mut::<3>(0).copy_from(&cross);
        block.set_column(3, &(p_b - p_a));
        rows.push(&block);
    }
    rows.least_squares().map(|x| Vector3::new(x[0], x[1], x[2]))
}

fn to_rotation(x: &Vector3<f64>) -> UnitQuaternion<f64> {
    UnitQuaternion::from_quaternion(Quaternion::from_parts(1.0, *x))
}
