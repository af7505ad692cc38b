//! The errors of an arm in a result, and the arm that is corrected by them.

use nalgebra::{DMatrix, Matrix6};
use serde::{Deserialize, Serialize};

use super::check::{BadResult, Checked, all_finite, not_negative, require};
use super::{BoardEstimate, IntrinsicsEstimate, OverdispersionRecord, PoseDependentErrorEstimate, TransformEstimate};
use handeye_arm::Arm;
use handeye_estimate::ArmFit;
use handeye_estimate::corrected_arm::CorrectedArm;
use handeye_estimate::handeye::joint::{ArmErrors, LinkError, PoseDependentError, SmallSample, arm_parameters};
use handeye_estimate::reach_error::USUAL_TOOL_M;

/// The errors of the robot's arm as the images show them, and the transforms for corrected poses.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ArmEstimate {
    /// The arm as its controller models it, at its place and with the tip at its end: metres and radians.
    pub chain: Arm,
    /// Position of the tool's tip, in the frame of the tip, for the reach errors of `quality`, metres.
    #[serde(default = "usual_tool")]
    pub tool_m: [f64; 3],
    /// Errors of each joint, from the base to the tip.
    pub joints: Vec<JointErrorEstimate>,
    /// Typical size of errors of each kind in this arm.
    pub levels: ArmLevels,
    /// The part of the robot's error that they do not explain, one standard deviation per axis.
    pub unexplained: Unexplained,
    /// The camera on its mount, to be used with corrected poses alone.
    pub hand_eye: TransformEstimate,
    /// The target, estimated with the arm as well.
    pub target: TransformEstimate,
    /// The intrinsics that belong to `hand_eye`: estimated with the arm it differs from that by reported poses. Older results do
    /// not have it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub intrinsics: Option<IntrinsicsEstimate>,
    /// The target's shape that belongs to them, where it was estimated.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub board: Option<BoardEstimate>,
    /// Errors that depend on where the tip is and that joints and links do not explain, where the data show them: `E` of the
    /// reported pose, behind the pose of the tip by the chain with its errors. Corrected poses include it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub field: Option<PoseDependentErrorEstimate>,
    /// Covariance of the errors, radians and metres: for the joints in their order all `tilt` (x, y) and `zero`, then all `shift`
    /// (x, y), then all `compliance`; what is null in `joints` is left out. Where there is a `field`, then its slopes by columns:
    /// all of
    /// the position (tip, base), then all of the orientation.
    pub covariance: Vec<Vec<f64>>,
    /// Factor by which the covariances were widened, as in [`EstimateDetails`](super::EstimateDetails); `None` where they were
    /// not.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub widening: Option<OverdispersionRecord>,
    /// As in [`EstimateDetails`](super::EstimateDetails).
    pub degrees_of_freedom: Option<f64>,
    /// As in [`EstimateDetails`](super::EstimateDetails).
    pub region_scale: f64,
    /// RMS of 2-D corner residuals on views left out, pixels; `None` with too few of them.
    pub heldout_px: Option<HeldOutByArm>,
    /// Whether held-out views contradict the errors, as corrected poses predict them worse than chance and the model explain: then
    /// do not correct.
    pub contradicted: bool,
}

/// Results without a tool were made with this one.
fn usual_tool() -> [f64; 3] {
    [0.0, 0.0, USUAL_TOOL_M]
}

/// Errors of one joint, each with its standard deviation. Those that no view can separate from the two transforms are
/// `None`.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct JointErrorEstimate {
    /// Name of the joint.
    pub name: String,
    /// Direction of its axis, rotation about x and y of its frame, degrees.
    pub tilt_deg: Option<[f64; 2]>,
    /// Standard deviations.
    pub tilt_sigma_deg: Option<[f64; 2]>,
    /// Its zero, to be added to the reported angle, degrees.
    pub zero_deg: Option<f64>,
    /// Standard deviation.
    pub zero_sigma_deg: Option<f64>,
    /// Place of its axis along x and y of its frame, millimetres.
    pub shift_mm: Option<[f64; 2]>,
    /// Standard deviations.
    pub shift_sigma_mm: Option<[f64; 2]>,
    /// Deflection under gravity with all the weight behind the joint, degrees.
    pub compliance_deg: Option<f64>,
    /// Standard deviation.
    pub compliance_sigma_deg: Option<f64>,
}

