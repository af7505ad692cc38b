//! Errors of the arm itself: angles and lengths of its links, and the compliance of its joints under gravity.
//!
//! # What it estimates
//! For every joint behind the first the direction of its axis (two angles) and its place (two lengths); for every joint between
//! the first and the last its zero; for every joint behind the first its compliance. For revolute joints these are a complete
//! description of a chain: where two axes are parallel, the two angles are those of Hayati. Some errors can be expressed in two
//! ways (a zero as a turn of all axes behind it); their priors decide between them.
//!
//! The first joint's axis and zero, and the last joint's zero, are in the two rigid links of the calibration: no view separates
//! one from the other. They are zero here by convention.
//!
//! # Model
//! With `T_j = tip_from_joint_j` at the reported pose, the true tip pose is `reported · Π_j T_j e_j T_j⁻¹`, exactly, where `e_j` is
//! the error of joint `j` in its frame at rest (`P_j` becomes `P_j e_j` in the product `Π P_j M_j(q_j)`): a displacement of its
//! place, and a rotation of its axis and zero. It needs no angles: the frames of a view hold all that the errors depend on.
//!
//! The deflection of a joint is its compliance times the torque of gravity about its axis, over the largest that it could be.
//! As masses are not known every joint and the tip weigh the same, and the base's z axis is vertical.
//!
//! The numbers are random effects with three levels (angles, lengths, compliance), which are found and integrated as all other
//! noise is, under what is known of arms ([`LEVELS_OF_ARMS`]). Where the views show that something else changes smoothly with the
//! place of the tip, a field ([`PoseDependentError`]) is between the tip by its links and the true one.
//!
//! # Reference
//! Hayati & Mirmirani 1985, "Improving the absolute positioning accuracy of robot manipulators" (parallel axes); Mooring, Roth &
//! Driels 1991, "Fundamentals of manipulator calibration", §3 (complete and minimal chains).

use nalgebra::{Isometry3, Matrix6xX, Vector3, Vector6};

use super::chain::{correction_jacobian, correction_transform};
use super::pose_dependent_error::PoseDependentError;
use handeye_geometry::frames::{Base, Pose, Tip};
use handeye_geometry::se3;
use handeye_geometry::targets::observation::View;

/// Levels that arms have, before any data: of angles \[rad\], lengths \[m\] and compliance \[rad where all of the arm is stretched
/// out\]. A level `s` with such an `s_0` has the density of a Cauchy distribution, `1 / (1 + (s / s_0)²)`: an exact arm has a level
/// of zero, and a cheap one tens of `s_0`.
///
/// The factory calibrations of 17 arms of Universal Robots have medians of 0.03 to 0.17° and 0.03 to 0.4 mm a parameter; a cobot
/// deflects by some millimetres under its payload.
pub const LEVELS_OF_ARMS: [f64; 3] = [0.1 * std::f64::consts::PI / 180.0, 2e-4, 0.05 * std::f64::consts::PI / 180.0];

/// Number of levels.
pub(crate) const KINDS: usize = LEVELS_OF_ARMS.len();

/// What can be off about a joint.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum LinkError {
    /// Direction of its axis: rotation about x of its frame, radians.
    TiltX,
    /// The same about y.
    TiltY,
    /// Its zero: rotation about its axis, radians.
    Zero,
    /// Place of its axis along x of its frame, metres.
    ShiftX,
    /// The same along y.
    ShiftY,
    /// Its deflection where gravity turns it with the whole weight behind it, radians.
    Compliance,
}

impl LinkError {
    /// Which of [`LEVELS_OF_ARMS`] it has.
    pub(crate) fn kind(self) -> usize {
        match self {
            Self::TiltX | Self::TiltY | Self::Zero => 0,
            Self::ShiftX | Self::ShiftY => 1,
            Self::Compliance => 2,
        }
    }

    /// The effect of a unit of it in the frame of the joint, where gravity turns the joint with a part `torque` of the
    /// largest torque.
    fn unit(self, torque: f64) -> Vector6<f64> {
        let mut unit = Vector6::zeros();
        let (place, value) = match self {
            Self::ShiftX => (0, 1.0),
            Self::ShiftY => (1, 1.0),
            Self::TiltX => (3, 1.0),
            Self::TiltY => (4, 1.0),
            Self::Zero => (5, 1.0),
            Self::Compliance => (5, torque),
        };
        unit[place] = value;
        unit
    }
}

