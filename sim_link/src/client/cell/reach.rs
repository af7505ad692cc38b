//! Whether the arm of a scene is the one whose kinematics is built in, and what it can reach.

use handeye_core::geometry::frames::{Base, Pose, Tip};
use nalgebra::{Isometry3, Vector3};
use serde::{Deserialize, Serialize};

use super::{Arm, CellInfo, CellObjects, JOINTS, JointAngles, read_joint_angles};
use crate::client::error::LinkError;
use crate::client::sim::{ObjectHandle, Sim};
use handeye_core::geometry;
use handeye_core::geometry::arm::ArmKind;
use handeye_core::geometry::arm::ur5::{self, DlsOptions, IkError, JointLimits};

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
        let (distance_m, angle_rad) = self.tip(joints).distance_to(base_from_tip);
        distance_m <= TIP_TOLERANCE_M && angle_rad <= TIP_TOLERANCE_RAD
    }
}

/// The kinematics of the arm in a scene: its chain, and how far its joints turn.
#[derive(Debug, Clone, PartialEq)]
pub struct ArmKinematics {
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
    /// It is not a UR5.
    #[error("the axis of joint {joint} is {distance_mm:.1} mm and {angle_deg:.1}° from where it is on a UR5")]
    OtherArm {
        /// Counted from 1 at the base.
        joint: usize,
        /// Distance between the axes.
        distance_mm: f64,
        /// Angle between them.
        angle_deg: f64,
    },
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
    /// For an arm that stands at `base_from_arm` and carries its tip at `connection_from_tip`.
    pub fn new(base_from_arm: Isometry3<f64>, connection_from_tip: Isometry3<f64>, limits: JointLimits) -> Self {
        Self { chain: ArmChain { base_from_arm, connection_from_tip }, limits }
    }

    /// Ranges of the joints; infinite for one that turns without end.
    pub fn limits(&self) -> &JointLimits {
        &self.limits
    }

    /// The arm from its frame to the connection, with its ranges.
    pub(super) fn arm(&self) -> geometry::arm::Arm {
        let arm = ArmKind::Ur5Coppeliasim.arm();
        arm.clone().with_ranges(&self.limits.ranges()).unwrap_or(arm)
    }

    /// Where the arm stands, and how it carries its tip.
    pub fn chain(&self) -> &ArmChain {
        &self.chain
    }

    /// See [`ArmChain::tip`].
    pub fn tip(&self, joints: &JointAngles) -> Pose<Base, Tip> {
        self.chain.tip(joints)
    }

    /// The joint positions (rad) nearest to `seed` that put the tip to `goal`.
    ///
    /// # Errors
    /// [`IkError`] says what is in the way or which joint would leave its range.
    pub fn reach(&self, goal: &Pose<Base, Tip>, seed: &JointAngles) -> Result<JointAngles, IkError> {
        self.reach_within(goal, seed, &self.limits)
    }

    /// As [`Self::reach`], with other limits.
    pub(super) fn reach_within(
        &self,
        goal: &Pose<Base, Tip>,
        seed: &JointAngles,
        limits: &JointLimits,
    ) -> Result<JointAngles, IkError> {
        if !goal.is_finite() {
            return Err(IkError::NotFinite);
        }
        let ArmChain { base_from_arm, connection_from_tip } = &self.chain;
        let arm_from_connection = base_from_arm.inverse() * goal.isometry() * connection_from_tip.inverse();
        ur5::inverse_nearest(&arm_from_connection, seed, limits)
    }

    /// The joint positions (rad), found from `seed` on, that take the tip as near to `goal` as the arm can.
    pub(super) fn towards(&self, goal: &Pose<Base, Tip>, seed: &JointAngles) -> JointAngles {
        let arm_from_tip = self.chain.base_from_arm.inverse() * goal.isometry();
        ur5::towards(&arm_from_tip, &self.chain.connection_from_tip, seed, &DlsOptions::default(), &self.limits)
    }
}

impl Arm {
    /// The kinematics of the arm, if it is a UR5 as the scene of the simulator has it.
    ///
    /// The axes of all joints are compared with the built-in ones. At known joint positions six axes determine how the
    /// tip moves with the joints, so one configuration is enough.
    ///
    /// # Errors
    /// A lost connection; that the arm is another one, or cannot be measured, is no error but the inner result.
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
                return Ok(measured.kinematics(&self.info));
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
    fn kinematics(&self, info: &CellInfo) -> Result<ArmKinematics, UnknownKinematics> {
        let expected = ur5::forward(&self.joints);
        for (index, (found, expected)) in self.arm_from_joint.iter().zip(&expected.arm_from_joint).enumerate() {
            let axis = expected.rotation * Vector3::z();
            let angle_rad = (found.rotation * Vector3::z()).angle(&axis);
            // Where along its axis a joint has its origin is a matter of drawing.
            let between = found.translation.vector - expected.translation.vector;
            let distance_m = (between - axis * between.dot(&axis)).norm();
            if !(distance_m <= AXIS_TOLERANCE_M && angle_rad <= AXIS_TOLERANCE_RAD) {
                let (distance_mm, angle_deg) = (distance_m * 1e3, angle_rad.to_degrees());
                return Err(UnknownKinematics::OtherArm { joint: index + 1, distance_mm, angle_deg });
            }
        }
        let connection_from_tip = expected.arm_from_connection.inv_mul(&self.arm_from_tip);
        Ok(ArmKinematics::new(self.base_from_arm, connection_from_tip, limits_of(info)))
    }
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
