//! Joints: position, range, and the motion towards a target position.
//!
//! Where a name says radians, the unit is metres for a prismatic joint.

use std::f64::consts::{PI, TAU};

use handeye_arm::{JointKind, JointRange};
use nalgebra::{Isometry3, Translation3};

use super::error::WorldError;
use handeye_motion::{JointMotion, MotionLimits, MotionState, Sync};

/// Limits of a motion to a target position: velocity, acceleration and jerk in rad/s, rad/s² and rad/s³.
pub type DriveLimits = [f64; 3];

/// Limits that the stock UR5 model stores: 90°/s, 360°/s², 360°/s³.
const DEFAULT_LIMITS: DriveLimits = [PI / 2.0, TAU, TAU];

/// Acceleration and jerk of that model per velocity \[1/s and 1/s²\], which other joints have too: only their speeds are
/// published.
const PER_SPEED: [f64; 2] = [4.0, 4.0];

/// A kinematic joint that is within this of its target is not moved by the simulator's main script \[rad\].
const STANDS_WITHIN_RAD: f64 = 0.01 * PI / 180.0;
/// The same for a prismatic joint \[m\]. It has not been measured; it is as far as the tip of an arm of 0.1 m goes by the
/// above.
const STANDS_WITHIN_M: f64 = 0.02e-3;

/// A dynamic joint lags behind a steady target by its velocity times this \[s\].
const LAG_S: f64 = 0.07;
/// How often in a radian the rest error of a dynamic joint changes: other poses, other errors.
const LOAD_WAVES: f64 = 7.0;

/// What moves a joint.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum JointMode {
    /// Whoever puts it somewhere, or sends it to a target position along a profile.
    #[default]
    Kinematic,
    /// Its controller alone, which takes it to its target position.
    Dynamic,
}

/// The motion that a target position sets for a kinematic joint.
#[derive(Debug, Clone)]
enum Drive {
    /// It is on its way.
    Moving(Box<JointMotion>),
    /// It was at its target already, so nothing moves it and the motion never ends: positions are refused until another
    /// target has moved it, as CoppeliaSim does since 4.7.
    Stuck,
}

/// A joint without mass.
#[derive(Debug, Clone)]
pub struct Joint {
    /// Whether it turns or shifts its children.
    pub kind: JointKind,
    /// Whether it turns without end; its position is then in (−π, π].
    pub cyclic: bool,
    /// What moves it.
    pub mode: JointMode,
    /// Largest distance from its target at which a dynamic joint comes to rest, as under a load that depends on the
    /// position.
    pub rest_error: f64,
    min_rad: f64,
    max_rad: f64,
    position_rad: f64,
    target_rad: f64,
    velocity_rad_s: f64,
    limits: DriveLimits,
    drive: Option<Drive>,
}

impl Joint {
    /// A kinematic joint with the range and the speed of an arm's: one that turns without end is cyclic.
    pub fn of(kind: JointKind, range: &JointRange) -> Self {
        let endless = !(range.min.is_finite() && range.max.is_finite());
        let mut joint = match kind {
            JointKind::Revolute if endless => Self::new(-PI, PI),
            _ => Self::new(range.min, range.max),
        };
        joint.kind = kind;
        joint.cyclic = endless && kind == JointKind::Revolute;
        if range.speed.is_finite() {
            joint.limits = [range.speed, PER_SPEED[0] * range.speed, PER_SPEED[1] * range.speed];
        }
        joint
    }

    /// The motion of its children: a turn about z or a shift along it.
    pub fn motion(&self, value: f64) -> Isometry3<f64> {
        match self.kind {
            JointKind::Revolute => super::turn_z(value),
            JointKind::Prismatic => Translation3::new(0.0, 0.0, value).into(),
        }
    }

    /// A revolute kinematic joint at 0, or at the end of its range that is nearest to 0.
    pub(crate) fn new(min_rad: f64, max_rad: f64) -> Self {
        let position_rad = 0.0_f64.max(min_rad).min(max_rad);
        Self {
            kind: JointKind::Revolute,
            cyclic: false,
            mode: JointMode::Kinematic,
            rest_error: 0.0,
            min_rad,
            max_rad,
            position_rad,
            target_rad: position_rad,
            velocity_rad_s: 0.0,
            limits: DEFAULT_LIMITS,
            drive: None,
        }
    }

