//! What a robot that turned about one axis only determines of its camera: five of the six numbers.
//!
//! # What it estimates
//! Let all turns of the mount be about the axis `a` (in the mount frame; `a'` in the anchor frame, the same for every view).
//! Moving the camera by `s a` on its mount moves the chain `anchor_from_mount_i * mount_from_camera` by
//! `R_i s a = s a'` in every view equally, which a target moved by `s a'` on its anchor compensates. So the component of the
//! camera's place along `a` is open, and trades with that of the target along `a'`; orientation and the two components across are
//! determined where the robot moved across the axis as well. For an eye in hand `a` is an axis of the tip and `a'` of the base,
//! for an eye to hand the other way round.
//!
//! A robot that turned about one line, as one joint does, leaves the camera's turn about this line open too; then there are
//! four numbers, and nothing is stated.
//!
//! # How
//! A linear start, then the pose graph with a prior on the open component ([`pose_graph::refine_one_axis`]), so that turns
//! that wobble within the limit of [`super::motion`] count with the information they have.
//!
//! # Reference
//! Tsai & Lenz 1989, section II; Andreff et al. 2001, "Robot hand-eye calibration using structure from motion", section 3.4
//! (planar motions).

use nalgebra::{Matrix2, Matrix3, Matrix4, Unit, UnitQuaternion, Vector2, Vector3, Vector4};

use super::closed_form::ClosedFormSolution;
use super::motion::{NO_ROTATION_RAD, pairs_of, relative, rotation_angle};
use super::{Mode, PosePair, pose_graph, subset};
use handeye_geometry::frames::{Camera, Mount, Pose};
use handeye_wording::Text;
use handeye_wording::text;

/// Turns beyond this \[rad\] have axes whose sign is decided by noise; they are not used for the axis in the camera.
const HALF_TURN_RAD: f64 = 150f64.to_radians();
/// Standard deviation of the turn about the axis \[rad\] from which it counts as open: an orientation that may be off by ten
/// degrees is not useful.
const OPEN_TURN_RAD: f64 = 5f64.to_radians();

/// Motions that stay so near \[m\] to turns about one line leave the turn about it open: half a millimetre of pose error over
/// less is the six degrees of [`OPEN_TURN_RAD`]. Exact poses would otherwise be trusted down to rounding.
const ONE_LINE_M: f64 = 5e-3;

/// The part of a hand-eye transform that turns about one axis determine. It is not a transform: one number is open.
#[derive(Debug, Clone, PartialEq)]
pub struct PartialHandEye {
    /// Where the camera is mounted.
    pub mode: Mode,
    /// Number of views that it rests on.
    pub views: usize,
    /// Orientation of the camera in the mount (tip for an eye in hand, base for an eye to hand).
    pub rotation: UnitQuaternion<f64>,
    /// Standard deviations of a turn of the camera about its x, y and z axis, radians.
    pub rotation_sigma_rad: [f64; 3],
    /// The axis of all turns in the mount: the camera's place along it is open.
    pub open_axis: Unit<Vector3<f64>>,
    /// The same direction in camera axes.
    pub open_axis_in_camera: Unit<Vector3<f64>>,
    /// Two directions across it in the mount.
    pub across: [Unit<Vector3<f64>>; 2],
    /// The camera's place along these, metres.
    pub place_m: [f64; 2],
    /// Covariance of the two, square metres.
    pub place_covariance: Matrix2<f64>,
}

