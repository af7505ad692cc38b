//! The chain of the arm of a scene, as in the running simulation, and what it can reach.

use handeye_arm::{
    ArmError, ArmFrames, ArmKind, DlsOptions, IkError, Joint, JointKind, JointRange, JointValues, MAX_JOINTS,
};
use handeye_geometry::frames::{Base, Pose, Tip};
use handeye_wording::Text;
use nalgebra::{Isometry3, Matrix6xX, Translation3, Vector3};
use serde::{Deserialize, Serialize};

use super::Arm;
use super::hold::Held;
use super::joints::{CellJoint, read_joint_values};
use super::objects::{Carriers, CellObjects};
use crate::error::LinkError;
use crate::sim::{ObjectHandle, Sim};

/// Largest distance of a joint's axis from the built-in kinematics \[m\]. The model and the manufacturer's table differ
/// by 7 mm; a physics engine holds its joints together to a tenth of a millimetre.
const AXIS_TOLERANCE_M: f64 = 1e-3;

/// Largest angle of the axis from it \[rad\].
const AXIS_TOLERANCE_RAD: f64 = 0.2 * std::f64::consts::PI / 180.0;

/// Largest distance of the reported tip from the computed one [m, rad]: exceeded by a tip that was moved on the flange,
/// or another tool. An arm with dynamic joints gives way by less.
const TIP_TOLERANCE_M: f64 = 2e-3;
const TIP_TOLERANCE_RAD: f64 = 0.5 * std::f64::consts::PI / 180.0;

/// How often joints and axes are read again because the arm moved meanwhile.
const ATTEMPTS: u32 = 5;

/// The kinematics of the arm in a scene: its chain, where its base is, the tip on it, and the ranges of its joints.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ArmKinematics {
    /// From the arm frame to the connection, with the ranges of the scene.
    arm: handeye_arm::Arm,
    /// Whether that is the UR5 whose shape is known.
    is_ur5: bool,
    base_from_arm: Isometry3<f64>,
    connection_from_tip: Isometry3<f64>,
}

/// Why the kinematics of an arm is not known.
#[derive(Debug, Clone, PartialEq, thiserror::Error, handeye_wording::Localized)]
#[non_exhaustive]
pub enum UnknownKinematics {
    /// The place of the arm is not known.
    #[error("the scene has no {path}, which tells where the arm stands")]
    NoArm {
        /// The path looked for.
        path: String,
    },
    /// The joints are not above the base.
    #[error(
        "the joints do not hang on {path}, which is taken for the base of the arm: give the object that they hang on"
    )]
    Elsewhere {
        /// The path looked for.
        path: String,
    },
    /// Other joints carry the tip than when the scene was read.
    #[error("other joints carry the tip than when the connection was made: connect again")]
    OtherJoints,
    /// What was read is not an arm.
    #[error("what the scene says of the arm is not one: {0}")]
    NoChain(#[from] ArmError),
    /// The tip does not move with the arm.
    #[error("the tip does not hang on the last joint of the arm")]
    LooseTip,
    /// The server did not answer what has to be known.
    #[error("the arm could not be measured: {reason}")]
    Unreadable {
        /// The error that it reported.
        reason: Text,
    },
    /// The arm was not at rest.
    #[error("the arm moved while its axes were read; let it stand and connect again")]
    Moving,
}

impl ArmKinematics {
    /// The kinematics of a UR5 at `base_from_arm` with its tip at `connection_from_tip`.
    ///
    /// # Errors
    /// [`ArmError::WrongCount`], and [`ArmError::BadJoint`] for ranges without room.
    pub fn ur5(
        base_from_arm: Isometry3<f64>,
        connection_from_tip: Isometry3<f64>,
        ranges: &[JointRange],
    ) -> Result<Self, ArmError> {
        let arm = ArmKind::Ur5Coppeliasim.arm().with_ranges(ranges)?;
        Ok(Self { arm, is_ur5: true, base_from_arm, connection_from_tip })
    }

    /// The kinematics of any other known arm, up to its tip.
    pub fn new(arm: handeye_arm::Arm, base_from_arm: Isometry3<f64>) -> Self {
        Self { arm, is_ur5: false, base_from_arm, connection_from_tip: Isometry3::identity() }
    }

    /// The arm from its frame to the connection, with its ranges.
    pub fn arm(&self) -> &handeye_arm::Arm {
        &self.arm
    }

    /// How each joint moves, from the base up.
    pub fn kinds(&self) -> impl Iterator<Item = JointKind> {
        self.arm.joints().iter().map(|joint| joint.kind)
    }

    /// Pose of the arm in the base frame.
    pub fn base_from_arm(&self) -> &Isometry3<f64> {
        &self.base_from_arm
    }

    /// Pose of the tip on the connection; the identity for an arm that was measured up to its tip.
    pub fn connection_from_tip(&self) -> &Isometry3<f64> {
        &self.connection_from_tip
    }