/// What is off about which joint.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ArmParameter {
    /// The joint, counted from 0.
    pub joint: usize,
    /// The kind of error.
    pub error: LinkError,
}

/// What can be off about an arm with this many joints, in the order in which it is estimated: all angles, all lengths,
/// all compliances.
pub fn arm_parameters(joints: usize) -> Vec<ArmParameter> {
    let of = |errors: &'static [LinkError]| {
        let all = (1..joints).flat_map(move |joint| errors.iter().map(move |&error| ArmParameter { joint, error }));
        all.filter(move |parameter| parameter.error != LinkError::Zero || parameter.joint + 1 < joints)
    };
    let angles = of(&[LinkError::TiltX, LinkError::TiltY, LinkError::Zero]);
    angles.chain(of(&[LinkError::ShiftX, LinkError::ShiftY])).chain(of(&[LinkError::Compliance])).collect()
}

/// Errors of the joints and links of an arm, with the convention that makes them unique.
#[derive(Debug, Clone, PartialEq)]
pub struct ArmErrors {
    joints: usize,
    /// The values in the order of [`arm_parameters`].
    values: Vec<f64>,
    /// The error that changes smoothly with the place of the tip and is not an error of a link.
    field: Option<PoseDependentError>,
}

/// Where the tip really is, in the frame of the reported tip.
#[derive(Debug, Clone)]
pub struct TrueTip {
    /// `reported_from_true`
    pub reported_from_true: Isometry3<f64>,
    /// The twists `[t; r]` on its right by which it changes with the errors, in the order of [`ArmErrors::numbers`].
    pub by_errors: Matrix6xX<f64>,
}

impl ArmErrors {
    /// No errors, of an arm with this many joints.
    pub fn none(joints: usize) -> Self {
        Self { joints, values: vec![0.0; arm_parameters(joints).len()], field: None }
    }

    /// Errors with these values, in the order of [`arm_parameters`]; `None` for another number of them.
    pub fn new(joints: usize, values: Vec<f64>) -> Option<Self> {
        (values.len() == arm_parameters(joints).len()).then_some(Self { joints, values, field: None })
    }

    /// The same with a part that changes with the place of the tip and is not an error of a link, or without one.
    #[must_use]
    pub fn with_field(self, field: Option<PoseDependentError>) -> Self {
        Self { field, ..self }
    }

    /// The part that changes smoothly with the place of the tip.
    pub fn field(&self) -> Option<&PoseDependentError> {
        self.field.as_ref()
    }

    /// Number of joints.
    pub fn joint_count(&self) -> usize {
        self.joints
    }

    /// Errors of the links and joints, in the order of [`arm_parameters`]: radians and metres.
    pub fn values(&self) -> &[f64] {
        &self.values
    }

    /// All numbers: the slopes of the field, where there is one, then [`values`](Self::values).
    pub(crate) fn numbers(&self) -> impl Iterator<Item = f64> {
        self.field.iter().flat_map(PoseDependentError::slopes).chain(&self.values).copied()
    }

    /// How many numbers there are.
    pub fn number_count(&self) -> usize {
        self.values.len() + self.slope_count()
    }

    /// How many of them are slopes.
    pub fn slope_count(&self) -> usize {
        self.field.as_ref().map_or(0, |field| field.slopes().len())
    }

    /// The numbers in the order of [`numbers`](Self::numbers), to be changed.
    pub(crate) fn numbers_mut(&mut self) -> impl Iterator<Item = &mut f64> {
        self.field.iter_mut().flat_map(PoseDependentError::slopes_mut).chain(&mut self.values)
    }

    /// Number of values with each level.
    pub(crate) fn counts(&self) -> [usize; KINDS] {
        let parameters = arm_parameters(self.joints);
        std::array::from_fn(|kind| parameters.iter().filter(|parameter| parameter.error.kind() == kind).count())
    }

    /// Where the tip of a view really is; as reported where the view has no joint values.
    pub(crate) fn of_view(&self, view: &View) -> TrueTip {
        self.true_tip(&view.base_from_tip, &view.tip_from_joints)
    }