/// Standard deviations of the errors of this arm by their kind.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct ArmLevels {
    /// Tilts and zeros, degrees.
    pub angle_deg: f64,
    /// Shifts, millimetres.
    pub length_mm: f64,
    /// Compliances, degrees.
    pub compliance_deg: f64,
}

/// Noise of corrected tip poses.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Unexplained {
    /// Position, millimetres.
    pub translation_mm: f64,
    /// Orientation, degrees.
    pub rotation_deg: f64,
}

/// Errors on views left out of the fit.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct HeldOutByArm {
    /// Predicted from reported poses.
    pub reported: f64,
    /// Predicted from corrected ones.
    pub corrected: f64,
}

/// The fields of the value and the standard deviation of an error.
fn slot(joint: &mut JointErrorEstimate, error: LinkError) -> (&mut f64, &mut f64) {
    let JointErrorEstimate { tilt_deg, tilt_sigma_deg, shift_mm, shift_sigma_mm, .. } = joint;
    let (values, sigmas, axis) = match error {
        LinkError::TiltX => (tilt_deg, tilt_sigma_deg, 0),
        LinkError::TiltY => (tilt_deg, tilt_sigma_deg, 1),
        LinkError::ShiftX => (shift_mm, shift_sigma_mm, 0),
        LinkError::ShiftY => (shift_mm, shift_sigma_mm, 1),
        LinkError::Zero => return (joint.zero_deg.get_or_insert(0.0), joint.zero_sigma_deg.get_or_insert(0.0)),
        LinkError::Compliance => {
            return (joint.compliance_deg.get_or_insert(0.0), joint.compliance_sigma_deg.get_or_insert(0.0));
        }
    };
    (&mut values.get_or_insert([0.0; 2])[axis], &mut sigmas.get_or_insert([0.0; 2])[axis])
}

fn value_of(joint: &JointErrorEstimate, error: LinkError) -> Option<f64> {
    match error {
        LinkError::TiltX => joint.tilt_deg.map(|tilt| tilt[0]),
        LinkError::TiltY => joint.tilt_deg.map(|tilt| tilt[1]),
        LinkError::ShiftX => joint.shift_mm.map(|shift| shift[0]),
        LinkError::ShiftY => joint.shift_mm.map(|shift| shift[1]),
        LinkError::Zero => joint.zero_deg,
        LinkError::Compliance => joint.compliance_deg,
    }
}

/// Units of the document per unit of the estimate.
fn shown_per_unit(error: LinkError) -> f64 {
    match error {
        LinkError::ShiftX | LinkError::ShiftY => 1e3,
        _ => 180.0 / std::f64::consts::PI,
    }
}

/// The covariance of errors in the order and the units of the document: slopes last and per metre.
fn of_document(errors: &ArmErrors, covariance: &DMatrix<f64>) -> DMatrix<f64> {
    let (count, unit_m) = (errors.number_count(), errors.field().map_or(1.0, PoseDependentError::unit_m));
    let slopes = errors.slope_count();
    let number = |k: usize| (k + slopes) % count;
    let per_unit = |k: usize| if k + slopes < count { 1.0 } else { unit_m.recip() };
    DMatrix::from_fn(count, count, |i, j| covariance[(number(i), number(j))] * per_unit(i) * per_unit(j))
}