    /// Whether it is the simulator's UR5, whose numbers are exact and whose shape is known.
    pub fn is_ur5(&self) -> bool {
        self.is_ur5
    }

    /// Pose of the tip with these joints; NaN for invalid joint values.
    pub fn tip(&self, joints: &[f64]) -> Pose<Base, Tip> {
        let arm_from_connection = match self.arm.forward(joints) {
            Ok(pose) => *pose.isometry(),
            Err(_) => Isometry3::translation(f64::NAN, f64::NAN, f64::NAN),
        };
        Pose::from_isometry(self.base_from_arm * arm_from_connection * self.connection_from_tip)
    }

    /// Whether a reported tip is where it should be with these joints: the scene may have changed since.
    pub fn fits(&self, joints: &[f64], base_from_tip: &Pose<Base, Tip>) -> bool {
        is_near(&self.tip(joints), base_from_tip)
    }

    /// The joint values nearest to `seed` that put the tip to `goal`, within the ranges of the joints.
    ///
    /// # Errors
    /// [`IkError`] with the obstacle or the joint that would leave its range.
    pub fn reach(&self, goal: &Pose<Base, Tip>, seed: &[f64]) -> Result<JointValues, IkError> {
        self.solve(&self.arm, goal, seed)
    }

    /// As [`Self::reach`], with other ranges.
    pub(super) fn reach_within(
        &self,
        goal: &Pose<Base, Tip>,
        seed: &[f64],
        ranges: &[JointRange],
    ) -> Result<JointValues, IkError> {
        // Ranges about joints that are not numbers are invalid.
        let arm = self.arm.clone().with_ranges(ranges).map_err(|_none| IkError::NotFinite)?;
        self.solve(&arm, goal, seed)
    }

    fn solve(&self, arm: &handeye_arm::Arm, goal: &Pose<Base, Tip>, seed: &[f64]) -> Result<JointValues, IkError> {
        if !goal.is_finite() {
            return Err(IkError::NotFinite);
        }
        let arm_from_connection = self.base_from_arm.inverse() * goal.isometry() * self.connection_from_tip.inverse();
        let found = arm.inverse(&Pose::from_isometry(arm_from_connection), seed)?;
        JointValues::try_from(&found[..]).map_err(|_more| IkError::WrongCount { got: found.len(), need: MAX_JOINTS })
    }

    /// The joint values, found from `seed` on, that take the tip as near to `goal` as the arm can; the seed for a goal that
    /// is not a valid pose.
    pub(super) fn towards(&self, goal: &Pose<Base, Tip>, seed: &JointValues) -> JointValues {
        let arm_from_tip = Pose::from_isometry(self.base_from_arm.inverse() * goal.isometry());
        let found = self.with_tip(self.connection_from_tip).towards(&arm_from_tip, seed, &DlsOptions::default());
        found.ok().and_then(|found| JointValues::try_from(&found[..]).ok()).unwrap_or(*seed)
    }

    /// Velocity and angular velocity of the tip per velocity of each joint, in the axes of the arm frame; `None` for
    /// joints that are not numbers.
    pub(super) fn jacobian(&self, joints: &[f64]) -> Option<Matrix6xX<f64>> {
        let at_tip = Translation3::from(self.connection_from_tip.translation.vector).into();
        self.with_tip(at_tip).jacobian(joints).ok()
    }

    /// The arm up to something that is fixed to the connection.
    fn with_tip(&self, connection_from_tip: Isometry3<f64>) -> handeye_arm::Arm {
        let arm = self.arm.clone();
        let (base_from_first, flange_from_tip) = (arm.base_from_first, arm.flange_from_tip * connection_from_tip);
        arm.mounted(base_from_first, flange_from_tip)
    }
}

fn is_near(expected: &Pose<Base, Tip>, base_from_tip: &Pose<Base, Tip>) -> bool {
    let (distance_m, angle_rad) = expected.distance_to(base_from_tip);
    distance_m <= TIP_TOLERANCE_M && angle_rad <= TIP_TOLERANCE_RAD
}

impl Arm {
    /// The kinematics of the arm, read from the running simulation: where the axes of its joints are, how far they turn, and
    /// where the tip is behind the last one. At known joint positions that determines how the tip moves with the joints, so
    /// one configuration is enough.
    ///
    /// An arm whose axes are those of the UR5 in the simulator counts as that one, whose numbers are exact.
    ///
    /// # Errors
    /// A lost connection; an arm that cannot be measured or driven is not an error but the inner result.
    pub fn kinematics(&mut self) -> Result<Result<ArmKinematics, UnknownKinematics>, LinkError> {
        match self.measured_kinematics() {
            Err(error) if !error.is_connection_loss() => {
                Ok(Err(UnknownKinematics::Unreadable { reason: error.into() }))
            }
            outcome => outcome,
        }
    }

