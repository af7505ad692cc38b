//! The chain of the arm of a scene, as the running simulation has it, and what it can reach.

use handeye_core::geometry::frames::{Base, Pose, Tip};
use nalgebra::{Isometry3, Matrix6, Translation3, Vector3};
use serde::{Deserialize, Serialize};

use super::{Arm, CellInfo, CellObjects, JOINTS, JointAngles, read_joint_angles};
use crate::client::constants;
use crate::client::error::LinkError;
use crate::client::sim::{ObjectHandle, Sim};
use handeye_core::geometry;
use handeye_core::geometry::arm::ur5::{self, DlsOptions, IkError, JointLimits};
use handeye_core::geometry::arm::{ArmError, ArmKind, Joint, JointKind};

/// How far an axis of a joint may be from where the built-in kinematics has it \[m\]. The model and the manufacturer's
/// table differ by 7 mm; a physics engine holds its joints together to a tenth of a millimetre.
const AXIS_TOLERANCE_M: f64 = 1e-3;

/// How far it may be turned \[rad\].
const AXIS_TOLERANCE_RAD: f64 = 0.2 * std::f64::consts::PI / 180.0;

/// How far the reported tip may be from the computed one [m, rad]: a tip that was moved on the flange, or another
/// tool. An arm with dynamic joints gives way by less.
const TIP_TOLERANCE_M: f64 = 2e-3;
const TIP_TOLERANCE_RAD: f64 = 0.5 * std::f64::consts::PI / 180.0;

/// How often joints and axes are read again because the arm moved meanwhile.
const ATTEMPTS: u32 = 5;

/// Objects between the tip and the last joint, at most; more is a loop.
const LONGEST_CHAIN: usize = 32;

/// The chain from the base to the tip of a UR5: the built-in kinematics lies between its two ends.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct ArmChain {
    /// Where the arm stands.
    pub base_from_arm: Isometry3<f64>,
    /// How it carries its tip.
    pub connection_from_tip: Isometry3<f64>,
}

impl ArmChain {
    /// Where the tip is with the joints at `joints` (rad).
    pub fn tip(&self, joints: &JointAngles) -> Pose<Base, Tip> {
        let arm_from_connection = ur5::forward(joints).arm_from_connection;
        Pose::from_isometry(self.base_from_arm * arm_from_connection * self.connection_from_tip)
    }

    /// Whether a reported tip is where it should be with these joints: the scene may have changed since.
    pub fn fits(&self, joints: &JointAngles, base_from_tip: &Pose<Base, Tip>) -> bool {
        is_near(&self.tip(joints), base_from_tip)
    }
}

/// The kinematics of the arm in a scene: its chain, where it stands, what it carries, and how far its joints turn.
#[derive(Debug, Clone, PartialEq)]
pub struct ArmKinematics {
    /// From the arm frame to the connection, with the ranges of the scene.
    arm: geometry::arm::Arm,
    /// Whether that is the UR5 whose shape is known.
    is_ur5: bool,
    chain: ArmChain,
    limits: JointLimits,
}

/// Why the kinematics of an arm is not known.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum UnknownKinematics {
    /// Where the arm stands is not known.
    #[error("the scene has no {path}, which tells where the arm stands")]
    NoArm {
        /// The path looked for.
        path: String,
    },
    /// The joints do not follow each other from the base to the tip.
    #[error(
        "joint {joint} is not the next one below joint {} on the way from the tip to the base: give the joints of the arm \
         in their order",
        joint + 1
    )]
    Order {
        /// Counted from 1 at the base.
        joint: usize,
    },
    /// The joints are not above the base.
    #[error(
        "the joints do not hang on {path}, which is taken for the base of the arm: give the object that they hang on"
    )]
    Elsewhere {
        /// The path looked for.
        path: String,
    },
    /// The arm has joints that are not driven.
    #[error(
        "besides the {JOINTS} joints that are driven {alias:?} moves the tip: arms of {JOINTS} joints are driven so far"
    )]
    MoreJoints {
        /// What it is called in the scene.
        alias: String,
    },
    /// A joint that shifts, or turns about every axis.
    #[error("joint {joint} is not revolute: only arms of revolute joints are driven along lines so far")]
    NotRevolute {
        /// Counted from 1 at the base.
        joint: usize,
    },
    /// What was read is not an arm.
    #[error("what the scene says of the arm is not one: {0}")]
    NoChain(#[from] ArmError),
    /// The tip does not move with the arm.
    #[error("the tip does not hang on the last joint of the arm")]
    LooseTip,
    /// The server did not answer what has to be known.
    #[error("the arm could not be measured: {reason}")]
    Unreadable {
        /// What it said.
        reason: String,
    },
    /// It did not stand still.
    #[error("the arm moved while its axes were read; let it stand and connect again")]
    Moving,
}

