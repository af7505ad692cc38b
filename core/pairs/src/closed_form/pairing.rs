//! The relative motions of all pairs of views, as measured by robot and camera, and what the `A X = X B` methods share.

use nalgebra::{Matrix3, Matrix4, Quaternion, SMatrix, SymmetricEigen, UnitQuaternion, Vector3, Vector4};

use super::linear::{RANK_TOLERANCE, Rows};
use super::{ClosedFormSolution, Method, PosePair, check, with_mean_target};
use crate::{HandEyeError, motion};
use handeye_geometry::frames::{Camera, Mount, Pose};

/// Nearer to a half turn than this \[rad\] the noise of the poses (0.26° at most in real data) can put robot and camera
/// on different sides of it, where axes jump to their opposites: ten times that noise is safe.
const HALF_TURN_RAD: f64 = 2.6f64.to_radians();

/// One relative motion: `mount * X = X * camera` with `X = mount_from_camera`.
///
/// The rotations carry quaternions of matching sign, so that their vectors are not opposite for any pair.
#[derive(Debug, Clone, Copy)]
pub(super) struct Motion {
    /// `A`: `mount_j_from_mount_i`.
    pub mount: Pose<Mount, Mount>,
    /// `B`: `camera_j_from_camera_i`.
    pub camera: Pose<Camera, Camera>,
}

impl Motion {
    pub(super) fn mount_rotation(&self) -> Matrix3<f64> {
        matrix(&self.mount.rotation())
    }

    pub(super) fn camera_rotation(&self) -> Matrix3<f64> {
        matrix(&self.camera.rotation())
    }

    /// Whether the signs of the axes of `mount` and `camera` are unrelated.
    fn is_half_turn(&self) -> bool {
        let largest =
            motion::rotation_angle(&self.mount.rotation()).max(motion::rotation_angle(&self.camera.rotation()));
        largest > std::f64::consts::PI - HALF_TURN_RAD
    }
}

/// The matrix of a rotation.
pub(super) fn matrix(rotation: &UnitQuaternion<f64>) -> Matrix3<f64> {
    rotation.to_rotation_matrix().into_inner()
}

/// The same transform with the quaternion of positive real part.
fn with_positive_w<F>(pose: Pose<F, F>) -> Pose<F, F> {
    if pose.rotation().w < 0.0 { with_opposite_sign(&pose) } else { pose }
}

/// The same transform with the other quaternion.
fn with_opposite_sign<F>(pose: &Pose<F, F>) -> Pose<F, F> {
    let mut isometry = *pose.isometry();
    isometry.rotation = UnitQuaternion::new_unchecked(-isometry.rotation.into_inner());
    Pose::from_isometry(isometry)
}

/// The motions of all pairs `i < j`, quaternions with positive real part.
pub(super) fn motions(views: &[PosePair]) -> Vec<Motion> {
    motion::pairs_of(views.len())
        .map(|(i, j)| Motion {
            mount: with_positive_w(motion::relative(&views[i].anchor_from_mount, &views[j].anchor_from_mount)),
            camera: with_positive_w(views[j].camera_from_target * views[i].camera_from_target.inverse()),
        })
        .collect()
}

/// The rotation from all motions, then the translation with it.
pub(super) fn rotation_first(
    name: &'static str,
    pairs: &[PosePair],
    rotation: impl Fn(&[Motion]) -> Option<UnitQuaternion<f64>>,
) -> Result<ClosedFormSolution, HandEyeError> {
    check(pairs)?;
    let method = Method { name, views: pairs.len() };
    let motions = aligned_motions(&method, pairs)?;
    let rotation = rotation(&motions).ok_or_else(|| method.fails("the camera did not turn as the robot did"))?;
    completed(&method, pairs, &motions, rotation)
}

/// The solution with this rotation.
pub(super) fn completed(
    method: &Method,
    pairs: &[PosePair],
    motions: &[Motion],
    rotation: UnitQuaternion<f64>,
) -> Result<ClosedFormSolution, HandEyeError> {
    let translation = translation(motions, &rotation)
        .ok_or_else(|| method.fails("the turns leave the translation along one axis open"))?;
    with_mean_target(method, pairs, pose(rotation, translation))
}