impl ArmEstimate {
    /// The record of a fit of an arm's errors; `None` where the arm has another number of joints.
    pub fn new(chain: &Arm, fit: &ArmFit, tool_m: [f64; 3]) -> Option<Self> {
        if chain.joint_count() != fit.errors.joint_count() {
            return None;
        }
        let name = |joint: &handeye_arm::Joint| JointErrorEstimate { name: joint.name.clone(), ..Default::default() };
        let mut joints: Vec<JointErrorEstimate> = chain.joints().iter().map(name).collect();
        let numbers = fit.errors.values().iter().zip(fit.sigma());
        for (parameter, (value, sigma)) in arm_parameters(chain.joint_count()).iter().zip(numbers) {
            let shown = shown_per_unit(parameter.error);
            let (value_at, sigma_at) = slot(&mut joints[parameter.joint], parameter.error);
            (*value_at, *sigma_at) = (value * shown, sigma * shown);
        }
        let block = |at: usize| -> Matrix6<f64> { fit.covariance.fixed_view::<6, 6>(at, at).into_owned() };
        let (hand_eye, target) = TransformEstimate::of_links(&fit.hand_eye, Some(&block(0)), Some(&block(6)));
        let of_errors = of_document(&fit.errors, &fit.errors_covariance());
        let lens_sigma = fit.intrinsics_sigma();
        let sigma = lens_sigma.first_chunk().copied();
        let intrinsics = IntrinsicsEstimate::new(&fit.others.intrinsics, sigma, lens_sigma.is_empty());
        Some(Self {
            chain: chain.clone(),
            tool_m,
            joints,
            levels: ArmLevels {
                angle_deg: fit.noise.link_rad.to_degrees(),
                length_mm: fit.noise.link_m * 1e3,
                compliance_deg: fit.noise.compliance_rad.to_degrees(),
            },
            unexplained: Unexplained {
                translation_mm: fit.noise.robot_m * 1e3,
                rotation_deg: fit.noise.robot_rad.to_degrees(),
            },
            hand_eye,
            target,
            intrinsics: Some(intrinsics),
            board: fit.shape().map(BoardEstimate::from),
            field: fit.errors.field().map(|it| PoseDependentErrorEstimate::new(it, &fit.noise, None)),
            covariance: of_errors.row_iter().map(|row| row.iter().copied().collect()).collect(),
            widening: Some(OverdispersionRecord::from(&fit.widening))
                .filter(|widening| widening.factor > 1.0 || widening.lens_factor.is_some()),
            degrees_of_freedom: Some(fit.small_sample.degrees_of_freedom).filter(|value| value.is_finite()),
            region_scale: fit.small_sample.scale,
            heldout_px: fit.heldout_px.map(|[reported, corrected]| HeldOutByArm { reported, corrected }),
            contradicted: fit.contradicted,
        })
    }

    /// The arm that is corrected by it.
    ///
    /// # Errors
    /// [`BadResult`] names the value that does not fit the number of joints.
    pub fn corrected_arm(&self) -> Result<CorrectedArm, BadResult> {
        self.check()?;
        let parameters = arm_parameters(self.chain.joint_count());
        let values = parameters.iter().map(|parameter| {
            value_of(&self.joints[parameter.joint], parameter.error).unwrap_or(0.0) / shown_per_unit(parameter.error)
        });
        let errors = ArmErrors::new(self.chain.joint_count(), values.collect())
            .ok_or(BadResult { at: "arm.joints".to_owned(), problem: "are not those of the chain" })?
            .with_field(self.field.as_ref().map(PoseDependentErrorEstimate::field));
        let (count, slopes) = (errors.number_count(), errors.slope_count());
        let place = |k: usize| (k + count - slopes) % count;
        Ok(CorrectedArm {
            arm: self.chain.clone(),
            errors,
            covariance: DMatrix::from_fn(count, count, |i, j| self.covariance[place(i)][place(j)]),
            unexplained: (self.unexplained.translation_mm * 1e-3, self.unexplained.rotation_deg.to_radians()),
            small_sample: SmallSample {
                degrees_of_freedom: self.degrees_of_freedom.unwrap_or(SmallSample::KNOWN.degrees_of_freedom),
                scale: self.region_scale,
                ..SmallSample::KNOWN
            },
            tool_m: self.tool_m.into(),
        })
    }

