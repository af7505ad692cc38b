//! Jogging: the arm moves for as long as somebody holds a button, or by a small step.
//!
//! The next point is computed here and sent for one pass of the simulation, as `sim.moveToConfig` does it inside the
//! server: a joint that is moved by forces gets a new target position, any other is put there. So the arm stands within
//! a pass when this client hangs, dies, or loses its connection. As long as it lives, it comes to rest within the
//! limits of acceleration.

use handeye_core::frames::{Base, Camera, Pose, Tip};
use nalgebra::Vector3;

use super::jog_plan::{JogObstacle, JogPlan, Path};
use super::reach::ArmKinematics;
use super::{Arm, JOINTS, JointAngles, read_joint_angles, require_running};
use crate::client::error::LinkError;
use crate::client::options::CallOptions;

/// What the arm is asked for, in messages.
const TASK: &str = "jogging the arm";

/// A joint that is where it is put may be off by rounding [rad].
const PLACED_OFF_RAD: f64 = 1e-6;

/// A joint moved by forces lags behind: by a few degrees at full speed, as its controller is tuned [rad].
const DRIVEN_OFF_RAD: f64 = 15.0 * std::f64::consts::PI / 180.0;

/// A jog of the arm.
#[derive(Debug, Clone, Copy)]
pub enum ArmJog<'a> {
    /// One joint, counted from 0 at the base.
    Joint {
        /// Which.
        index: usize,
        /// Towards larger angles.
        forward: bool,
    },
    /// The tip along a direction of some axes; its orientation stays.
    Line {
        /// What its kinematics is.
        kinematics: &'a ArmKinematics,
        /// Whose axes.
        axes: JogAxes,
        /// The direction in these axes.
        along: Vector3<f64>,
    },
    /// The tip about a direction of some axes, right-handed; the origin of the axes stays, for those of the base that
    /// of the tip.
    Turn {
        /// What its kinematics is.
        kinematics: &'a ArmKinematics,
        /// Whose axes.
        axes: JogAxes,
        /// The direction in these axes.
        about: Vector3<f64>,
    },
}

/// Axes along which the tip is jogged, as they are when the jog begins.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum JogAxes {
    /// Those of the base.
    Base,
    /// Those of the tip.
    Tip,
    /// Those of the camera, which is here.
    Camera(Pose<Tip, Camera>),
}

/// How a jog ended; the arm stands.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum JogEnd {
    /// It was let go.
    Released,
    /// It has its length.
    Arrived,
    /// Something is in its way. A jog of a given length was not begun.
    Obstacle(JogObstacle),
    /// Something else moves this joint, counted from 1 at the base, or holds it.
    NotFollowing {
        /// Which joint.
        joint: usize,
    },
    /// The tip is not where the kinematics has it; nothing was moved.
    OtherTip,
}

impl Arm {
    /// Jogs from a standstill until it is let go, is `length` further (m or rad) or something is in the way.
    ///
    /// `held` is asked once per pass: for the share of the fastest speed, over 0 and up to 1, or `None` to come to rest.
    ///
    /// # Errors
    /// [`LinkError::NotRunning`], also when the simulation is ended meanwhile; [`LinkError::BadMotion`] for a joint or a
    /// direction that does not exist. After any other [`LinkError`] the arm stands where it was last sent.
    pub fn jog(
        &mut self,
        jog: &ArmJog<'_>,
        length: Option<f64>,
        held: &mut dyn FnMut() -> Option<f64>,
    ) -> Result<JogEnd, LinkError> {
        require_running(&mut self.sim, TASK)?;
        if let Some(value) = length.filter(|length| !(length.is_finite() && *length >= 0.0)) {
            return Err(LinkError::BadMotion { what: "the length", expected: "zero or more", value });
        }
        let dynamic = self.dynamic_joints()?;
        let start = self.joint_angles()?;
        if let ArmJog::Line { kinematics, .. } | ArmJog::Turn { kinematics, .. } = jog
            && !kinematics.fits(&start, &self.base_from_tip()?)
        {
            return Ok(JogEnd::OtherTip);
        }
        let path = self.path(jog, &start)?;
        match JogPlan::new(path, start, self.info.time_step_s, length) {
            Ok(plan) => self.follow(plan, start, dynamic, held),
            Err(obstacle) => Ok(JogEnd::Obstacle(obstacle)),
        }
    }

