//! Relative motions of the robot, and whether a set of robot poses can determine a hand-eye transform at all.
//!
//! Between the views `i` and `j` the camera's carrier makes the motion
//! `mount_j_from_mount_i = anchor_from_mount_j⁻¹ * anchor_from_mount_i`. Only its rotation axis and angle decide what
//! can be determined: motions without rotation leave the rotation of the camera unknown, and motions about one axis
//! only leave its translation along that axis unknown. Both hold for every method, so they are found here, from the
//! robot poses alone, before anything is solved.

use nalgebra::{Matrix3, SymmetricEigen, UnitQuaternion, Vector3};

use super::{HandEyeError, subset};
use handeye_geometry::frames::{Anchor, Frame as _, Mount, Pose};

/// Two motions about different axes are the least that determines a hand-eye transform, and they take three views.
pub const MIN_VIEWS: usize = 3;

/// A turn below this, in radians, counts as zero. Real pose pairs scatter by 0.04° to 0.26° per axis (robot and camera
/// together), so the axis of a turn under 1° is mostly noise.
pub const NO_ROTATION_RAD: f64 = 1f64.to_radians();

/// Axes that spread by less than this, in radians, count as parallel. The error along the common axis is the error of the
/// poses over the sine of the spread: at 1° half a millimetre becomes three centimetres.
pub const PARALLEL_AXES_RAD: f64 = 1f64.to_radians();

/// How the robot moved between the views of a session, over all pairs of views.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MotionSummary {
    /// Number of views.
    pub views: usize,
    /// Largest turn between two views, radians, at most π.
    pub largest_rotation_rad: f64,
    /// Median turn between two views, radians.
    pub median_rotation_rad: f64,
    /// Largest distance between the mount's origins in two views, metres.
    pub largest_translation_m: f64,
    /// Axes about which the mount turned most, second and least: orthonormal, in the mount frame. The sign is chosen
    /// so that the largest component is positive.
    pub principal_axes: [Vector3<f64>; 3],
    /// Root mean square over the pairs of the turn about each of [`principal_axes`](Self::principal_axes), radians.
    /// A turn by θ counts with its chord `2 sin(θ/2)`, which is θ when small and needs no sign at a half turn.
    pub principal_rotations_rad: [f64; 3],
    /// How far the rotation axes spread around the first principal axis, radians: 0 when all are parallel, π/4 when
    /// two directions are used equally.
    pub axis_spread_rad: f64,
}

/// Summarises the motions between robot poses and checks that they can determine a hand-eye transform.
///
/// # Frames and units
/// Robot poses as in the table of [the parent module](super); axes in the mount frame; metres and radians.
/// Neither a change of the anchor frame nor a repeated pose changes the verdict. Of more than
/// [`subset::MOST_VIEWS`] views only that many are used, because the pairs grow with the square.
/// # Errors
/// In this order: [`HandEyeError::TooFewViews`] below [`MIN_VIEWS`], [`HandEyeError::NotFinite`] with the first such
/// view, [`HandEyeError::NoRotation`] when no two views differ by [`NO_ROTATION_RAD`],
/// [`HandEyeError::ParallelAxes`] when the axes of all turns above that spread by less than [`PARALLEL_AXES_RAD`].
/// # Reference
/// Tsai & Lenz 1989, section II (conditions for a unique solution), doi:10.1109/70.34770. The spread is ours: the
/// arctangent of the ratio of the two largest root mean square turns.
pub fn analyse(anchor_from_mount: &[Pose<Anchor, Mount>]) -> Result<MotionSummary, HandEyeError> {
    let views = anchor_from_mount.len();
    if views < MIN_VIEWS {
        return Err(HandEyeError::TooFewViews { got: views, need: MIN_VIEWS });
    }
    if let Some(index) = anchor_from_mount.iter().position(|pose| !pose.is_finite()) {
        return Err(HandEyeError::NotFinite { index });
    }

    let chosen = subset::spread(views, subset::MOST_VIEWS);
    let mut axes = AxisScatter::default();
    let mut angles = Vec::with_capacity(chosen.len() * (chosen.len() - 1) / 2);
    let mut largest_translation_m = 0f64;
    for (i, j) in pairs_of(chosen.len()).map(|(i, j)| (chosen[i], chosen[j])) {
        let motion = relative(&anchor_from_mount[i], &anchor_from_mount[j]).rotation();
        axes.add(&motion);
        angles.push(rotation_angle(&motion));
        let distance = (anchor_from_mount[i].translation() - anchor_from_mount[j].translation()).norm();
        largest_translation_m = largest_translation_m.max(distance);
    }
    angles.sort_by(f64::total_cmp);
    let largest_rotation_rad = angles[angles.len() - 1];
    if largest_rotation_rad < NO_ROTATION_RAD {
        return Err(HandEyeError::NoRotation { largest_deg: largest_rotation_rad.to_degrees() });
    }
    let principal = axes.principal();
    if principal.spread_rad < PARALLEL_AXES_RAD {
        return Err(HandEyeError::ParallelAxes {
            axis: principal.axes[0].into(),
            frame: Mount::NAME,
            spread_deg: principal.spread_rad.to_degrees(),
        });
    }
    Ok(MotionSummary {
        views,
        largest_rotation_rad,
        median_rotation_rad: angles[angles.len() / 2],
        largest_translation_m,
        principal_axes: principal.axes,
        principal_rotations_rad: principal.rotations_rad,
        axis_spread_rad: principal.spread_rad,
    })
}

