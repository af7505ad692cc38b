//! Revolute joints: position, range, and the motion towards a target position.

use std::f64::consts::{PI, TAU};

use super::error::WorldError;
use crate::cell::motion::{JointMotion, MotionLimits, MotionState, Sync};

/// Limits of a motion to a target position: velocity, acceleration and jerk in rad/s, rad/s² and rad/s³.
pub type DriveLimits = [f64; 3];

/// Limits that the stock UR5 model stores: 90°/s, 360°/s², 360°/s³.
const DEFAULT_LIMITS: DriveLimits = [PI / 2.0, TAU, TAU];

/// A revolute joint. It has no mass: it is where it is put, or on its way to a target.
#[derive(Debug, Clone)]
pub struct Joint {
    /// Whether it turns without end; its position is then in (−π, π].
    pub cyclic: bool,
    min_rad: f64,
    max_rad: f64,
    position_rad: f64,
    target_rad: f64,
    limits: DriveLimits,
    drive: Option<JointMotion>,
}

impl Joint {
    /// A joint at 0, or at the end of its range that is nearest to 0.
    pub fn new(min_rad: f64, max_rad: f64) -> Self {
        let position_rad = 0.0_f64.max(min_rad).min(max_rad);
        Self {
            cyclic: false,
            min_rad,
            max_rad,
            position_rad,
            target_rad: position_rad,
            limits: DEFAULT_LIMITS,
            drive: None,
        }
    }

    /// What its encoder says, radians.
    pub fn position_rad(&self) -> f64 {
        self.position_rad
    }

    /// Where it was last sent, radians.
    pub fn target_rad(&self) -> f64 {
        self.target_rad
    }

    /// Velocity of the motion towards a target position; zero where it is only put from place to place.
    pub fn velocity_rad_s(&self) -> f64 {
        self.drive.as_ref().and_then(|drive| drive.at(drive.time_s()).vel.first().copied()).unwrap_or(0.0)
    }

    /// Smallest and largest position.
    pub fn interval_rad(&self) -> (f64, f64) {
        (self.min_rad, self.max_rad)
    }

    /// Whether it is on its way to a target position.
    pub fn is_driven(&self) -> bool {
        self.drive.is_some()
    }

    /// Puts it to a position, at the end of its range if that lies outside.
    ///
    /// `false`, and nothing happens, while it is on its way to a target position.
    ///
    /// # Errors
    /// [`WorldError::InvalidData`] for NaN and infinities.
    pub fn set_position(&mut self, position_rad: f64) -> Result<bool, WorldError> {
        let position_rad = self.allowed(position_rad)?;
        if self.is_driven() {
            return Ok(false);
        }
        self.position_rad = position_rad;
        self.target_rad = position_rad;
        Ok(true)
    }

    /// Starts a jerk-limited motion to a position, at the end of its range if that lies outside; replaces the one
    /// under way and takes over its velocity. The limits last until others are given.
    ///
    /// # Errors
    /// [`WorldError::InvalidData`] for numbers that are not finite, and limits that are not positive.
    pub fn drive_to(&mut self, target_rad: f64, limits: Option<DriveLimits>) -> Result<(), WorldError> {
        let target_rad = self.allowed(target_rad)?;
        let limits = limits.unwrap_or(self.limits);
        let state = match &self.drive {
            Some(drive) => drive.at(drive.time_s()).state(),
            None => MotionState::at_rest(vec![self.position_rad]),
        };
        let [max_vel, max_accel, max_jerk] = limits;
        let bounds = MotionLimits::uniform(1, max_vel, max_accel, max_jerk);
        let drive = JointMotion::new(state, &[target_rad], &[0.0], Some(&bounds), Sync::Time);
        self.drive = Some(drive.map_err(|error| {
            tracing::debug!(%error, "a joint's motion was refused");
            WorldError::InvalidData
        })?);
        self.limits = limits;
        self.target_rad = target_rad;
        Ok(())
    }