    fn follow(
        &mut self,
        mut plan: JogPlan<'_>,
        start: JointAngles,
        dynamic: [bool; JOINTS],
        held: &mut dyn FnMut() -> Option<f64>,
    ) -> Result<JogEnd, LinkError> {
        let mut sent = start;
        let mut seen_s = f64::NEG_INFINITY;
        loop {
            let share = held();
            // All joints go to a point in the same pass, however slow the network.
            let lock = self.hold.acquire(&mut self.sim)?;
            let pass = self.send_next(&mut plan, share, &mut sent, &mut seen_s, dynamic);
            let pass = match lock {
                Some(lock) => lock.release(&mut self.sim, pass)?,
                None => pass?,
            };
            // A point takes effect in the pass that follows, also the last one.
            self.sim.step(&CallOptions::default())?;
            match pass {
                Pass::NotFollowing(joint) => return Ok(JogEnd::NotFollowing { joint: joint + 1 }),
                Pass::None => require_running(&mut self.sim, TASK)?,
                Pass::Sent if plan.is_at_end() => return Ok(JogEnd::Arrived),
                Pass::Sent if plan.is_at_rest() => match plan.obstacle() {
                    _ if share.is_none() => return Ok(JogEnd::Released),
                    Some(obstacle) => return Ok(JogEnd::Obstacle(obstacle)),
                    // Held at a speed of nothing.
                    None => {}
                },
                Pass::Sent => {}
            }
        }
    }

    /// Sends the next point, if a pass has gone by since the last one and the joints are where they were sent.
    fn send_next(
        &mut self,
        plan: &mut JogPlan<'_>,
        share: Option<f64>,
        sent: &mut JointAngles,
        seen_s: &mut f64,
        dynamic: [bool; JOINTS],
    ) -> Result<Pass, LinkError> {
        let now_s = self.sim.get_simulation_time()?;
        // The clock of a simulation that is started anew goes back.
        if now_s == *seen_s {
            return Ok(Pass::None);
        }
        *seen_s = now_s;
        let joints = read_joint_angles(&mut self.sim, &self.objects.joints)?;
        let tolerance = |joint: usize| if dynamic[joint] { DRIVEN_OFF_RAD } else { PLACED_OFF_RAD };
        if let Some(joint) = (0..JOINTS).find(|&i| difference_rad(joints[i], sent[i]) > tolerance(i)) {
            return Ok(Pass::NotFollowing(joint));
        }
        let next = plan.advance(share);
        for joint in (0..JOINTS).filter(|&i| next[i] != sent[i]) {
            let handle = self.objects.joints[joint];
            if dynamic[joint] {
                self.sim.set_joint_target_position(handle, next[joint])?;
            } else {
                self.sim.set_joint_position(handle, next[joint])?;
            }
        }
        *sent = next;
        Ok(Pass::Sent)
    }

    fn dynamic_joints(&mut self) -> Result<[bool; JOINTS], LinkError> {
        let mut dynamic = [false; JOINTS];
        for (dynamic, &joint) in dynamic.iter_mut().zip(&self.objects.joints) {
            *dynamic = self.sim.is_joint_dynamic(joint)?;
        }
        Ok(dynamic)
    }

    fn path<'a>(&self, jog: &ArmJog<'a>, start: &JointAngles) -> Result<Path<'a>, LinkError> {
        match *jog {
            ArmJog::Joint { index, forward } if index < JOINTS => {
                let limits = self.info.joint_intervals.map(|i| (!i.cyclic).then_some([i.min_rad, i.max_rad]));
                Ok(Path::Joint { index, sign: if forward { 1.0 } else { -1.0 }, start: *start, limits })
            }
            ArmJog::Joint { index, .. } => {
                Err(LinkError::BadMotion { what: "the joint", expected: "one of 0 to 5", value: index as f64 })
            }
            ArmJog::Line { kinematics, axes, along } => {
                let start = kinematics.tip(start);
                Ok(Path::Line { kinematics, start, along: axes.direction_in_base(&start, &along)? })
            }
            ArmJog::Turn { kinematics, axes, about } => {
                let start = kinematics.tip(start);
                let about = axes.direction_in_base(&start, &about)?;
                Ok(Path::Turn { kinematics, start, about, centre: axes.origin_in_base(&start) })
            }
        }
    }
}

enum Pass {
    /// None has gone by.
    None,
    Sent,
    NotFollowing(usize),
}

impl JogAxes {
    fn direction_in_base(
        &self,
        base_from_tip: &Pose<Base, Tip>,
        along: &Vector3<f64>,
    ) -> Result<Vector3<f64>, LinkError> {
        let in_base = match self {
            Self::Base => *along,
            Self::Tip => base_from_tip.rotation() * along,
            Self::Camera(tip_from_camera) => base_from_tip.rotation() * (tip_from_camera.rotation() * along),
        };
        in_base.try_normalize(1e-9).filter(|unit| unit.iter().all(|v| v.is_finite())).ok_or(LinkError::BadMotion {
            what: "the direction",
            expected: "longer than zero",
            value: along.norm(),
        })
    }

    fn origin_in_base(&self, base_from_tip: &Pose<Base, Tip>) -> Vector3<f64> {
        match self {
            Self::Base | Self::Tip => base_from_tip.translation(),
            Self::Camera(tip_from_camera) => (*base_from_tip * *tip_from_camera).translation(),
        }
    }
}

/// Between two angles, the short way round: a joint that turns without end comes back from the other side.
fn difference_rad(a: f64, b: f64) -> f64 {
    let turn = std::f64::consts::TAU;
    let rest = (a - b).rem_euclid(turn);
    rest.min(turn - rest)
}
