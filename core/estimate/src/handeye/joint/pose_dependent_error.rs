//! Pose-dependent errors of the robot: a field that is affine in the place of the tip.
//!
//! An arm whose links differ from its controller's model has errors that change smoothly over its workspace. To first order the
//! error of the tip is an affine function of its place in the base: errors near the wrist in the axes of the tip, errors near the
//! base in the axes of the base. The slopes, eighteen in the axes of a frame, are random effects with two variances of their own,
//! position and orientation, which are found as those of the noise are (restricted maximum likelihood). Without them a smooth error
//! of the arm is taken for noise that is independent from view to view, and the stated uncertainty is too small; or it looks like a
//! board that moved, a target of another size or a wrong lens. Where the data show no such error, it is left out of the model.
//!
//! By reported poses the slopes are those in the axes of the tip alone ([`IN_TIP`]): commands are then not corrected, and with more
//! freedom the transform follows the arm where it is exact and leaves more error to commands where it is not. Together with the
//! errors of an arm, by which commands are corrected, they are in both ([`IN_BOTH`]).
//!
//! Source: Henderson 1975, "Best linear unbiased estimation and prediction under a selection model" (random effects in
//! the normal equations).

use nalgebra::{DMatrix, DVectorView, Matrix3, Matrix6, Vector3, Vector6};

use super::arm_errors::ArmErrors;
use super::chain::correction_transform;
use handeye_geometry::frames::{Base, Pose, Tip};
use handeye_geometry::targets::observation::View;

/// Slopes of errors of one kind in the axes of one frame: along three axes of the base, which are neighbours.
pub(crate) const PER_FRAME: usize = 9;
/// Views from which on a field is tested for. With fewer there are not twice as many numbers as unknowns and slopes in the axes of
/// the tip, and the slopes are the noise. Together with an arm, where slopes and errors of links are more than the numbers of ten
/// views, prior knowledge of arms supplies what is missing.
pub const FIELD_VIEWS: usize = 10;
/// Least spread of the places, RMS, metres: an arm that turns on the spot has no field.
const LEAST_SPREAD_M: f64 = 1e-3;

/// The places of a session's views, of which the field is a function.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Places {
    mean: Vector3<f64>,
    /// Length to which slopes refer: the RMS distance from the mean.
    unit_m: f64,
    /// Largest distance from the mean.
    reach_m: f64,
}

impl Places {
    /// The places of the reported tip poses; `None` where the tip stays where it is.
    pub fn of<'a>(poses: impl Iterator<Item = &'a Pose<Base, Tip>> + Clone) -> Option<Self> {
        let count = poses.clone().count() as f64;
        let mean = poses.clone().map(Pose::translation).sum::<Vector3<f64>>() / count;
        let distances = poses.map(|pose| (pose.translation() - mean).norm());
        let (squares, reach_m) = distances.fold((0.0, 0.0), |(sum, most): (f64, f64), d| (sum + d * d, most.max(d)));
        let rms_m = (squares / count).sqrt();
        (rms_m > LEAST_SPREAD_M).then_some(Self { mean, unit_m: rms_m, reach_m })
    }

    /// The same where the poses are enough to show a field.
    pub fn for_field<'a>(poses: impl Iterator<Item = &'a Pose<Base, Tip>> + Clone) -> Option<Self> {
        if poses.clone().count() < FIELD_VIEWS { None } else { Self::of(poses) }
    }

    /// The place of a pose as argument of the field. A pose beyond the reach of the session counts as at its edge: nothing is
    /// known of the field there.
    pub fn at(&self, base_from_tip: &Pose<Base, Tip>) -> FieldAt {
        let from_mean = base_from_tip.translation() - self.mean;
        let within = (self.reach_m / from_mean.norm()).min(1.0);
        FieldAt {
            place: from_mean * (within / self.unit_m),
            tip_from_base: base_from_tip.rotation().inverse().to_rotation_matrix().into_inner(),
        }
    }
}

/// The frame whose axes an error is in.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Axes {
    Tip,
    Base,
}

/// A field for reported poses.
pub(crate) const IN_TIP: &[Axes] = &[Axes::Tip];
/// A field together with the errors of an arm.
pub(crate) const IN_BOTH: &[Axes] = &[Axes::Tip, Axes::Base];

/// A reported pose as argument of the field.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct FieldAt {
    /// Place from the middle of the session, in the axes of the base and over their spread.
    place: Vector3<f64>,
    tip_from_base: Matrix3<f64>,
}

