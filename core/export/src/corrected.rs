//! The arm of a result as a chain, for formats about arms.

use nalgebra::Isometry3;

use super::text::{identifier, made_by};
use super::{ExportError, ExportInput};
use handeye_arm::{Arm, Joint, JointKind};
use handeye_result::ResultProblem;

/// The arm of a result as its controller models it, and as it really is except for gravity and errors that depend on the
/// place of the tip.
#[derive(Debug, Clone)]
pub(super) struct CorrectedChain {
    /// As the controller models it.
    pub nominal: Arm,
    /// With its joints where they really are.
    pub corrected: Arm,
}

impl CorrectedChain {
    /// The arm of a result whose views do not contradict it.
    pub fn of(input: &ExportInput<'_>, format: &'static str) -> Result<Self, ExportError> {
        let arm = input.result.arm.as_ref().ok_or(ExportError::NeedsArm { format })?;
        if arm.contradicted {
            return Err(ExportError::ArmContradicted { format });
        }
        let corrected = arm.corrected_arm().map_err(|e| ExportError::BadResult(ResultProblem::Bad(e)))?;
        if corrected.arm.joints().iter().any(|joint| joint.kind == JointKind::Prismatic) {
            let problem = "it has a joint that is prismatic, and errors are those of revolute joints";
            return Err(ExportError::OtherArm { format, problem });
        }
        let chain = corrected.of_links();
        let problem = "a number of it is of no arm: calibrate again";
        let chain = chain.map_err(|_error| ExportError::OtherArm { format, problem })?;
        Ok(Self { nominal: corrected.arm, corrected: chain })
    }
}

/// The first comment for an arm: which transform, units, what is not in it, what it belongs to, and what made it.
pub(super) fn about_arm(input: &ExportInput<'_>, [base, tip]: [&str; 2], rotation: &str) -> String {
    let field = input.result.arm.as_ref().and_then(|arm| arm.field.as_ref()).map_or_else(String::new, |field| {
        let (mm, deg) = (field.typical_mm, field.typical_deg);
        format!(" Nor is what changes with the place of the tip, typically {mm:.3} mm and {deg:.4}°: use `handeye correct` for it.")
    });
    format!(
        "T_{base}_{tip} of the corrected arm, from what its joints report. Metres; {rotation}. Compliance under gravity is not in it.{field} \
         It belongs to hand-eye and intrinsics of arm in the result JSON, not to the plain ones. {}",
        made_by(input.result)
    )
}

/// A joint that is turned by its value about z of its own frame: its place in the frame before it, where each frame is given by
/// the transform between the one of the chain, with z along its axis, and its own.
pub(super) fn joint_origins(
    arm: &Arm,
    first: &Isometry3<f64>,
    axis_from_own: &[Isometry3<f64>],
) -> Vec<Isometry3<f64>> {
    let mut own_from_carried = *first;
    let mut origins = Vec::with_capacity(arm.joint_count());
    for (joint, axis_from_own) in arm.joints().iter().zip(axis_from_own) {
        let carried_from_own = joint.joint_from_axis() * axis_from_own;
        origins.push(own_from_carried * joint.previous_from_joint * carried_from_own);
        own_from_carried = carried_from_own.inverse();
    }
    origins
}

/// Frames of the joints with z along their axes, and the tip, in the base, where every joint is at zero.
pub(super) fn frames_at_zero(arm: &Arm) -> (Vec<Isometry3<f64>>, Isometry3<f64>) {
    let mut base_from_link = arm.base_from_first;
    let mut frames = Vec::with_capacity(arm.joint_count());
    for joint in arm.joints() {
        base_from_link *= joint.previous_from_joint;
        frames.push(base_from_link * joint.joint_from_axis());
    }
    (frames, base_from_link * arm.last_from_flange() * arm.flange_from_tip)
}

/// Names of joints that files may have, no two of them alike.
pub(super) fn joint_names(joints: &[Joint]) -> Vec<String> {
    unique(joints.iter().map(|joint| identifier(&joint.name)), &[])
}

/// Names that are all unused; a used one gets an underscore appended.
pub(super) fn unique(names: impl Iterator<Item = String>, taken: &[&str]) -> Vec<String> {
    let mut found: Vec<String> = Vec::new();
    for mut name in names {
        while name.is_empty() || taken.contains(&name.as_str()) || found.contains(&name) {
            name.push('_');
        }
        found.push(name);
    }
    found
}