    fn measured_kinematics(&mut self) -> Result<Result<ArmKinematics, UnknownKinematics>, LinkError> {
        let Some(arm) = self.objects.arm else {
            return Ok(Err(UnknownKinematics::NoArm { path: self.objects.arm_path.clone() }));
        };
        let carriers = Carriers::of(&mut self.sim, self.objects.tip, Some(arm))?;
        if carriers.joints.last() != self.objects.joints.last() {
            return Ok(Err(UnknownKinematics::LooseTip));
        }
        if !carriers.reach_base {
            return Ok(Err(UnknownKinematics::Elsewhere { path: self.objects.arm_path.clone() }));
        }
        if carriers.joints != self.objects.joints {
            return Ok(Err(UnknownKinematics::OtherJoints));
        }
        for _ in 0..ATTEMPTS {
            let held = Held::acquire(&mut self.sim)?;
            let measured = measure(&mut self.sim, &self.objects, arm);
            if let Some(measured) = held.release(&mut self.sim, measured)? {
                let joints = &self.info.joints;
                let known = if measured.is_ur5(joints) { measured.ur5(joints) } else { measured.chain(joints) };
                return Ok(known.map_err(UnknownKinematics::NoChain));
            }
        }
        Ok(Err(UnknownKinematics::Moving))
    }
}

/// One instant of the arm.
struct Measured {
    joints: JointValues,
    arm_from_joint: Vec<Isometry3<f64>>,
    arm_from_tip: Isometry3<f64>,
    base_from_arm: Isometry3<f64>,
}

/// `None` when the arm moved meanwhile.
fn measure(sim: &mut Sim, objects: &CellObjects, arm: ObjectHandle) -> Result<Option<Measured>, LinkError> {
    let mut pose = |object, frame| sim.get_object_pose::<Base, Tip>(object, frame).map(|pose| *pose.isometry());
    let base_from_arm = pose(arm, ObjectHandle::WORLD)?;
    let before = pose(objects.tip, arm)?;
    let arm_from_joint = objects.joints.iter().map(|&joint| pose(joint, arm)).collect::<Result<_, _>>()?;
    let joints = read_joint_values(sim, objects)?;
    let arm_from_tip = *sim.get_object_pose::<Base, Tip>(objects.tip, arm)?.isometry();
    Ok((before == arm_from_tip).then_some(Measured { joints, arm_from_joint, arm_from_tip, base_from_arm }))
}

impl Measured {
    /// Where all frames would be if it were the UR5; `None` for joint values that a UR5 does not have.
    fn as_ur5(&self) -> Option<ArmFrames> {
        ArmKind::Ur5Coppeliasim.arm().frames(&self.joints).ok()
    }

    /// Whether the axes are those of the UR5.
    fn is_ur5(&self, joints: &[CellJoint]) -> bool {
        let Some(expected) = self.as_ur5().filter(|_| joints.iter().all(|j| j.kind == JointKind::Revolute)) else {
            return false;
        };
        self.arm_from_joint.iter().zip(&expected.base_from_joint).all(|(found, expected)| {
            let axis = expected.rotation * Vector3::z();
            let angle_rad = (found.rotation * Vector3::z()).angle(&axis);
            // The place of a joint's origin along its axis is arbitrary.
            let between = found.translation.vector - expected.translation.vector;
            let distance_m = (between - axis * between.dot(&axis)).norm();
            distance_m <= AXIS_TOLERANCE_M && angle_rad <= AXIS_TOLERANCE_RAD
        })
    }

    fn ur5(&self, joints: &[CellJoint]) -> Result<ArmKinematics, ArmError> {
        let arm_from_connection = *ArmKind::Ur5Coppeliasim.arm().forward(&self.joints)?.isometry();
        let connection_from_tip = arm_from_connection.inv_mul(&self.arm_from_tip);
        let ranges: Vec<JointRange> = joints.iter().map(|joint| joint.range).collect();
        ArmKinematics::ur5(self.base_from_arm, connection_from_tip, &ranges)
    }

    /// The arm as it was read, up to its tip. A joint moves about or along the z axis of its frame, which does not move with
    /// it.
    fn chain(&self, joints: &[CellJoint]) -> Result<ArmKinematics, ArmError> {
        let mut arm_from_link = Isometry3::identity();
        let mut chain = Vec::with_capacity(joints.len());
        let measured = self.arm_from_joint.iter().zip(self.joints.iter());
        for (index, ((arm_from_joint, &value), CellJoint { kind, range })) in measured.zip(joints).enumerate() {
            let joint = Joint {
                name: format!("joint {}", index + 1),
                kind: *kind,
                previous_from_joint: arm_from_link.inv_mul(arm_from_joint),
                axis: Vector3::z_axis(),
                range: *range,
            };
            arm_from_link = arm_from_joint * joint.motion(value);
            chain.push(joint);
        }
        let arm = handeye_arm::Arm::new(chain, arm_from_link.inv_mul(&self.arm_from_tip))?;
        Ok(ArmKinematics::new(arm, self.base_from_arm))
    }
}
