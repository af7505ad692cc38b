//! Jerk-limited moves of joints and poses, sampled at any step.
//!
//! Positions are radians or metres, whatever the caller's degrees of freedom are; velocities, accelerations and jerks
//! are their derivatives by seconds. Nothing here knows a clock: a motion moves on by the `dt` that it is given.
//!
//! ```
//! use handeye_motion::{JointMotion, MotionLimits, MotionState, Sync};
//!
//! let limits = MotionLimits::uniform(1, 1.0, 2.0, 10.0);
//! let mut motion = JointMotion::new(MotionState::at_rest(vec![0.0]), &[0.5], &[0.0], Some(&limits), Sync::Time)?;
//! while !motion.step(0.01).finished {}
//! assert_eq!(motion.at(motion.duration_s()).pos, [0.5]);
//! # Ok::<(), handeye_motion::MotionError>(())
//! ```

#![warn(missing_docs)]

mod board_motion;
mod course;
mod joint;
mod pose;

pub use board_motion::{BoardMotionSpec, BoardPath, OutOfRange, UnknownPath};
pub use course::{Course, braked};
pub use joint::{JointMotion, shortest_way};
pub use pose::{PoseMotion, PoseStep};

/// Position, velocity and acceleration, one number per degree of freedom.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct MotionState {
    /// Positions.
    pub pos: Vec<f64>,
    /// Velocities.
    pub vel: Vec<f64>,
    /// Accelerations, in units of position per s².
    pub accel: Vec<f64>,
}

impl MotionState {
    /// Standing still at `pos`.
    pub fn at_rest(pos: Vec<f64>) -> Self {
        let zeros = vec![0.0; pos.len()];
        Self { pos, vel: zeros.clone(), accel: zeros }
    }
}

/// Limits of a motion, one number per degree of freedom; maxima are positive, minima negative.
#[derive(Debug, Clone, PartialEq)]
pub struct MotionLimits {
    /// Largest velocity.
    pub max_vel: Vec<f64>,
    /// Largest acceleration.
    pub max_accel: Vec<f64>,
    /// Largest jerk, either way.
    pub max_jerk: Vec<f64>,
    /// Smallest velocity; absent means `-max_vel`.
    pub min_vel: Option<Vec<f64>>,
    /// Smallest acceleration; absent means `-max_accel`.
    pub min_accel: Option<Vec<f64>>,
}

impl MotionLimits {
    /// The same symmetric limits for `dofs` degrees of freedom.
    pub fn uniform(dofs: usize, max_vel: f64, max_accel: f64, max_jerk: f64) -> Self {
        Self {
            max_vel: vec![max_vel; dofs],
            max_accel: vec![max_accel; dofs],
            max_jerk: vec![max_jerk; dofs],
            min_vel: None,
            min_accel: None,
        }
    }
}

/// Synchronization of the degrees of freedom.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Sync {
    /// On a straight line, where the start allows one; else as [`Sync::Time`].
    #[default]
    Phase,
    /// All arrive at the same time.
    Time,
    /// Each as fast as it can.
    None,
}

/// One sample of a motion.
#[derive(Debug, Clone, PartialEq)]
pub struct MotionStep {
    /// Positions.
    pub pos: Vec<f64>,
    /// Velocities.
    pub vel: Vec<f64>,
    /// Accelerations, in units of position per s².
    pub accel: Vec<f64>,
    /// Whether the goal is reached; positions are then exactly the goal's.
    pub finished: bool,
    /// Seconds until it is.
    pub time_left: f64,
}

impl MotionStep {
    /// The state that a following motion starts from.
    pub fn state(&self) -> MotionState {
        MotionState { pos: self.pos.clone(), vel: self.vel.clone(), accel: self.accel.clone() }
    }
}

/// Why a motion cannot be planned.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum MotionError {
    /// Two lists of numbers do not belong together.
    #[error("{what} has {got} values, the motion has {need} degrees of freedom")]
    WrongLength {
        /// Name of the list.
        what: &'static str,
        /// Its length.
        got: usize,
        /// Length needed.
        need: usize,
    },
    /// A limit forbids every motion, or is not a number.
    #[error("{what} of degree of freedom {dof} is {value}: it must be finite and {sign}")]
    BadLimit {
        /// Name of the limit.
        what: &'static str,
        /// Degree of freedom, counted from 0.
        dof: usize,
        /// The number that was given.
        value: f64,
        /// Sign that it must have.
        sign: &'static str,
    },
    /// A start or goal is not a number.
    #[error("{what} of degree of freedom {dof} is {value}, not a finite number")]
    NotFinite {
        /// Name of the list.
        what: &'static str,
        /// Degree of freedom, counted from 0.
        dof: usize,
        /// The number that was given.
        value: f64,
    },
    /// The limits admit no profile, for example because the goal's velocity exceeds them.
    #[error("no motion fits these limits: {reason}")]
    NoProfile {
        /// The error of the planner.
        reason: String,
    },
}

#[cfg(test)]
#[expect(clippy::unwrap_used, reason = "a test fails by panicking")]
mod tests;