    /// Where the tip really is when it is reported at `base_from_tip` with its joints at `tip_from_joints`, as
    /// [`View::tip_from_joints`]; where it is reported when these are not of this arm.
    pub fn true_tip(&self, base_from_tip: &Pose<Base, Tip>, tip_from_joints: &[Isometry3<f64>]) -> TrueTip {
        let parameters = arm_parameters(self.joints);
        let mut by_errors = Matrix6xX::zeros(self.number_count());
        let mut reported_from_true = Isometry3::identity();
        if tip_from_joints.len() != self.joints {
            return TrueTip { reported_from_true, by_errors };
        }
        let torques = torques(base_from_tip, tip_from_joints);
        let errors = self.of_joints(&parameters, &torques);
        let mut slopes = 0;
        if let Some(field) = &self.field {
            let correction = field.correction(base_from_tip);
            let columns = field.columns(base_from_tip, &correction_jacobian(&correction));
            slopes = columns.ncols();
            by_errors.columns_mut(0, slopes).copy_from(&columns);
            reported_from_true = correction_transform(&correction);
        }
        // From the last joint to the first: the effect of a joint at the tip is carried through the errors behind it.
        for joint in (1..self.joints).rev() {
            let tip_from_joint = tip_from_joints[joint];
            let through =
                se3::adjoint(&(reported_from_true.inverse() * tip_from_joint)) * correction_jacobian(&errors[joint]);
            for (k, parameter) in parameters.iter().enumerate().filter(|(_, parameter)| parameter.joint == joint) {
                by_errors.set_column(slopes + k, &(through * parameter.error.unit(torques[joint])));
            }
            reported_from_true = moved_by(&errors[joint], &tip_from_joint) * reported_from_true;
        }
        TrueTip { reported_from_true, by_errors }
    }

    /// [`TrueTip::reported_from_true`] alone.
    pub(crate) fn reported_from_true(
        &self,
        base_from_tip: &Pose<Base, Tip>,
        tip_from_joints: &[Isometry3<f64>],
    ) -> Isometry3<f64> {
        if tip_from_joints.len() != self.joints {
            return Isometry3::identity();
        }
        let errors = self.of_joints(&arm_parameters(self.joints), &torques(base_from_tip, tip_from_joints));
        let by_links = errors
            .iter()
            .zip(tip_from_joints)
            .fold(Isometry3::identity(), |tip, (error, tip_from_joint)| tip * moved_by(error, tip_from_joint));
        let field = self.field.as_ref();
        field.map_or(by_links, |field| by_links * correction_transform(&field.correction(base_from_tip)))
    }

    /// Displacement of each joint in its frame at rest, without the effect of gravity and without the field.
    pub(crate) fn at_rest(&self) -> Vec<Isometry3<f64>> {
        let weightless = vec![0.0; self.joints];
        self.of_joints(&arm_parameters(self.joints), &weightless).iter().map(correction_transform).collect()
    }

    /// The error of every joint in its frame at rest, as a correction.
    fn of_joints(&self, parameters: &[ArmParameter], torques: &[f64]) -> Vec<Vector6<f64>> {
        let mut errors = vec![Vector6::zeros(); self.joints];
        for (parameter, value) in parameters.iter().zip(&self.values) {
            errors[parameter.joint] += parameter.error.unit(torques[parameter.joint]) * *value;
        }
        errors
    }
}

/// The effect at the tip of an error in the frame of a joint.
fn moved_by(error: &Vector6<f64>, tip_from_joint: &Isometry3<f64>) -> Isometry3<f64> {
    tip_from_joint * correction_transform(error) * tip_from_joint.inverse()
}

/// The torques of gravity about the joints, over the largest that they could be, where every joint and the tip weigh the
/// same.
fn torques(base_from_tip: &Pose<Base, Tip>, tip_from_joints: &[Isometry3<f64>]) -> Vec<f64> {
    let down = base_from_tip.isometry().rotation.inverse() * -Vector3::z();
    let mut places: Vec<Vector3<f64>> = tip_from_joints.iter().map(|joint| joint.translation.vector).collect();
    places.push(Vector3::zeros());
    let of = |(joint, frame): (usize, &Isometry3<f64>)| {
        let behind = &places[joint..];
        let (mut way, mut longest, mut lever) = (0.0, 0.0, Vector3::zeros());
        for pair in behind.windows(2) {
            way += (pair[1] - pair[0]).norm();
            longest += way;
            lever += pair[1] - places[joint];
        }
        let torque = lever.cross(&down).dot(&(frame.rotation * Vector3::z()));
        if longest > 0.0 { torque / longest } else { 0.0 }
    };
    tip_from_joints.iter().enumerate().map(of).collect()
}