    /// Encoder value, radians.
    pub fn position_rad(&self) -> f64 {
        self.position_rad
    }

    /// Its last target, radians.
    pub fn target_rad(&self) -> f64 {
        self.target_rad
    }

    /// Velocity of the motion towards a target position; zero where it is only put from place to place.
    pub fn velocity_rad_s(&self) -> f64 {
        self.velocity_rad_s
    }

    /// Smallest and largest position.
    pub fn interval_rad(&self) -> (f64, f64) {
        (self.min_rad, self.max_rad)
    }

    /// Whether it still has a target position to be moved to: a kinematic joint refuses positions then.
    pub(crate) fn is_driven(&self) -> bool {
        self.drive.is_some()
    }

    /// Puts it to a position, at the end of its range if that lies outside. The controller of a dynamic joint takes it
    /// back to its target.
    ///
    /// `false`, and nothing happens, while a target position drives it.
    ///
    /// # Errors
    /// [`WorldError::InvalidData`] for NaN and infinities.
    pub fn set_position(&mut self, position_rad: f64) -> Result<bool, WorldError> {
        let position_rad = self.allowed(position_rad)?;
        if self.is_driven() {
            return Ok(false);
        }
        self.position_rad = position_rad;
        if self.mode == JointMode::Kinematic {
            self.target_rad = position_rad;
        }
        Ok(true)
    }

    /// Has it be at a position in the next pass, as a motion that is computed point by point does: a dynamic joint gets
    /// a target, any other is put there. `false` if it refuses.
    ///
    /// # Errors
    /// As [`Self::set_position`].
    pub fn command(&mut self, position_rad: f64) -> Result<bool, WorldError> {
        match self.mode {
            JointMode::Kinematic => self.set_position(position_rad),
            JointMode::Dynamic => self.drive_to(position_rad, None).map(|()| true),
        }
    }

    /// Sends it to a position, at the end of its range if that lies outside. A kinematic joint moves there with limited
    /// jerk, which replaces the motion under way and takes over its velocity; the limits last until others are given.
    ///
    /// # Errors
    /// [`WorldError::InvalidData`] for numbers that are not finite, and limits that are not positive.
    pub fn drive_to(&mut self, target_rad: f64, limits: Option<DriveLimits>) -> Result<(), WorldError> {
        let target_rad = self.allowed(target_rad)?;
        let limits = limits.unwrap_or(self.limits);
        let stands_within = match self.kind {
            JointKind::Revolute => STANDS_WITHIN_RAD,
            JointKind::Prismatic => STANDS_WITHIN_M,
        };
        let state = match &self.drive {
            Some(Drive::Moving(drive)) => drive.at(drive.time_s()).state(),
            _ => MotionState::at_rest(vec![self.position_rad]),
        };
        let stands =
            !matches!(self.drive, Some(Drive::Moving(_))) && (target_rad - self.position_rad).abs() <= stands_within;
        let [max_vel, max_accel, max_jerk] = limits;
        let bounds = MotionLimits::uniform(1, max_vel, max_accel, max_jerk);
        let drive = JointMotion::new(state, &[target_rad], &[0.0], Some(&bounds), Sync::Time).map_err(|error| {
            tracing::debug!(%error, "a joint's motion was refused");
            WorldError::InvalidData
        })?;
        self.drive = match self.mode {
            JointMode::Dynamic => None,
            JointMode::Kinematic if stands => Some(Drive::Stuck),
            JointMode::Kinematic => Some(Drive::Moving(Box::new(drive))),
        };
        self.limits = limits;
        self.target_rad = target_rad;
        Ok(())
    }

    /// Brakes a motion to a target position as fast as its limits allow, and lets a joint that is stuck be moved again.
    pub(crate) fn brake(&mut self) {
        if self.mode == JointMode::Dynamic {
            self.target_rad = self.position_rad;
        }
        let Some(Drive::Moving(drive)) = self.drive.take() else { return };
        let [max_vel, max_accel, max_jerk] = self.limits;
        let state = drive.at(drive.time_s()).state();
        // The state comes from a motion within the same limits, so a profile exists; without one, staying at rest is
        // the safe answer.
        let stop = JointMotion::stop(state, &MotionLimits::uniform(1, max_vel, max_accel, max_jerk)).ok();
        self.target_rad = stop
            .as_ref()
            .and_then(|drive| drive.target_pos().first().copied())
            .map_or(self.position_rad, |target| target.clamp(self.min_rad, self.max_rad));
        self.drive = stop.map(|stop| Drive::Moving(Box::new(stop)));
    }