    pub(super) fn check(&self) -> Checked {
        let parameters = arm_parameters(self.chain.joint_count());
        require(self.joints.len() == self.chain.joint_count(), "arm.joints", "must be as many as those of the chain")?;
        all_finite(&self.tool_m, "arm.tool_m")?;
        self.intrinsics.as_ref().map_or(Ok(()), |intrinsics| intrinsics.check("arm.intrinsics"))?;
        self.board.as_ref().map_or(Ok(()), |board| board.check("arm.board"))?;
        for parameter in &parameters {
            let value = value_of(&self.joints[parameter.joint], parameter.error);
            require(value.is_some_and(f64::is_finite), "arm.joints", "must have a number for all but the first joint")?;
        }
        self.field.as_ref().map_or(Ok(()), |field| field.check("arm.field"))?;
        let count = parameters.len() + self.field.as_ref().map_or(0, |field| field.field().slopes().len());
        self.widening.as_ref().map_or(Ok(()), |widening| widening.check("arm.widening"))?;
        let is_square = self.covariance.iter().all(|row| row.len() == count);
        require(self.covariance.len() == count && is_square, "arm.covariance", "is of another arm")?;
        for row in &self.covariance {
            all_finite(row, "arm.covariance")?;
        }
        let ArmLevels { angle_deg, length_mm, compliance_deg } = self.levels;
        let Unexplained { translation_mm, rotation_deg } = self.unexplained;
        for (value, at) in [
            (angle_deg, "arm.levels.angle_deg"),
            (length_mm, "arm.levels.length_mm"),
            (compliance_deg, "arm.levels.compliance_deg"),
            (translation_mm, "arm.unexplained.translation_mm"),
            (rotation_deg, "arm.unexplained.rotation_deg"),
        ] {
            not_negative(Some(value), at)?;
        }
        require(self.region_scale > 0.0, "arm.region_scale", "must be positive")
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{golden_arm, golden_arm_with_a_field};

    #[test]
    fn an_arm_with_a_field_comes_back_with_the_same_tip_and_the_same_uncertainty() {
        let (chain, fit) = golden_arm_with_a_field();
        let estimate = ArmEstimate::new(&chain, &fit, usual_tool()).expect("six joints");
        assert!((estimate.covariance[0][0] - fit.sigma()[0].powi(2)).abs() < 1e-20, "joints come first");
        let text = serde_json::to_string(&estimate).expect("plain data");
        let read: ArmEstimate = serde_json::from_str(&text).expect("the same");
        let (here, there) =
            (CorrectedArm::new(chain, &fit).expect("six joints"), read.corrected_arm().expect("of an arm"));
        let without = CorrectedArm { errors: here.errors.clone().with_field(None), ..here.clone() };
        for joints in [[0.1, -1.2, 1.4, -1.8, -1.6, 0.2], [0.6, -1.5, 1.1, -1.2, -1.3, -0.4]] {
            let tip = here.actual(&joints).expect("six");
            let (m, rad) = tip.distance_to(&there.actual(&joints).expect("six"));
            assert!(m < 1e-12 && rad < 1e-7, "{m} m, {rad} rad");
            assert!(tip.distance_to(&without.actual(&joints).expect("six")).0 > 1e-5, "the field moves it");
            let (a, b) = (here.error_95_m(&joints).expect("six"), there.error_95_m(&joints).expect("six"));
            assert!((a / b - 1.0).abs() < 1e-9, "{a} {b}");
        }
        let mut other = estimate;
        other.field = None;
        assert_eq!(other.corrected_arm().expect_err("of more numbers").at, "arm.covariance");
    }

    #[test]
    fn an_arm_comes_back_from_its_document_with_the_same_errors() {
        let (chain, fit) = golden_arm();
        let estimate = ArmEstimate::new(&chain, &fit, usual_tool()).expect("six joints");
        assert_eq!(
            estimate.joints[0],
            JointErrorEstimate { name: estimate.joints[0].name.clone(), ..Default::default() }
        );
        assert!(estimate.joints[5].zero_deg.is_none() && estimate.joints[4].zero_deg.is_some());
        let text = serde_json::to_string(&estimate).expect("plain data");
        let read: ArmEstimate = serde_json::from_str(&text).expect("the same");
        let (here, there) =
            (CorrectedArm::new(chain, &fit).expect("six joints"), read.corrected_arm().expect("of an arm"));
        for (a, b) in here.errors.values().iter().zip(there.errors.values()) {
            assert!((a - b).abs() < 1e-15, "{a} {b}");
        }
        assert_eq!(here.covariance, there.covariance);
        let lens = read.intrinsics.as_ref().and_then(IntrinsicsEstimate::intrinsics);
        assert_eq!(lens, Some(fit.others.intrinsics), "the lens that goes with its hand-eye");
        let joints = [0.1, -1.2, 1.4, -1.8, -1.6, 0.2];
        let (a, b) = (here.error_95_m(&joints).expect("six"), there.error_95_m(&joints).expect("six"));
        assert!((a / b - 1.0).abs() < 1e-9, "{a} {b}");
    }

    #[test]
    fn a_document_of_another_arm_is_refused_by_name() {
        let (chain, fit) = golden_arm();
        let whole = ArmEstimate::new(&chain, &fit, usual_tool()).expect("six joints");
        let mut other = whole.clone();
        other.joints.pop();
        assert_eq!(other.corrected_arm().expect_err("five").at, "arm.joints");
        let mut other = whole.clone();
        other.covariance.pop();
        assert_eq!(other.corrected_arm().expect_err("short").at, "arm.covariance");
        let mut other = whole;
        other.joints[2].zero_deg = None;
        assert_eq!(other.corrected_arm().expect_err("a hole").at, "arm.joints");
    }
}