impl PartialHandEye {
    /// What is known and what stays open, in a sentence.
    pub fn text(&self) -> Text {
        let (mount, target) = match self.mode {
            Mode::EyeInHand => (text!("tip"), text!("base")),
            Mode::EyeToHand => (text!("base"), text!("tip")),
        };
        let list = |v: Vector3<f64>, digits: usize| format!("[{:.digits$} {:.digits$} {:.digits$}]", v.x, v.y, v.z);
        let sigma = Vector3::from(self.rotation_sigma_rad).map(f64::to_degrees);
        let q = self.rotation.coords;
        let (a, b) = (self.across[0].into_inner(), self.across[1].into_inner());
        let place =
            |i: usize| format!("{:.3} ± {:.3} mm", self.place_m[i] * 1e3, self.place_covariance[(i, i)].sqrt() * 1e3);
        text!(
            "all rotations are about the same axis {axis} of the {mount}: the position of the camera along it is not \
             determined ({seen} in camera axes), nor that of the target along the same axis in the {target}; add views turned \
             by 30° or more about an axis across it. Five of six numbers are determined: rotation_xyzw {rotation} ± {sigma} ° \
             (camera x y z); position in the {mount} along {a}: {place_a}, along {b}: {place_b}",
            axis = list(self.open_axis.into_inner(), 4),
            mount = mount,
            target = target,
            seen = list(self.open_axis_in_camera.into_inner(), 4),
            rotation = format!("[{:.6} {:.6} {:.6} {:.6}]", q.x, q.y, q.z, q.w),
            sigma = list(sigma, 4),
            a = list(a, 4),
            place_a = place(0),
            b = list(b, 4),
            place_b = place(1),
        )
    }
}

/// The five numbers from pose pairs whose robot turned about `axis` of the mount only, as [`super::motion::analyse`] finds it.
///
/// # Needs
/// Three pairs, and motions across the axis that are not a turn about one line.
///
/// # Degenerate cases
/// `None` where the turn of the camera about the axis is open too, and where there is no solution.
pub fn solve(mode: Mode, pairs: &[PosePair], axis: Vector3<f64>) -> Option<PartialHandEye> {
    let axis = Unit::try_new(axis, 0.0)?;
    let chosen: Vec<PosePair> = subset::spread(pairs.len(), subset::MOST_VIEWS).into_iter().map(|i| pairs[i]).collect();
    let start = start(&chosen, &axis)?;
    let found = pose_graph::refine_one_axis(pairs, &start, &axis).ok()?;
    let rotation = found.mount_from_camera.rotation();
    let in_camera = rotation.inverse() * axis;
    let across = basis(&axis);
    let place = found.covariance.fixed_view::<3, 3>(0, 0).into_owned();
    let turn: Matrix3<f64> = found.covariance.fixed_view::<3, 3>(3, 3).into_owned();
    let about = in_camera.dot(&(turn * in_camera.into_inner())).sqrt();
    let place_in_mount = rotation.to_rotation_matrix() * place * rotation.inverse().to_rotation_matrix();
    let place_covariance = Matrix2::from_fn(|i, j| across[i].dot(&(place_in_mount * across[j].into_inner())));
    let translation = found.mount_from_camera.translation();
    // NaN is not below either.
    (about < OPEN_TURN_RAD).then(|| PartialHandEye {
        mode,
        views: pairs.len(),
        rotation,
        rotation_sigma_rad: [0, 1, 2].map(|i| turn[(i, i)].sqrt()),
        open_axis: axis,
        open_axis_in_camera: in_camera,
        across,
        place_m: across.map(|direction| direction.dot(&translation)),
        place_covariance,
    })
}

/// Two directions across an axis, right-handed with it.
fn basis(axis: &Unit<Vector3<f64>>) -> [Unit<Vector3<f64>>; 2] {
    let least = Vector3::ith(axis.iamin(), 1.0);
    let first = Unit::new_normalize(axis.cross(&least));
    [first, Unit::new_normalize(axis.cross(&first))]
}

