//! Errors of the robot that depend on where it stands: a field that is affine in the place of the tip.
//!
//! An arm whose links are not as its controller takes them to be is off by amounts that change smoothly over its
//! workspace. To first order the error of the tip, in its own axes, is an affine function of its place in the base. The
//! eighteen slopes are random effects with two variances of their own, position and orientation, which are found as those of the noise are (restricted maximum
//! likelihood). Without them a smooth error of the arm is taken for noise that is independent from view to view, and the
//! stated uncertainty is too small; or it looks like a board that moved, a target of another size or a wrong lens. Where
//! the data show none, the model goes without.
//!
//! Source: Henderson 1975, "Best linear unbiased estimation and prediction under a selection model" (random effects in
//! the normal equations).

use nalgebra::{DMatrix, Matrix3, Matrix6, Vector3, Vector6};

use super::arm_errors::ArmErrors;
use super::chain::correction_transform;
use handeye_geometry::frames::{Base, Pose, Tip};
use handeye_geometry::targets::observation::View;

/// Slopes: of six errors along three axes. Those of position are first; the three along one axis of the base are
/// neighbours.
pub(crate) const SLOPES: usize = 18;
/// Slopes of position, and of orientation.
pub(crate) const HALF: usize = SLOPES / 2;
/// Views from which on a field is looked for. With fewer there are not twice as many numbers as unknowns and slopes, and the
/// slopes are the noise.
pub const FIELD_VIEWS: usize = 10;
/// Least spread of the places, RMS, metres: an arm that turns on the spot has no field.
const LEAST_SPREAD_M: f64 = 1e-3;

/// The places of a session's views, as the field is a function of them.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Places {
    mean: Vector3<f64>,
    rms_m: f64,
    /// Largest distance from the mean.
    reach_m: f64,
}

impl Places {
    /// Of the reported tip poses; `None` where the tip stays where it is.
    pub fn of<'a>(poses: impl Iterator<Item = &'a Pose<Base, Tip>> + Clone) -> Option<Self> {
        let count = poses.clone().count() as f64;
        let mean = poses.clone().map(Pose::translation).sum::<Vector3<f64>>() / count;
        let distances = poses.map(|pose| (pose.translation() - mean).norm());
        let (squares, reach_m) = distances.fold((0.0, 0.0), |(sum, most): (f64, f64), d| (sum + d * d, most.max(d)));
        let rms_m = (squares / count).sqrt();
        (rms_m > LEAST_SPREAD_M).then_some(Self { mean, rms_m, reach_m })
    }

    /// The same where the poses are enough to show a field.
    pub fn for_field<'a>(poses: impl Iterator<Item = &'a Pose<Base, Tip>> + Clone) -> Option<Self> {
        if poses.clone().count() < FIELD_VIEWS { None } else { Self::of(poses) }
    }

    /// Where a pose is, in the base's axes; over the session of mean zero and RMS one. A pose beyond the reach of the
    /// session counts as at its edge: nothing is known of the field there.
    pub fn at(&self, base_from_tip: &Pose<Base, Tip>) -> Vector3<f64> {
        let from_mean = base_from_tip.translation() - self.mean;
        let within = (self.reach_m / from_mean.norm()).min(1.0);
        from_mean * (within / self.rms_m)
    }
}

/// How something turns with the slopes at a place, where `by_robot` is how it turns with the error of the tip.
pub(crate) fn columns(place: &Vector3<f64>, by_robot: &Matrix6<f64>) -> DMatrix<f64> {
    let mut columns = DMatrix::zeros(6, SLOPES);
    for (part, at) in [(0, 0), (3, HALF)] {
        for (axis, by) in place.iter().enumerate() {
            let slopes = by_robot.fixed_columns::<3>(part) * *by;
            columns.view_mut((0, at + 3 * axis), (6, 3)).copy_from(&slopes);
        }
    }
    columns
}

/// The error of the tip as an affine function of its place.
#[derive(Debug, Clone, PartialEq)]
pub struct PoseDependentError {
    places: Places,
    /// Metres and radians at a distance of the RMS spread of the places.
    slopes: [f64; SLOPES],
}

impl PoseDependentError {
    /// By its origin and its reach \[m\] and its slopes, as [`Self::position_slopes`] and [`Self::orientation_slopes`] give them.
    pub fn new(
        origin_m: Vector3<f64>,
        reach_m: f64,
        position_slopes: &Matrix3<f64>,
        orientation_slopes: &Matrix3<f64>,
    ) -> Self {
        let mut field = Self::none(Places { mean: origin_m, rms_m: 1.0, reach_m });
        field.slopes[..HALF].copy_from_slice(position_slopes.as_slice());
        field.slopes[HALF..].copy_from_slice(orientation_slopes.as_slice());
        field
    }

    pub(crate) fn none(places: Places) -> Self {
        Self { places, slopes: [0.0; SLOPES] }
    }