impl FieldAt {
    /// Jacobian of something by the slopes in the axes of these frames, where `by_robot` is its Jacobian by the error of the tip:
    /// those of position, then those of orientation, each frame by frame.
    pub fn columns(&self, frames: &[Axes], by_robot: &Matrix6<f64>) -> DMatrix<f64> {
        let half = PER_FRAME * frames.len();
        let mut columns = DMatrix::zeros(6, 2 * half);
        for (part, first) in [(0, 0), (3, half)] {
            let in_tip = by_robot.fixed_columns::<3>(part).into_owned();
            for (k, axes) in frames.iter().enumerate() {
                let by_error = if *axes == Axes::Tip { in_tip } else { in_tip * self.tip_from_base };
                for (axis, by) in self.place.iter().enumerate() {
                    columns.columns_mut(first + PER_FRAME * k + 3 * axis, 3).copy_from(&(by_error * *by));
                }
            }
        }
        columns
    }
}

/// Slopes of errors in the axes of one frame.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Slopes {
    /// Metres of error per metre of distance.
    pub position: Matrix3<f64>,
    /// Radians of error per metre of distance, as a rotation vector.
    pub orientation: Matrix3<f64>,
}

/// The error of the tip as an affine function of its place.
#[derive(Debug, Clone, PartialEq)]
pub struct PoseDependentError {
    places: Places,
    frames: &'static [Axes],
    /// In the order of the columns of [`FieldAt::columns`]: metres and radians per unit of distance.
    slopes: Vec<f64>,
}

impl PoseDependentError {
    /// The field with this origin and reach \[m\] and these slopes, as [`Self::in_tip`] and [`Self::in_base`] give
    /// them.
    pub fn new(origin_m: Vector3<f64>, reach_m: f64, in_tip: &Slopes, in_base: Option<&Slopes>) -> Self {
        let frames: Vec<&Slopes> = std::iter::once(in_tip).chain(in_base).collect();
        let position = frames.iter().flat_map(|slopes| slopes.position.as_slice());
        let orientation = frames.iter().flat_map(|slopes| slopes.orientation.as_slice());
        Self {
            places: Places { mean: origin_m, unit_m: 1.0, reach_m },
            slopes: position.chain(orientation).copied().collect(),
            frames: if in_base.is_some() { IN_BOTH } else { IN_TIP },
        }
    }

    /// The same field with its slopes counted per another length \[m\].
    #[must_use]
    pub fn per(mut self, unit_m: f64) -> Self {
        for slope in &mut self.slopes {
            *slope *= unit_m / self.places.unit_m;
        }
        self.places.unit_m = unit_m;
        self
    }

    pub(crate) fn none(places: Places, frames: &'static [Axes]) -> Self {
        // The errors of all frames together at a typical distance are, per axis, as large as one slope.
        let places = Places { unit_m: places.unit_m * (frames.len() as f64).sqrt(), ..places };
        Self { places, frames, slopes: vec![0.0; 2 * PER_FRAME * frames.len()] }
    }