/// `A X = X B` of all pairs of views, with `X` turning the axis in the camera into that of the mount: what is left of the
/// rotation, a turn by `ψ` about it, and the place across it are linear in `cos ψ`, `sin ψ` and two metres.
fn start(pairs: &[PosePair], axis: &Unit<Vector3<f64>>) -> Option<ClosedFormSolution> {
    let motions: Vec<_> = pairs_of(pairs.len())
        .map(|(i, j)| {
            let mount = relative(&pairs[i].anchor_from_mount, &pairs[j].anchor_from_mount);
            (mount, pairs[j].camera_from_target * pairs[i].camera_from_target.inverse())
        })
        .collect();
    let across = basis(axis);
    if is_about_one_line(motions.iter().map(|(mount, _)| mount), &across) {
        return None;
    }
    let turned = |(mount, _): &&(Pose<Mount, Mount>, Pose<Camera, Camera>)| {
        let angle = rotation_angle(&mount.rotation());
        (NO_ROTATION_RAD..HALF_TURN_RAD).contains(&angle)
    };
    let in_camera: Vector3<f64> = motions
        .iter()
        .filter(turned)
        .map(|(mount, camera)| camera.rotation().scaled_axis() * mount.rotation().scaled_axis().dot(axis))
        .sum();
    let in_camera = Unit::try_new(in_camera, 0.0)?;
    let to_axis = UnitQuaternion::rotation_between(&in_camera, axis)
        .unwrap_or_else(|| UnitQuaternion::from_axis_angle(&across[0], std::f64::consts::PI));
    let (mut normal, mut right) = (Matrix4::zeros(), Vector4::zeros());
    for (mount, camera) in &motions {
        let v = to_axis * camera.translation();
        let turned =
            |direction: &Unit<Vector3<f64>>| mount.rotation() * direction.into_inner() - direction.into_inner();
        for direction in &across {
            let row = Vector4::new(
                direction.dot(&turned(&across[0])),
                direction.dot(&turned(&across[1])),
                -direction.dot(&v),
                -direction.dot(&axis.cross(&v)),
            );
            normal += row * row.transpose();
            right -= row * direction.dot(&mount.translation());
        }
    }
    let solved = normal.cholesky()?.solve(&right);
    let turn = Vector2::new(solved[2], solved[3]);
    let rotation = UnitQuaternion::from_axis_angle(axis, turn.y.atan2(turn.x)) * to_axis;
    let place = across[0].into_inner() * solved[0] + across[1].into_inner() * solved[1];
    let mount_from_camera = Pose::from_isometry(nalgebra::Isometry3::from_parts(place.into(), rotation));
    let first = pairs.first()?;
    let anchor_from_target = first.anchor_from_mount * mount_from_camera * first.camera_from_target;
    (mount_from_camera.is_finite() && anchor_from_target.is_finite())
        .then_some(ClosedFormSolution { mount_from_camera, anchor_from_target })
}

/// Whether all motions are turns about one line of the mount through a point `p`, `t = (I − R) p` across the axis.
fn is_about_one_line<'a>(
    motions: impl Iterator<Item = &'a Pose<Mount, Mount>> + Clone,
    across: &[Unit<Vector3<f64>>; 2],
) -> bool {
    let seen = motions.map(|motion| {
        let still = motion.translation();
        let by_place = |k: usize| across[k].into_inner() - motion.rotation() * across[k].into_inner();
        let (a, b) = (by_place(0), by_place(1));
        let rows = Matrix2::from_fn(|i, k| across[i].dot(if k == 0 { &a } else { &b }));
        (rows, Vector2::new(across[0].dot(&still), across[1].dot(&still)))
    });
    let normal: Matrix2<f64> = seen.clone().map(|(rows, _)| rows.transpose() * rows).sum();
    let right: Vector2<f64> = seen.clone().map(|(rows, moved)| rows.transpose() * moved).sum();
    let Some(factor) = normal.cholesky() else { return true };
    let place = factor.solve(&right);
    let (squares, count) =
        seen.fold((0.0, 0.0), |(s, n), (rows, moved)| (s + (rows * place - moved).norm_squared(), n + 1.0));
    squares <= ONE_LINE_M * ONE_LINE_M * count
}

#[cfg(test)]
#[path = "one_axis_tests.rs"]
mod tests;