/// All pairs `i < j` of `views` views, in the order in which OpenCV visits them.
pub fn pairs_of(views: usize) -> impl Iterator<Item = (usize, usize)> {
    (0..views).flat_map(move |i| (i + 1..views).map(move |j| (i, j)))
}

/// `mount_j_from_mount_i`.
pub fn relative(
    anchor_from_mount_i: &Pose<Anchor, Mount>,
    anchor_from_mount_j: &Pose<Anchor, Mount>,
) -> Pose<Mount, Mount> {
    anchor_from_mount_j.inverse() * *anchor_from_mount_i
}

/// Angle in [0, π] radians, exact at both ends and independent of the quaternion's sign.
pub fn rotation_angle(rotation: &UnitQuaternion<f64>) -> f64 {
    2.0 * rotation.imag().norm().atan2(rotation.w.abs())
}

/// Second moment of rotation axes, each weighted with the squared chord of its angle.
///
/// Quaternion vectors enter in pairs, so neither their sign nor the direction of a half turn matters.
#[derive(Debug, Clone, Copy, Default)]
pub struct AxisScatter {
    moment: Matrix3<f64>,
    rotations: usize,
}

/// Eigenvectors of an [`AxisScatter`], strongest first.
#[derive(Debug, Clone, Copy)]
pub struct PrincipalAxes {
    /// The axes, unit vectors.
    pub axes: [Vector3<f64>; 3],
    /// RMS of the rotations about each, radians.
    pub rotations_rad: [f64; 3],
    /// How far the axes are from a single one, radians: 0 where all are parallel.
    pub spread_rad: f64,
}

impl AxisScatter {
    /// Counts a rotation. Its axis matters only above [`NO_ROTATION_RAD`].
    pub fn add(&mut self, rotation: &UnitQuaternion<f64>) {
        self.rotations += 1;
        if rotation_angle(rotation) >= NO_ROTATION_RAD {
            let chord = 2.0 * rotation.imag();
            self.moment += chord * chord.transpose();
        }
    }

    /// Axes, strengths and spread; the spread is 0 when there was no rotation.
    pub fn principal(&self) -> PrincipalAxes {
        let eigen = SymmetricEigen::new(self.moment);
        let mut order = [0, 1, 2];
        order.sort_by(|&a, &b| eigen.eigenvalues[b].total_cmp(&eigen.eigenvalues[a]));
        let count = self.rotations.max(1) as f64;
        // Rounding leaves eigenvalues of a singular matrix slightly negative.
        let rotations_rad = order.map(|k| (eigen.eigenvalues[k].max(0.0) / count).sqrt());
        let axes = order.map(|k| {
            let axis = eigen.eigenvectors.column(k).into_owned();
            axis * axis[axis.iamax()].signum()
        });
        PrincipalAxes { axes, rotations_rad, spread_rad: rotations_rad[1].atan2(rotations_rad[0]) }
    }

    /// Whether the rotations turn about at least two axes that are not parallel.
    pub fn spans_two_axes(&self) -> bool {
        self.principal().spread_rad >= PARALLEL_AXES_RAD
    }
}

#[cfg(test)]
#[path = "motion_tests.rs"]
mod tests;