    /// The same slopes, affine as far as these poses go, too: where they are judged by what the field predicts and is uncertain
    /// by, a field that ends at the edge of the views that it was found from would predict the wrong error there.
    pub(crate) fn reaching<'a>(mut self, poses: impl Iterator<Item = &'a Pose<Base, Tip>>) -> Self {
        let distances = poses.map(|pose| (pose.translation() - self.places.mean).norm());
        self.places.reach_m = distances.fold(self.places.reach_m, f64::max);
        self
    }

    pub(crate) fn place(&self, base_from_tip: &Pose<Base, Tip>) -> Vector3<f64> {
        self.places.at(base_from_tip)
    }

    pub(crate) fn slopes(&self) -> &[f64; SLOPES] {
        &self.slopes
    }

    pub(crate) fn slopes_mut(&mut self) -> &mut [f64; SLOPES] {
        &mut self.slopes
    }

    /// Where the field is zero: the mean of the reported tip positions, base coordinates \[m\].
    pub fn origin_m(&self) -> Vector3<f64> {
        self.places.mean
    }

    /// How far from there the session went \[m\]; beyond it the field is what it is at that distance.
    pub fn reach_m(&self) -> f64 {
        self.places.reach_m
    }

    /// Metres of error per metre of way: `rho = A (p - origin)`, in the axes of the tip, for the tip at `p` in the base.
    pub fn position_slopes(&self) -> Matrix3<f64> {
        Matrix3::from_column_slice(&self.slopes[..HALF]) / self.places.rms_m
    }

    /// Radians of error per metre of way: the rotation vector `phi = B (p - origin)`, likewise.
    pub fn orientation_slopes(&self) -> Matrix3<f64> {
        Matrix3::from_column_slice(&self.slopes[HALF..]) / self.places.rms_m
    }

    /// Where the tip is by a reported pose.
    pub fn applied(&self, base_from_tip: &Pose<Base, Tip>) -> Pose<Base, Tip> {
        let correction = correction_transform(&self.correction(base_from_tip));
        Pose::from_isometry(base_from_tip.isometry() * correction)
    }

    /// Error of a reported tip pose: translation \[m\] and rotation vector \[rad\] in the axes of the tip. The true pose is
    /// `base_from_tip * (rho, exp(phi))`.
    pub fn correction(&self, base_from_tip: &Pose<Base, Tip>) -> Vector6<f64> {
        let place = self.place(base_from_tip);
        let part = |at: usize| Matrix3::from_column_slice(&self.slopes[at..at + HALF]) * place;
        let (rho, phi) = (part(0), part(HALF));
        Vector6::new(rho.x, rho.y, rho.z, phi.x, phi.y, phi.z)
    }
}

/// The reported tip pose of a view with what is known of the robot's errors taken out: those of its arm and its field.
pub fn corrected_base_from_tip(
    view: &View,
    arm: Option<&ArmErrors>,
    field: Option<&PoseDependentError>,
) -> Pose<Base, Tip> {
    let mut base_from_tip = *view.base_from_tip.isometry();
    if let Some(arm) = arm {
        base_from_tip *= arm.reported_from_true(&view.base_from_tip, &view.tip_from_joints);
    }
    if let Some(field) = field {
        base_from_tip *= correction_transform(&field.correction(&view.base_from_tip));
    }
    Pose::from_isometry(base_from_tip)
}

#[cfg(test)]
mod tests {
    use nalgebra::{DVector, Isometry3};

    use super::*;
    use handeye_geometry::se3;

    fn poses() -> Vec<Pose<Base, Tip>> {
        let twist = |k: usize| Vector6::from_fn(|i, _| ((7 * k + 3 * i) as f64).sin() * 0.3);
        (0..12).map(|k| Pose::from_isometry(se3::exp(&twist(k)))).collect()
    }

    #[test]
    fn the_columns_are_the_correction_by_the_slopes_and_the_formula_is_the_documented_one() {
        let poses = poses();
        let mut field = PoseDependentError::none(Places::of(poses.iter()).expect("they are apart"));
        for (k, slope) in field.slopes_mut().iter_mut().enumerate() {
            *slope = 1e-3 * (k as f64 + 1.0);
        }
        let by_robot = Matrix6::from_fn(|i, j| ((5 * i + j) as f64).cos());
        for pose in &poses {
            let correction = field.correction(pose);
            let by_columns = columns(&field.place(pose), &by_robot) * DVector::from_row_slice(field.slopes());
            assert!((by_columns - by_robot * correction).norm() < 1e-15);
            let from_origin = pose.translation() - field.origin_m();
            assert!((field.position_slopes() * from_origin - correction.fixed_rows::<3>(0)).norm() < 1e-15);
            assert!((field.orientation_slopes() * from_origin - correction.fixed_rows::<3>(3)).norm() < 1e-15);
            let read = PoseDependentError::new(
                field.origin_m(),
                field.reach_m(),
                &field.position_slopes(),
                &field.orientation_slopes(),
            );
            assert!((read.correction(pose) - correction).norm() < 1e-15);
        }
        let far: Pose<Base, Tip> = Pose::from_isometry(Isometry3::translation(1e3, 0.0, 0.0));
        let edge = field.position_slopes() * Vector3::x() * field.reach_m();
        assert!(
            (field.correction(&far).fixed_rows::<3>(0) - edge).norm() < 1e-2 * edge.norm(),
            "nothing is known there"
        );
        let sum = poses.iter().map(|pose| field.correction(pose)).sum::<Vector6<f64>>();
        assert!(sum.norm() < 1e-14, "the constant part is the links'");
    }

    #[test]
    fn a_tip_that_stays_has_no_places() {
        let pose: Pose<Base, Tip> = Pose::identity();
        assert_eq!(Places::of([pose; 10].iter()), None);
    }
}
