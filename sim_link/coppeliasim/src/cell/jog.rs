//! Jogging: the arm moves for as long as a button is held, or by a small step.
//!
//! The next point is computed here and sent for one pass of the simulation, so the arm stops within a pass when this
//! client hangs, crashes, or loses its connection. As long as the client runs, the arm comes to rest within the limits
//! of acceleration.

use handeye_arm::JointValues;
use handeye_geometry::frames::{Base, Camera, Pose, Tip};
use nalgebra::Vector3;

use super::jog_plan::{JogObstacle, JogPlan, Path, Watch};
use super::reach::ArmKinematics;
use super::stream::{Pass, Point, Stream};
use super::{Arm, require_running};
use crate::error::LinkError;

/// Name of the task, in messages.
const TASK: &str = "jogging the arm";

/// A jog of one joint, or of the tip along or about a direction.
#[derive(Debug, Clone, Copy)]
pub enum ArmJog<'a> {
    /// One joint, counted from 0 at the base.
    Joint {
        /// The joint, counted from 0 at the base.
        index: usize,
        /// Towards larger values.
        forward: bool,
    },
    /// The tip along a direction of some axes; its orientation stays.
    Line {
        /// The chain of the arm.
        kinematics: &'a ArmKinematics,
        /// Frame of the axis.
        axes: JogAxes,
        /// The direction in these axes.
        along: Vector3<f64>,
    },
    /// The tip about a direction of some axes, right-handed; the origin of the axes stays, for those of the base that
    /// of the tip.
    Turn {
        /// The chain of the arm.
        kinematics: &'a ArmKinematics,
        /// Frame of the axis.
        axes: JogAxes,
        /// The direction in these axes.
        about: Vector3<f64>,
    },
}

/// Axes along which the tip is jogged, as they are when the jog begins.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum JogAxes {
    /// The base's axes.
    Base,
    /// The tip's axes.
    Tip,
    /// The axes of the camera, which has this pose.
    Camera(Pose<Tip, Camera>),
}

/// How a jog ended; the arm is at rest.
#[derive(Debug, Clone, PartialEq)]
pub enum JogEnd {
    /// It was let go.
    Released,
    /// A client had the cell stop everything.
    Stopped,
    /// It has its length.
    Arrived,
    /// Something is in its way. A jog of a given length was not begun.
    Obstacle(JogObstacle),
    /// Something else moves this joint, counted from 1 at the base, or holds it.
    NotFollowing {
        /// The joint, counted from 1 at the base.
        joint: usize,
    },
    /// The tip is not where the kinematics has it; nothing was moved.
    OtherTip,
}

impl Arm {
    /// Jogs from a standstill until it is let go, is `length` further (m or rad) or something is in the way.
    ///
    /// `held` is called once per pass: for the share of the fastest speed, over 0 and up to 1, or `None` to come to
    /// rest.
    ///
    /// # Errors
    /// [`LinkError::NotRunning`], also when the simulation is ended meanwhile; [`LinkError::BadMotion`] for a joint or a
    /// direction that does not exist. After any other [`LinkError`] the arm is at rest where it was last sent.
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
        let start = self.movable_joints()?;
        if let ArmJog::Line { kinematics, .. } | ArmJog::Turn { kinematics, .. } = jog
            && !kinematics.fits(&start, &self.base_from_tip()?)
        {
            return Ok(JogEnd::OtherTip);
        }
        let path = self.path(jog, &start)?;
        let among = self.among.clone();
        let among = among.as_deref().map(|among| Watch { guard: among.guard(&start), arm: &among.arm });
        match JogPlan::new(path, among, start, self.info.time_step_s, length) {
            Ok(plan) => {
                let mut stream = Stream::begin(self, start, TASK)?;
                let outcome = self.send_jog(plan, &mut stream, held);
                stream.end(self, outcome)
            }
            Err(obstacle) => Ok(JogEnd::Obstacle(obstacle)),
        }
    }

    fn send_jog(
        &mut self,
        mut plan: JogPlan<'_>,
        stream: &mut Stream,
        held: &mut dyn FnMut() -> Option<f64>,
    ) -> Result<JogEnd, LinkError> {
        loop {
            let mut share = held();
            let pass = stream.pass(self, |slot| {
                share = share.filter(|_| !slot.is_stopped);
                Point { joints: plan.advance(share), target: None }
            })?;
            match pass {
                Pass::NotFollowing { joint, .. } => {
                    require_running(&mut self.sim, TASK)?;
                    return Ok(JogEnd::NotFollowing { joint: joint + 1 });
                }
                Pass::None => require_running(&mut self.sim, TASK)?,
                Pass::Sent if plan.is_at_end() => return Ok(JogEnd::Arrived),
                Pass::Sent if plan.is_at_rest() => match plan.obstacle() {
                    _ if stream.is_stopped() => return Ok(JogEnd::Stopped),
                    _ if share.is_none() => return Ok(JogEnd::Released),
                    Some(obstacle) => return Ok(JogEnd::Obstacle(obstacle.clone())),
                    // Held at a speed of nothing.
                    None => {}
                },
                Pass::Sent => {}
            }
        }
    }

    fn path<'a>(&self, jog: &ArmJog<'a>, start: &JointValues) -> Result<Path<'a>, LinkError> {
        match *jog {
            ArmJog::Joint { index, forward } => {
                let (what, expected) = ("the joint", "one of the arm's, counted from 0");
                let none = LinkError::BadMotion { what, expected, value: index as f64 };
                let joint = *self.info.joints.get(index).ok_or(none)?;
                Ok(Path::Joint { index, joint, sign: if forward { 1.0 } else { -1.0 }, start: *start })
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