impl ArmKinematics {
    /// That of a UR5 that stands at `base_from_arm` and carries its tip at `connection_from_tip`.
    ///
    /// # Errors
    /// [`ArmError::BadJoint`] for limits without room.
    pub fn ur5(
        base_from_arm: Isometry3<f64>,
        connection_from_tip: Isometry3<f64>,
        limits: JointLimits,
    ) -> Result<Self, ArmError> {
        let arm = ArmKind::Ur5Coppeliasim.arm().with_ranges(&limits.ranges())?;
        Ok(Self { arm, is_ur5: true, chain: ArmChain { base_from_arm, connection_from_tip }, limits })
    }

    /// Ranges of the joints; infinite for one that turns without end.
    pub fn limits(&self) -> &JointLimits {
        &self.limits
    }

    /// The arm from its frame to the connection, with its ranges.
    pub fn arm(&self) -> &geometry::arm::Arm {
        &self.arm
    }

    /// Where the arm stands.
    pub fn base_from_arm(&self) -> &Isometry3<f64> {
        &self.chain.base_from_arm
    }

    /// How it carries its tip; the identity for an arm that was measured up to there.
    pub fn connection_from_tip(&self) -> &Isometry3<f64> {
        &self.chain.connection_from_tip
    }

    /// The two ends of a UR5; `None` for any other arm.
    pub fn ur5_chain(&self) -> Option<ArmChain> {
        self.is_ur5.then_some(self.chain)
    }

    /// Where the tip is with the joints at `joints` (rad); nowhere, which is not a number, for joints that are none.
    pub fn tip(&self, joints: &JointAngles) -> Pose<Base, Tip> {
        let arm_from_connection = match self.arm.forward(joints) {
            Ok(pose) => *pose.isometry(),
            Err(_) => Isometry3::translation(f64::NAN, f64::NAN, f64::NAN),
        };
        Pose::from_isometry(self.chain.base_from_arm * arm_from_connection * self.chain.connection_from_tip)
    }

    /// Whether a reported tip is where it should be with these joints: the scene may have changed since.
    pub fn fits(&self, joints: &JointAngles, base_from_tip: &Pose<Base, Tip>) -> bool {
        is_near(&self.tip(joints), base_from_tip)
    }

    /// The joint positions (rad) nearest to `seed` that put the tip to `goal`.
    ///
    /// # Errors
    /// [`IkError`] says what is in the way or which joint would leave its range.
    pub fn reach(&self, goal: &Pose<Base, Tip>, seed: &JointAngles) -> Result<JointAngles, IkError> {
        self.solve(&self.arm, goal, seed)
    }

    /// As [`Self::reach`], with other limits.
    pub(super) fn reach_within(
        &self,
        goal: &Pose<Base, Tip>,
        seed: &JointAngles,
        limits: &JointLimits,
    ) -> Result<JointAngles, IkError> {
        // Limits about joints that are not numbers are none.
        let arm = self.arm.clone().with_ranges(&limits.ranges()).map_err(|_none| IkError::NotFinite)?;
        self.solve(&arm, goal, seed)
    }

    fn solve(
        &self,
        arm: &geometry::arm::Arm,
        goal: &Pose<Base, Tip>,
        seed: &JointAngles,
    ) -> Result<JointAngles, IkError> {
        if !goal.is_finite() {
            return Err(IkError::NotFinite);
        }
        let ArmChain { base_from_arm, connection_from_tip } = &self.chain;
        let arm_from_connection = base_from_arm.inverse() * goal.isometry() * connection_from_tip.inverse();
        let found = arm.inverse(&Pose::from_isometry(arm_from_connection), seed)?;
        JointAngles::try_from(found).map_err(|found| IkError::WrongCount { got: seed.len(), need: found.len() })
    }