    /// The same slopes, affine out to these poses, too: where poses are judged by the prediction of the field and its
    /// uncertainty, a field that ends at the edge of the views that it was found from would predict the wrong error there.
    pub(crate) fn reaching<'a>(mut self, poses: impl Iterator<Item = &'a Pose<Base, Tip>>) -> Self {
        let distances = poses.map(|pose| (pose.translation() - self.places.mean).norm());
        self.places.reach_m = distances.fold(self.places.reach_m, f64::max);
        self
    }

    /// Jacobian of something by the slopes at a reported pose, where `by_robot` is its Jacobian by the error of the tip.
    pub(crate) fn columns(&self, base_from_tip: &Pose<Base, Tip>, by_robot: &Matrix6<f64>) -> DMatrix<f64> {
        self.places.at(base_from_tip).columns(self.frames, by_robot)
    }

    /// Position first, then orientation; each in the axes of the tip, then in those of the base where there are such; metres and
    /// radians per [`unit_m`](Self::unit_m), by columns.
    pub fn slopes(&self) -> &[f64] {
        &self.slopes
    }

    pub(crate) fn slopes_mut(&mut self) -> &mut [f64] {
        &mut self.slopes
    }

    /// Length to which the slopes refer, metres.
    pub fn unit_m(&self) -> f64 {
        self.places.unit_m
    }

    /// Where the field is zero: the mean of the reported tip positions, base coordinates \[m\].
    pub fn origin_m(&self) -> Vector3<f64> {
        self.places.mean
    }

    /// How far from there the session went \[m\]; beyond it the field is that at this distance.
    pub fn reach_m(&self) -> f64 {
        self.places.reach_m
    }

    /// Slopes of the errors in the axes of the tip.
    pub fn in_tip(&self) -> Slopes {
        self.in_frame(0)
    }

    /// Slopes of the errors in the axes of the base; `None` where these were not estimated.
    pub fn in_base(&self) -> Option<Slopes> {
        (self.frames.len() > 1).then(|| self.in_frame(1))
    }

    fn in_frame(&self, frame: usize) -> Slopes {
        let part = |half: usize| {
            let at = half * self.slopes.len() / 2 + frame * PER_FRAME;
            Matrix3::from_column_slice(&self.slopes[at..at + PER_FRAME]) / self.places.unit_m
        };
        Slopes { position: part(0), orientation: part(1) }
    }

    /// The true tip pose for a reported pose.
    pub fn applied(&self, base_from_tip: &Pose<Base, Tip>) -> Pose<Base, Tip> {
        let correction = correction_transform(&self.correction(base_from_tip));
        Pose::from_isometry(base_from_tip.isometry() * correction)
    }

    /// Error of a reported tip pose: translation \[m\] and rotation vector \[rad\] in the axes of the tip. The true pose is
    /// `base_from_tip * (rho, exp(phi))`; with `p` the reported place, `R` the reported rotation and slopes `A`, `B` in the axes of
    /// the tip and `A'`, `B'` in those of the base, `rho = (A + Rᵀ A') (p - origin)` and `phi = (B + Rᵀ B') (p - origin)`.
    pub(crate) fn correction(&self, base_from_tip: &Pose<Base, Tip>) -> Vector6<f64> {
        let by_slopes = self.columns(base_from_tip, &Matrix6::identity());
        let correction = by_slopes * DVectorView::from_slice(&self.slopes, self.slopes.len());
        Vector6::from_iterator(correction.iter().copied())
    }
}

/// The reported tip pose of a view with what is known of the robot's errors taken out: those of its arm, or its field.
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
        let by_robot = Matrix6::from_fn(|i, j| ((5 * i + j) as f64).cos());
        for frames in [IN_TIP, IN_BOTH] {
            let mut field = PoseDependentError::none(Places::of(poses.iter()).expect("they are apart"), frames);
            for (k, slope) in field.slopes_mut().iter_mut().enumerate() {
                *slope = 1e-3 * (k as f64 + 1.0);
            }
            let (tip, base) = (field.in_tip(), field.in_base());
            assert_eq!(base.is_some(), frames.len() == 2);
            let of_base = base.unwrap_or_default();
            for pose in &poses {
                let correction = field.correction(pose);
                let by_columns = field.columns(pose, &by_robot) * DVector::from_row_slice(field.slopes());
                assert!((by_columns - by_robot * correction).norm() < 1e-15);
                let from_origin = pose.translation() - field.origin_m();
                let turn = pose.rotation().inverse();
                let rho = tip.position * from_origin + turn * (of_base.position * from_origin);
                let phi = tip.orientation * from_origin + turn * (of_base.orientation * from_origin);
                assert!((rho - correction.fixed_rows::<3>(0)).norm() < 1e-15);
                assert!((phi - correction.fixed_rows::<3>(3)).norm() < 1e-15);
                let read = PoseDependentError::new(field.origin_m(), field.reach_m(), &tip, base.as_ref());
                assert!((read.correction(pose) - correction).norm() < 1e-15);
                assert!((read.per(0.3).correction(pose) - correction).norm() < 1e-15);
            }
            let far: Pose<Base, Tip> = Pose::from_isometry(Isometry3::translation(1e3, 0.0, 0.0));
            let edge = (tip.position + of_base.position) * Vector3::x() * field.reach_m();
            assert!(
                (field.correction(&far).fixed_rows::<3>(0) - edge).norm() < 1e-2 * edge.norm(),
                "nothing is known there"
            );
            if base.is_none() {
                let sum = poses.iter().map(|pose| field.correction(pose)).sum::<Vector6<f64>>();
                assert!(sum.norm() < 1e-14, "the constant part is the links'");
            }
        }
    }

    #[test]
    fn a_tip_that_stays_has_no_places() {
        let pose: Pose<Base, Tip> = Pose::identity();
        assert_eq!(Places::of([pose; 10].iter()), None);
    }
}