/// The motions of all pairs `i < j` with quaternion signs that match also at half turns.
///
/// Below a half turn, positive real parts match. At a half turn both signs have real part zero, so the sign is taken
/// from the rotation that the other motions determine.
///
/// # Errors
/// [`HandEyeError::NoSolution`] when the other motions do not determine a rotation. Then no other method could
/// determine the sign either: motions that are half turns or turns about one axis fix the answer only up to a half
/// turn.
pub(super) fn aligned_motions(method: &Method, views: &[PosePair]) -> Result<Vec<Motion>, HandEyeError> {
    let mut motions = motions(views);
    if !motions.iter().any(Motion::is_half_turn) {
        return Ok(motions);
    }
    let clear: Vec<_> = motions.iter().filter(|m| !m.is_half_turn()).copied().collect();
    let ambiguous = || method.fails("half turns leave the sign of the axes open, add views that are turned by less");
    if !spans_two_axes(&clear) {
        return Err(ambiguous());
    }
    let rotation = rotation(&clear).ok_or_else(ambiguous)?;
    for motion in motions.iter_mut().filter(|m| m.is_half_turn()) {
        let ax = motion.mount.rotation().into_inner() * rotation.into_inner();
        let xb = rotation.into_inner() * motion.camera.rotation().into_inner();
        if ax.dot(&xb) < 0.0 {
            motion.camera = with_opposite_sign(&motion.camera);
        }
    }
    Ok(motions)
}

/// Whether the robot's motions turn about two axes that are not parallel.
pub(super) fn spans_two_axes(motions: &[Motion]) -> bool {
    let mut axes = motion::AxisScatter::default();
    for motion in motions {
        axes.add(&motion.mount.rotation());
    }
    axes.spans_two_axes()
}

/// Rotation of `mount_from_camera` by [`Horaud`](super::Horaud)'s eigenvector; `None` when two rotations fit equally well
/// within [`RANK_TOLERANCE`].
pub(super) fn rotation(motions: &[Motion]) -> Option<UnitQuaternion<f64>> {
    let cost: Matrix4<f64> = motions
        .iter()
        .map(|m| {
            let difference = times_from_left(&m.mount.rotation()) - times_from_right(&m.camera.rotation());
            difference.transpose() * difference
        })
        .sum();
    let eigen = SymmetricEigen::new(cost);
    let mut order = [0, 1, 2, 3];
    order.sort_by(|&a, &b| eigen.eigenvalues[a].total_cmp(&eigen.eigenvalues[b]));
    let [best, second, .., worst] = order.map(|k| eigen.eigenvalues[k]);
    if second - best <= RANK_TOLERANCE * worst {
        return None;
    }
    let q = eigen.eigenvectors.column(order[0]);
    Some(UnitQuaternion::from_quaternion(Quaternion::from_parts(q[0], Vector3::new(q[1], q[2], q[3]))))
}

/// The matrix with `M x = q x` for quaternions as columns `w, x, y, z`.
fn times_from_left(q: &Quaternion<f64>) -> Matrix4<f64> {
    columns(|unit| q * unit)
}

/// The matrix with `M x = x q` for quaternions as columns `w, x, y, z`.
fn times_from_right(q: &Quaternion<f64>) -> Matrix4<f64> {
    columns(|unit| unit * q)
}

fn columns(product: impl Fn(Quaternion<f64>) -> Quaternion<f64>) -> Matrix4<f64> {
    let units = [
        Quaternion::new(1.0, 0.0, 0.0, 0.0),
        Quaternion::new(0.0, 1.0, 0.0, 0.0),
        Quaternion::new(0.0, 0.0, 1.0, 0.0),
        Quaternion::new(0.0, 0.0, 0.0, 1.0),
    ];
    Matrix4::from_columns(&units.map(|unit| {
        let p = product(unit);
        Vector4::new(p.w, p.i, p.j, p.k)
    }))
}

/// Translation of `mount_from_camera` once its rotation is known: least squares of
/// `(I - R_A) t = t_A - R t_B` over the motions; `None` when they do not determine it.
pub(super) fn translation(motions: &[Motion], rotation: &UnitQuaternion<f64>) -> Option<Vector3<f64>> {
    let mut rows = Rows::<4>::new();
    for motion in motions {
        let mut block = SMatrix::<f64, 3, 4>::zeros();
        block.fixed_columns_mut::<3>(0).copy_from(&(Matrix3::identity() - motion.mount_rotation()));
        block.set_column(3, &(motion.mount.translation() - rotation * motion.camera.translation()));
        rows.push(&block);
    }
    rows.least_squares().map(|t| Vector3::new(t[0], t[1], t[2]))
}

/// A hand-eye transform from its parts.
pub(super) fn pose(rotation: UnitQuaternion<f64>, translation_m: Vector3<f64>) -> Pose<Mount, Camera> {
    Pose::from_isometry(nalgebra::Isometry3::from_parts(translation_m.into(), rotation))
}