    /// The joint positions (rad), found from `seed` on, that take the tip as near to `goal` as the arm can; the seed for a
    /// goal that is no pose.
    pub(super) fn towards(&self, goal: &Pose<Base, Tip>, seed: &JointAngles) -> JointAngles {
        let arm_from_tip = Pose::from_isometry(self.chain.base_from_arm.inverse() * goal.isometry());
        let found = self.with_tip(self.chain.connection_from_tip).towards(&arm_from_tip, seed, &DlsOptions::default());
        found.ok().and_then(|found| JointAngles::try_from(found).ok()).unwrap_or(*seed)
    }

    /// Velocity and angular velocity of the tip per velocity of each joint, in the axes of the arm frame; `None` for
    /// joints that are not numbers.
    pub(super) fn jacobian(&self, joints: &JointAngles) -> Option<Matrix6<f64>> {
        let at_tip = Translation3::from(self.chain.connection_from_tip.translation.vector).into();
        let jacobian = self.with_tip(at_tip).jacobian(joints).ok()?;
        Some(jacobian.fixed_columns::<JOINTS>(0).into_owned())
    }

    /// The arm up to something that is fixed to the connection.
    fn with_tip(&self, connection_from_tip: Isometry3<f64>) -> geometry::arm::Arm {
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
    /// An arm whose axes are those of the UR5 as the simulator has it is taken for that one, whose numbers are exact.
    ///
    /// # Errors
    /// A lost connection; that the arm cannot be measured, or is none that can be driven, is no error but the inner result.
    pub fn kinematics(&mut self) -> Result<Result<ArmKinematics, UnknownKinematics>, LinkError> {
        match self.measured_kinematics() {
            Err(error) if !error.is_connection_loss() => {
                Ok(Err(UnknownKinematics::Unreadable { reason: error.to_string() }))
            }
            outcome => outcome,
        }
    }

    fn measured_kinematics(&mut self) -> Result<Result<ArmKinematics, UnknownKinematics>, LinkError> {
        let Some(arm) = self.objects.arm else {
            return Ok(Err(UnknownKinematics::NoArm { path: self.objects.arm_path.clone() }));
        };
        if !is_tip_on_last_joint(&mut self.sim, &self.objects)? {
            return Ok(Err(UnknownKinematics::LooseTip));
        }
        for _ in 0..ATTEMPTS {
            let held = self.hold.acquire(&mut self.sim)?;
            let measured = measure(&mut self.sim, &self.objects, arm);
            let measured = match held {
                Some(held) => held.release(&mut self.sim, measured)?,
                None => measured?,
            };
            if let Some(measured) = measured {
                let limits = limits_of(&self.info);
                if measured.is_ur5() {
                    return Ok(measured.ur5(limits).map_err(UnknownKinematics::NoChain));
                }
                return Ok(match chain_defect(&mut self.sim, &self.objects, arm)? {
                    Some(defect) => Err(defect),
                    None => measured.chain(limits).map_err(UnknownKinematics::NoChain),
                });
            }
        }
        Ok(Err(UnknownKinematics::Moving))
    }
}

/// One instant of the arm.
struct Measured {
    joints: JointAngles,
    arm_from_joint: [Isometry3<f64>; JOINTS],
    arm_from_tip: Isometry3<f64>,
    base_from_arm: Isometry3<f64>,
}

/// `None` when the arm moved meanwhile.
fn measure(sim: &mut Sim, objects: &CellObjects, arm: ObjectHandle) -> Result<Option<Measured>, LinkError> {
    let mut pose = |object, frame| sim.get_object_pose::<Base, Tip>(object, frame).map(|pose| *pose.isometry());
    let mut arm_from_joint = [Isometry3::identity(); JOINTS];
    let base_from_arm = pose(arm, ObjectHandle::WORLD)?;
    let before = pose(objects.tip, arm)?;
    for (slot, &joint) in arm_from_joint.iter_mut().zip(&objects.joints) {
        *slot = pose(joint, arm)?;
    }
    let joints = read_joint_angles(sim, &objects.joints)?;
    let arm_from_tip = *sim.get_object_pose::<Base, Tip>(objects.tip, arm)?.isometry();
    Ok((before == arm_from_tip).then_some(Measured { joints, arm_from_joint, arm_from_tip, base_from_arm }))
}

impl Measured {
    /// Whether the axes are those of the UR5.
    fn is_ur5(&self) -> bool {
        let expected = ur5::forward(&self.joints);
        self.arm_from_joint.iter().zip(&expected.arm_from_joint).all(|(found, expected)| {
            let axis = expected.rotation * Vector3::z();
            let angle_rad = (found.rotation * Vector3::z()).angle(&axis);
            // Where along its axis a joint has its origin is a matter of drawing.
            let between = found.translation.vector - expected.translation.vector;
            let distance_m = (between - axis * between.dot(&axis)).norm();
            distance_m <= AXIS_TOLERANCE_M && angle_rad <= AXIS_TOLERANCE_RAD
        })
    }

