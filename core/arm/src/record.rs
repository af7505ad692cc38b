//! An arm as plain data, to store or to send: its joints with their ranges, and the transforms at its two ends.

use nalgebra::{Isometry3, UnitVector3, Vector3};
use serde::{Deserialize, Serialize};

use super::{Arm, ArmError, Joint, JointKind, JointRange};

/// Largest deviation of the length of a unit vector from one, by rounding.
const UNIT: f64 = 1e-12;

#[derive(Serialize, Deserialize)]
pub(super) struct ArmRecord {
    joints: Vec<JointRecord>,
    last_from_flange: Isometry3<f64>,
    base_from_first: Isometry3<f64>,
    flange_from_tip: Isometry3<f64>,
}

#[derive(Serialize, Deserialize)]
struct JointRecord {
    name: String,
    kind: JointKind,
    previous_from_joint: Isometry3<f64>,
    axis: Vector3<f64>,
    // A missing number means no limit: text formats have no infinity.
    min: Option<f64>,
    max: Option<f64>,
    speed: Option<f64>,
}

impl From<Arm> for ArmRecord {
    fn from(arm: Arm) -> Self {
        let Arm { joints, last_from_flange, base_from_first, flange_from_tip, ur: _ } = arm;
        let finite = |value: f64| value.is_finite().then_some(value);
        let joint = |joint: Joint| JointRecord {
            name: joint.name,
            kind: joint.kind,
            previous_from_joint: joint.previous_from_joint,
            axis: joint.axis.into_inner(),
            min: finite(joint.range.min),
            max: finite(joint.range.max),
            speed: finite(joint.range.speed),
        };
        Self { joints: joints.into_iter().map(joint).collect(), last_from_flange, base_from_first, flange_from_tip }
    }
}

impl TryFrom<ArmRecord> for Arm {
    type Error = ArmError;

    fn try_from(record: ArmRecord) -> Result<Self, ArmError> {
        let joint = |joint: JointRecord| Joint {
            name: joint.name,
            kind: joint.kind,
            previous_from_joint: joint.previous_from_joint,
            // A unit vector is kept to the last bit; a zero vector is refused below.
            axis: if (joint.axis.norm() - 1.0).abs() < UNIT {
                UnitVector3::new_unchecked(joint.axis)
            } else {
                UnitVector3::new_normalize(joint.axis)
            },
            range: JointRange {
                min: joint.min.unwrap_or(f64::NEG_INFINITY),
                max: joint.max.unwrap_or(f64::INFINITY),
                speed: joint.speed.unwrap_or(f64::INFINITY),
            },
        };
        let arm = Self::new(record.joints.into_iter().map(joint).collect(), record.last_from_flange)?;
        Ok(arm.mounted(record.base_from_first, record.flange_from_tip))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ArmKind;

    #[test]
    fn an_arm_comes_back_from_text_as_it_was_with_joints_that_have_no_end() {
        for kind in [ArmKind::Ur5Coppeliasim, ArmKind::Ur3e] {
            let arm = kind.arm();
            let text = serde_json::to_string(&arm).expect("plain data");
            assert_eq!(serde_json::from_str::<Arm>(&text).expect("the same"), arm);
        }
        let arm = ArmKind::Ur3e.arm();
        let long = serde_json::to_string(&arm)
            .expect("plain data")
            .replace("\"axis\":[0.0,0.0,1.0]", "\"axis\":[0.0,0.0,2.0]");
        assert!(long.contains("2.0]"), "{long}");
        assert_eq!(serde_json::from_str::<Arm>(&long).expect("the same directions"), arm);
        let none = r#"{"joints":[],"last_from_flange":{"rotation":[0,0,0,1],"translation":[0,0,0]},
            "base_from_first":{"rotation":[0,0,0,1],"translation":[0,0,0]},
            "flange_from_tip":{"rotation":[0,0,0,1],"translation":[0,0,0]}}"#;
        assert!(serde_json::from_str::<Arm>(none).is_err(), "an arm without joints is none");
    }
}