    /// Moves on by one time step of the simulation.
    pub(super) fn advance(&mut self, dt_s: f64) {
        if self.mode == JointMode::Dynamic {
            let rests_at = self.target_rad + self.rest_error * (LOAD_WAVES * self.target_rad + 1.0).sin();
            let way_rad = (rests_at - self.position_rad) * (1.0 - (-dt_s / LAG_S).exp());
            let most_rad = self.limits[0] * dt_s;
            let step_rad = way_rad.clamp(-most_rad, most_rad);
            self.velocity_rad_s = step_rad / dt_s;
            self.position_rad = self.wrapped(self.position_rad + step_rad);
            return;
        }
        let Some(Drive::Moving(drive)) = &mut self.drive else { return };
        let step = drive.step(dt_s);
        if let (Some(position), Some(velocity)) = (step.pos.first(), step.vel.first()) {
            self.velocity_rad_s = *velocity;
            self.position_rad = self.wrapped(*position);
        }
        if step.finished {
            self.velocity_rad_s = 0.0;
            self.drive = None;
        }
    }

    /// Puts it back to a position and forgets where it was going.
    pub(super) fn reset(&mut self, position_rad: f64) {
        self.position_rad = position_rad;
        self.target_rad = position_rad;
        self.velocity_rad_s = 0.0;
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
    fn a_dynamic_joint_rests_beside_its_target_by_no_more_than_it_is_said_to_and_says_so() {
        let mut joint = Joint::new(-TAU, TAU);
        joint.mode = JointMode::Dynamic;
        joint.rest_error = 1e-4;
        let mut rests_at = |target: f64| {
            joint.drive_to(target, None).expect("finite");
            (0..200).for_each(|_| joint.advance(0.05));
            joint.position_rad() - target
        };
        let off = [0.3, 0.9, -1.4].map(&mut rests_at);
        assert!(off.iter().all(|off| off.abs() <= 1.001e-4) && off.iter().any(|off| off.abs() > 2e-5), "{off:?}");
        assert!((rests_at(0.3) - off[0]).abs() < 1e-9, "the same target, another place");
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
    fn a_kinematic_joint_that_is_sent_to_where_it_stands_refuses_positions_until_it_was_moved() {
        let mut joint = Joint::new(-TAU, TAU);
        joint.drive_to(0.009_f64.to_radians(), None).expect("finite");
        for _ in 0..100 {
            joint.advance(0.05);
        }
        assert_eq!((joint.set_position(1.0), joint.position_rad()), (Ok(false), 0.0));
        joint.drive_to(0.02_f64.to_radians(), None).expect("finite");
        (0..100).for_each(|_| joint.advance(0.05));
        assert_eq!((joint.set_position(1.0), joint.position_rad()), (Ok(true), 1.0));
        joint.drive_to(1.0, None).expect("finite");
        joint.brake();
        assert_eq!(joint.set_position(0.0), Ok(true), "a stop frees it");
    }

    #[test]
    fn a_dynamic_joint_follows_its_target_and_comes_back_to_it() {
        let mut joint = Joint::new(-TAU, TAU);
        joint.mode = JointMode::Dynamic;
        joint.command(1.0).expect("finite");
        joint.advance(0.05);
        assert!((joint.position_rad() - DEFAULT_LIMITS[0] * 0.05).abs() < 1e-12, "at its largest speed");
        (0..100).for_each(|_| joint.advance(0.05));
        assert!((joint.position_rad() - 1.0).abs() < 1e-9);
        assert_eq!(joint.set_position(-1.0), Ok(true));
        (0..100).for_each(|_| joint.advance(0.05));
        assert!((joint.position_rad() - 1.0).abs() < 1e-9, "{}", joint.position_rad());
        // The same target again does no harm.
        joint.drive_to(1.0, None).expect("finite");
        assert_eq!(joint.set_position(0.5), Ok(true));
    }

    #[test]
    fn limits_of_zero_are_refused_and_leave_the_joint_alone() {
        let mut joint = Joint::new(-TAU, TAU);
        assert_eq!(joint.drive_to(1.0, Some([0.0, 1.0, 1.0])), Err(WorldError::InvalidData));
        assert!(!joint.is_driven());
    }
}
