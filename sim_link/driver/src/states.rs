//! The states that a driver has sent, and the robot at an instant between two of them.

use std::collections::VecDeque;

use handeye_arm::{Arm, JointValues};
use handeye_geometry::frames::{Base, Pose, Tip};
use handeye_geometry::se3;

use super::limits::STATES_APART_S;
use super::message::{BadMessage, PoseMessage, StateMessage};
use super::rest::Place;

/// For how long states are kept \[s\]: longer than the latency of an image.
const MEMORY_S: f64 = 10.0;
/// Most states that are kept: those of 8 s at the highest rate of the protocol.
const MOST: usize = 4096;

/// No joint is farther from its zero than this [rad, m], and no tip from its base \[m\]: a state beyond is faulty.
const FARTHEST_JOINT: f64 = 1e3;
const FARTHEST_TIP_M: f64 = 100.0;
/// A tip does not jump by more than this \[m\]: to the other side of the largest arms, as when a simulator is reset, or by the
/// length of a tool that is set. From there on it is not faster than twice the fastest arms \[m/s\].
const MOST_JUMP_M: f64 = 5.0;
const FASTEST_TIP_M_S: f64 = 20.0;

/// The robot by a state, on the driver's clock.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Reading {
    /// The driver's stamp \[s\].
    pub stamp_s: f64,
    /// Where the tip is.
    pub base_from_tip: Pose<Base, Tip>,
    /// A value for each joint, rad or m.
    pub joints: Option<JointValues>,
    /// Whether the controller moves the arm, where it reports that.
    pub moving: Option<bool>,
}

/// The robot at an instant between two states.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RobotAt {
    /// Where the tip was.
    pub base_from_tip: Pose<Base, Tip>,
    /// A value for each joint, rad or m.
    pub joints: Option<JointValues>,
    /// Whether either state reports that the arm moved; `None` where the driver does not report it.
    pub moving: Option<bool>,
    /// Speed of the tip between the two states \[m/s\].
    pub speed_m_s: f64,
    /// Rotation rate of the tip \[rad/s\].
    pub turn_rad_s: f64,
}

/// Why an image has no pose.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error, handeye_wording::Localized)]
#[non_exhaustive]
pub enum NoPose {
    /// There is no robot.
    #[error("the driver sends no states: the pose of each image has to be given")]
    NoRobot,
    /// No state has come.
    #[error("the robot's driver has not sent a state yet")]
    NoState,
    /// The clocks of robot and camera are not related yet.
    #[error("the clocks of robot and camera are not related yet: no pong has come")]
    NoClock,
    /// The image is older than every state.
    #[error("the image is {by_s:.3} s older than the oldest state: stamps of robot and camera do not belong together")]
    TooOld {
        /// By how much \[s\].
        by_s: f64,
    },
    /// No state has come after the image.
    #[error("there is no state after the image, the newest is {by_s:.3} s older: the robot's driver is late")]
    TooNew {
        /// By how much \[s\].
        by_s: f64,
    },
    /// The states around it are too far apart.
    #[error("the states before and after the image are {gap_s:.3} s apart, at most {STATES_APART_S} s")]
    Gap {
        /// How far apart \[s\].
        gap_s: f64,
    },
}

impl Reading {
    /// Reads a state: `base_from_tip`, or the flange with its tool, or the joints of a chain that is known.
    ///
    /// # Errors
    /// [`BadMessage`] for an invalid pose, a number of joints other than `joints`, a place that no arm can have, and a state
    /// without the tip's pose.
    pub(crate) fn of(state: &StateMessage, joints: usize, arm: Option<&Arm>) -> Result<Self, BadMessage> {
        if let Some(values) = &state.joints_rad
            && values.len() != joints
        {
            let why = format!("{} values, where hello has {joints} joints", values.len());
            return Err(BadMessage::value("joints_rad", why));
        }
        if joints > 0 && state.joints_rad.is_none() {
            return Err(BadMessage::value("joints_rad", "missing, where hello has joints"));
        }
        let tool = state.flange_from_tcp.map(|pose| pose.pose::<Tip, Tip>("flange_from_tcp")).transpose()?;
        let with_tool = |flange: Pose<Base, Tip>| tool.map_or(flange, |tool| flange * tool);
        let read = |pose: PoseMessage, field| pose.pose::<Base, Tip>(field);
        let base_from_tip = match (state.base_from_tip, state.base_from_flange, arm, &state.joints_rad) {
            (Some(tip), ..) => read(tip, "base_from_tip")?,
            (None, Some(flange), ..) => with_tool(read(flange, "base_from_flange")?),
            (None, None, Some(arm), Some(values)) => {
                with_tool(arm.forward(values).map_err(|error| BadMessage::value("joints_rad", error))?)
            }
            _ => {
                return Err(BadMessage::value(
                    "state",
                    "base_from_tip is missing, and nothing else says where the tip is",
                ));
            }
        };
        if let Some((i, value)) =
            state.joints_rad.iter().flatten().enumerate().find(|(_, value)| value.abs() > FARTHEST_JOINT)
        {
            let why = format!("joint {} at {value:.3e} (rad or m): no joint of an arm is there", i + 1);
            return Err(BadMessage::value("joints_rad", why));
        }
        let away_m = base_from_tip.translation().norm();
        if away_m > FARTHEST_TIP_M {
            let why = format!("the tip is {away_m:.3e} m from the base: no arm reaches there; translations are metres");
            return Err(BadMessage::value("base_from_tip", why));
        }
        Ok(Self { stamp_s: state.stamp, base_from_tip, joints: state.joints_rad, moving: state.moving })
    }