#[cfg(test)]
mod tests {
    use nalgebra::Matrix3;

    use super::*;
    use crate::handeye::joint::pose_dependent_error::Slopes;

    fn frames() -> Vec<Isometry3<f64>> {
        let twist = |j: usize| Vector6::from_fn(|i, _| ((5 * j + 3 * i) as f64).sin() * if i < 3 { 0.4 } else { 1.2 });
        (0..6).map(|j| se3::exp(&twist(j))).collect()
    }

    fn errors() -> ArmErrors {
        let count = arm_parameters(6).len();
        ArmErrors::new(6, (0..count).map(|k| ((k * k) as f64).sin() * 0.03).collect()).expect("so many")
    }

    fn errors_and_a_field() -> ArmErrors {
        let slopes = |s: f64| Slopes {
            position: Matrix3::from_fn(|i, j| (s + (3 * i + j) as f64).sin() * 0.05),
            orientation: Matrix3::from_fn(|i, j| (s + (2 * i + 5 * j) as f64).cos() * 0.1),
        };
        errors().with_field(Some(PoseDependentError::new(Vector3::x(), 2.0, &slopes(0.3), Some(&slopes(1.4)))))
    }

    #[test]
    fn the_derivatives_are_those_of_the_exact_chain() {
        const STEP: f64 = 1e-6;
        let (frames, pose) = (frames(), Pose::from_isometry(frames()[2]));
        for errors in [errors(), errors_and_a_field()] {
            let at = errors.true_tip(&pose, &frames);
            let alone = errors.reported_from_true(&pose, &frames);
            assert!(se3::log(&(at.reported_from_true.inverse() * alone)).norm() < 1e-12);
            assert_eq!(errors.numbers().count(), errors.number_count());
            for k in 0..errors.number_count() {
                let mut moved = errors.clone();
                *moved.numbers_mut().nth(k).expect("so many") += STEP;
                let after = moved.true_tip(&pose, &frames).reported_from_true;
                let turned = se3::log(&(at.reported_from_true.inverse() * after)) / STEP;
                assert!((turned - at.by_errors.column(k)).norm() < 1e-5, "{k}: {turned} {}", at.by_errors.column(k));
            }
        }
    }

    #[test]
    fn it_is_the_product_with_an_error_in_every_frame_at_rest() {
        // P_1 M_1 P_2 M_2 … F with the errors inserted at their joints, by the motions themselves.
        let rest = |j: usize| se3::exp(&Vector6::from_fn(|i, _| ((7 * j + i) as f64).cos() * 0.5));
        let angle = |j: usize| 0.3 * j as f64 - 0.7;
        let motion = |j: usize| se3::exp(&(Vector6::ith(5, angle(j))));
        let errors = errors();
        let nothing = ArmErrors::none(6);
        let chain = |errors: &ArmErrors, torques: &[f64]| {
            let mut pose = Isometry3::identity();
            let mut frames = Vec::new();
            for (j, torque) in torques.iter().enumerate() {
                let of_joint = arm_parameters(6).into_iter().zip(errors.values()).filter(|(p, _)| p.joint == j);
                let error: Vector6<f64> = of_joint.map(|(p, value)| p.error.unit(*torque) * *value).sum();
                pose *= rest(j);
                frames.push(pose);
                pose *= correction_transform(&error) * motion(j);
            }
            (pose * rest(6), frames)
        };
        let (reported, frames) = chain(&nothing, &[0.0; 6]);
        let frames: Vec<_> = frames.iter().map(|frame| reported.inverse() * frame).collect();
        let torques = torques(&Pose::from_isometry(reported), &frames);
        assert!(torques.iter().all(|torque| torque.abs() <= 1.0) && torques.iter().any(|torque| torque.abs() > 0.1));
        let (truly, _) = chain(&errors, &torques);
        let at = Pose::from_isometry(reported);
        for shift in [errors.true_tip(&at, &frames).reported_from_true, errors.reported_from_true(&at, &frames)] {
            assert!(se3::log(&(truly.inverse() * reported * shift)).norm() < 1e-12);
        }
    }

    #[test]
    fn six_joints_have_fourteen_angles_ten_lengths_and_five_compliances() {
        assert_eq!(ArmErrors::none(6).counts(), [14, 10, 5]);
        let sorted = arm_parameters(6).windows(2).all(|pair| pair[0].error.kind() <= pair[1].error.kind());
        assert!(sorted, "each level has neighbours");
    }
}