    /// Brakes a motion to a target position as fast as its limits allow.
    pub fn brake(&mut self) {
        let Some(drive) = self.drive.take() else { return };
        let [max_vel, max_accel, max_jerk] = self.limits;
        let state = drive.at(drive.time_s()).state();
        // The state comes from a motion within the same limits, so a profile exists; without one, standing still is
        // the safe answer.
        self.drive = JointMotion::stop(state, &MotionLimits::uniform(1, max_vel, max_accel, max_jerk)).ok();
        self.target_rad = self
            .drive
            .as_ref()
            .and_then(|drive| drive.target_pos().first().copied())
            .map_or(self.position_rad, |target| target.clamp(self.min_rad, self.max_rad));
    }

    /// Moves on by one time step of the simulation.
    pub(super) fn advance(&mut self, dt_s: f64) {
        let Some(drive) = &mut self.drive else { return };
        let step = drive.step(dt_s);
        if let Some(position) = step.pos.first() {
            self.position_rad = self.wrapped(*position);
        }
        if step.finished {
            self.drive = None;
        }
    }

    /// Puts it back to a position and forgets where it was going.
    pub(super) fn reset(&mut self, position_rad: f64) {
        self.position_rad = position_rad;
        self.target_rad = position_rad;
        self.drive = None;
    }

    fn allowed(&self, position_rad: f64) -> Result<f64, WorldError> {
        if position_rad.is_finite() { Ok(self.wrapped(position_rad)) } else { Err(WorldError::InvalidData) }
    }

    fn wrapped(&self, position_rad: f64) -> f64 {
        if !self.cyclic {
            return position_rad.clamp(self.min_rad, self.max_rad);
        }
        let turned = position_rad.rem_euclid(TAU);
        if turned > PI { turned - TAU } else { turned }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn positions_beyond_the_range_stop_at_its_end() {
        let mut joint = Joint::new(-1.0, 2.0);
        assert_eq!(joint.set_position(3.0), Ok(true));
        assert_eq!(joint.position_rad(), 2.0);
        assert_eq!(joint.set_position(f64::NAN), Err(WorldError::InvalidData));
        assert_eq!(joint.position_rad(), 2.0);
    }

    #[test]
    fn a_cyclic_joint_wraps_into_one_turn() {
        let mut joint = Joint::new(-PI, PI);
        joint.cyclic = true;
        assert_eq!(joint.set_position(1.5 * PI), Ok(true));
        assert!((joint.position_rad() + PI / 2.0).abs() < 1e-12);
    }

    #[test]
    fn a_driven_joint_ignores_positions_and_arrives_within_its_limits() {
        let mut joint = Joint::new(-TAU, TAU);
        joint.drive_to(1.0, Some([0.5, 2.0, 10.0])).expect("valid limits");
        assert_eq!(joint.set_position(-1.0), Ok(false));
        let mut previous = 0.0;
        let mut steps = 0;
        while joint.is_driven() {
            joint.advance(0.05);
            assert!((joint.position_rad() - previous) / 0.05 <= 0.5 + 1e-9);
            previous = joint.position_rad();
            steps += 1;
        }
        assert_eq!(joint.position_rad(), 1.0);
        // 2 s at full speed, and the time to reach it and to stop.
        assert!((40..60).contains(&steps), "{steps} steps");
    }

    #[test]
    fn braking_neither_jumps_nor_goes_on_to_the_target() {
        let mut joint = Joint::new(-TAU, TAU);
        joint.drive_to(3.0, Some([1.0, 4.0, 40.0])).expect("valid limits");
        for _ in 0..20 {
            joint.advance(0.05);
        }
        let at_brake = joint.position_rad();
        joint.brake();
        let mut previous = at_brake;
        while joint.is_driven() {
            joint.advance(0.05);
            assert!(joint.position_rad() >= previous - 1e-9 && joint.position_rad() - previous < 0.051);
            previous = joint.position_rad();
        }
        assert!(previous > at_brake && previous < at_brake + 0.3, "came to rest at {previous}");
    }

    #[test]
    fn limits_of_zero_are_refused_and_leave_the_joint_alone() {
        let mut joint = Joint::new(-TAU, TAU);
        assert_eq!(joint.drive_to(1.0, Some([0.0, 1.0, 1.0])), Err(WorldError::InvalidData));
        assert!(!joint.is_driven());
    }
}