    fn ur5(&self, limits: JointLimits) -> Result<ArmKinematics, ArmError> {
        let connection_from_tip = ur5::forward(&self.joints).arm_from_connection.inv_mul(&self.arm_from_tip);
        ArmKinematics::ur5(self.base_from_arm, connection_from_tip, limits)
    }

    /// The arm as it was read, up to its tip. A joint turns about the z axis of its frame, which does not turn with it.
    fn chain(&self, limits: JointLimits) -> Result<ArmKinematics, ArmError> {
        let mut arm_from_link = Isometry3::identity();
        let mut joints = Vec::with_capacity(JOINTS);
        for (index, (arm_from_joint, value)) in self.arm_from_joint.iter().zip(self.joints).enumerate() {
            let joint = Joint {
                name: format!("joint {}", index + 1),
                kind: JointKind::Revolute,
                previous_from_joint: arm_from_link.inv_mul(arm_from_joint),
                axis: Vector3::z_axis(),
                range: limits.ranges()[index],
            };
            arm_from_link = arm_from_joint * joint.motion(value);
            joints.push(joint);
        }
        let arm = geometry::arm::Arm::new(joints, arm_from_link.inv_mul(&self.arm_from_tip))?;
        let chain = ArmChain { base_from_arm: self.base_from_arm, connection_from_tip: Isometry3::identity() };
        Ok(ArmKinematics { arm, is_ur5: false, chain, limits })
    }
}

/// What keeps the joints that are driven from being all that moves the tip in the arm frame: `None` if nothing does.
fn chain_defect(
    sim: &mut Sim,
    objects: &CellObjects,
    arm: ObjectHandle,
) -> Result<Option<UnknownKinematics>, LinkError> {
    let mut left = JOINTS;
    let mut object = objects.tip;
    for _ in 0..LONGEST_CHAIN {
        match sim.get_object_parent(object)? {
            Some(parent) if left > 0 && parent == objects.joints[left - 1] => {
                if sim.get_joint_type(parent)? != constants::JOINT_REVOLUTE {
                    return Ok(Some(UnknownKinematics::NotRevolute { joint: left }));
                }
                (left, object) = (left - 1, parent);
            }
            Some(parent) if objects.joints.contains(&parent) => break,
            Some(parent) if left == 0 && parent == arm => return Ok(None),
            Some(parent) if sim.get_object_type(parent)? == constants::OBJECT_JOINT => {
                return Ok(Some(UnknownKinematics::MoreJoints { alias: sim.get_object_alias(parent)? }));
            }
            Some(parent) => object = parent,
            None => break,
        }
    }
    Ok(Some(match left {
        0 => UnknownKinematics::Elsewhere { path: objects.arm_path.clone() },
        joint => UnknownKinematics::Order { joint },
    }))
}

fn limits_of(info: &CellInfo) -> JointLimits {
    let end = |index: usize, end: f64, endless: f64| if info.joint_intervals[index].cyclic { endless } else { end };
    JointLimits {
        min_rad: std::array::from_fn(|i| end(i, info.joint_intervals[i].min_rad, f64::NEG_INFINITY)),
        max_rad: std::array::from_fn(|i| end(i, info.joint_intervals[i].max_rad, f64::INFINITY)),
    }
}

/// Whether the first joint that is met from the tip upwards is the last one of the arm.
fn is_tip_on_last_joint(sim: &mut Sim, objects: &CellObjects) -> Result<bool, LinkError> {
    let mut object = objects.tip;
    for _ in 0..LONGEST_CHAIN {
        match sim.get_object_parent(object)? {
            Some(parent) if objects.joints.contains(&parent) => return Ok(parent == objects.joints[JOINTS - 1]),
            Some(parent) => object = parent,
            None => return Ok(false),
        }
    }
    Ok(false)
}