    /// Where the arm is, for a [`RestWatch`](super::RestWatch).
    pub(crate) fn place(&self) -> Place {
        Place { stamp_s: self.stamp_s, joints: self.joints, base_from_tip: self.base_from_tip }
    }

    fn between(&self, next: &Self, stamp_s: f64) -> RobotAt {
        let gap_s = next.stamp_s - self.stamp_s;
        let part = if gap_s > 0.0 { ((stamp_s - self.stamp_s) / gap_s).clamp(0.0, 1.0) } else { 1.0 };
        let motion = se3::log((self.base_from_tip.inverse() * next.base_from_tip).isometry());
        let per_s = if gap_s > 0.0 { 1.0 / gap_s } else { 0.0 };
        let joints = match (&self.joints, &next.joints) {
            (Some(a), Some(b)) if a.len() == b.len() => {
                Some(JointValues::from_fn(a.len(), |i| a[i] + part * (b[i] - a[i])))
            }
            _ => None,
        };
        RobotAt {
            base_from_tip: self.base_from_tip.perturbed(&(part * motion)),
            joints,
            moving: match (self.moving, next.moving) {
                (None, None) => None,
                (a, b) => Some(a.unwrap_or(false) || b.unwrap_or(false)),
            },
            speed_m_s: motion.fixed_rows::<3>(0).norm() * per_s,
            turn_rad_s: motion.fixed_rows::<3>(3).norm() * per_s,
        }
    }
}

/// The newest states in the order of their stamps.
#[derive(Debug, Clone, Default)]
pub struct States {
    readings: VecDeque<Reading>,
}

impl States {
    /// Adds the newest.
    ///
    /// # Errors
    /// [`BadMessage::Value`] for a stamp before that of the one before it, and for a tip that jumps.
    pub fn add(&mut self, reading: Reading) -> Result<(), BadMessage> {
        if let Some(last) = self.readings.back()
            && reading.stamp_s < last.stamp_s
        {
            let why = format!("{} after {}: stamps never go back", reading.stamp_s, last.stamp_s);
            return Err(BadMessage::value("stamp", why));
        }
        if let Some(last) = self.readings.back() {
            let (jump_m, _) = last.base_from_tip.distance_to(&reading.base_from_tip);
            let gap_s = reading.stamp_s - last.stamp_s;
            if jump_m > MOST_JUMP_M + FASTEST_TIP_M_S * gap_s {
                let why = format!("the tip is {jump_m:.1} m from where it was {gap_s:.3} s before: no arm is so fast");
                return Err(BadMessage::value("base_from_tip", why));
            }
        }
        while self.readings.len() >= MOST
            || self.readings.front().is_some_and(|first| reading.stamp_s - first.stamp_s > MEMORY_S)
        {
            self.readings.pop_front();
        }
        self.readings.push_back(reading);
        Ok(())
    }

    pub fn newest(&self) -> Option<&Reading> {
        self.readings.back()
    }

    /// The robot at an instant of the driver's clock, by the screw motion between the two states around it.
    ///
    /// # Errors
    /// [`NoPose`] where these are missing or too far apart.
    pub fn at(&self, stamp_s: f64) -> Result<RobotAt, NoPose> {
        let (Some(first), Some(last)) = (self.readings.front(), self.readings.back()) else {
            return Err(NoPose::NoState);
        };
        let next = self.readings.partition_point(|reading| reading.stamp_s < stamp_s);
        if next == self.readings.len() {
            return Err(NoPose::TooNew { by_s: stamp_s - last.stamp_s });
        }
        let after = &self.readings[next];
        if after.stamp_s == stamp_s && next == 0 {
            return Ok(after.between(after, stamp_s));
        }
        let Some(before) = next.checked_sub(1).map(|i| &self.readings[i]) else {
            return Err(NoPose::TooOld { by_s: first.stamp_s - stamp_s });
        };
        let gap_s = after.stamp_s - before.stamp_s;
        if gap_s > STATES_APART_S {
            return Err(NoPose::Gap { gap_s });
        }
        Ok(before.between(after, stamp_s))
    }
}

#[cfg(test)]
#[expect(clippy::unwrap_used, reason = "a test fails by panicking")]
#[path = "states_tests.rs"]
mod tests;
