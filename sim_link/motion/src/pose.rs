//! Moves of a pose, as `sim.moveToPose` makes them.

use nalgebra::{Isometry3, Translation3, Vector3, Vector4};

use super::{JointMotion, MotionError, MotionLimits, MotionState, MotionStep, Sync};
use handeye_geometry::se3::rotation_vector;

/// A planned move of a pose.
///
/// Without a metric the four degrees of freedom are the three displacements and the angle of the rotation between
/// start and goal; the path is straight with [`Sync::Phase`] only. With a metric `(mx, my, mz, mθ)` there is one, the
/// distance `‖(mx Δx, my Δy, mz Δz, mθ θ)‖`, and the path is always straight. The rotation always goes along the one
/// axis that joins start and goal, the short way.
#[derive(Debug, Clone)]
pub struct PoseMotion {
    start: Isometry3<f64>,
    goal: Isometry3<f64>,
    shift: Vector3<f64>,
    turn: Vector3<f64>,
    /// Distance in the metric, where one is used.
    distance: Option<f64>,
    motion: JointMotion,
}

/// One sample of a pose motion.
#[derive(Debug, Clone, PartialEq)]
pub struct PoseStep {
    /// Where it is.
    pub pose: Isometry3<f64>,
    /// Velocities: `[x, y, z, angle]` without a metric, one number with it.
    pub vel: Vec<f64>,
    /// Accelerations of the same degrees of freedom.
    pub accel: Vec<f64>,
    /// Whether the goal is reached; the pose is then exactly the goal.
    pub finished: bool,
    /// Seconds until it is.
    pub time_left: f64,
}

impl PoseMotion {
    /// Plans a move from rest at `start` to rest at `goal`, both in the same frame.
    ///
    /// `limits` have four entries without a metric (x, y, z in metres, angle in radians) and one with it; without
    /// limits the first step arrives.
    ///
    /// # Errors
    /// [`MotionError`]: limits of the wrong length, limits of zero, a metric that is not made of four finite numbers
    /// of which none is negative, or a pose that is not finite.
    pub fn new(
        start: &Isometry3<f64>,
        goal: &Isometry3<f64>,
        limits: Option<&MotionLimits>,
        metric: Option<[f64; 4]>,
        sync: Sync,
    ) -> Result<Self, MotionError> {
        let target_vel = vec![0.0; if metric.is_some() { 1 } else { 4 }];
        Self::with_target_velocity(start, goal, &target_vel, limits, metric, sync)
    }

    /// [`Self::new`] with velocities at the goal, as many as the limits have entries.
    ///
    /// # Errors
    /// As [`Self::new`].
    pub fn with_target_velocity(
        start: &Isometry3<f64>,
        goal: &Isometry3<f64>,
        target_vel: &[f64],
        limits: Option<&MotionLimits>,
        metric: Option<[f64; 4]>,
        sync: Sync,
    ) -> Result<Self, MotionError> {
        let shift = goal.translation.vector - start.translation.vector;
        let turn = rotation_vector(&(start.rotation.inverse() * goal.rotation));
        let way = Vector4::new(shift.x, shift.y, shift.z, turn.norm());
        if let Some(metric) = metric
            && let Some(dof) = metric.iter().position(|m| !(m.is_finite() && *m >= 0.0))
        {
            return Err(MotionError::BadLimit { what: "metric", dof, value: metric[dof], sign: "not negative" });
        }
        let distance = metric.map(|metric| Vector4::from(metric).component_mul(&way).norm());
        let target: Vec<f64> = distance.map_or_else(|| way.iter().copied().collect(), |d| vec![d]);
        let rest = MotionState::at_rest(vec![0.0; target.len()]);
        let motion = JointMotion::new(rest, &target, target_vel, limits, sync)?;
        Ok(Self { start: *start, goal: *goal, shift, turn, distance, motion })
    }

    /// Moves on by `dt` seconds and gives the pose there; see [`JointMotion::step`].
    pub fn step(&mut self, dt: f64) -> PoseStep {
        let MotionStep { pos, vel, accel, finished, time_left } = self.motion.step(dt);
        let pose = if finished && vel.iter().all(|v| *v == 0.0) { self.goal } else { self.pose_at(&pos) };
        PoseStep { pose, vel, accel, finished, time_left }
    }

    /// The fastest way to rest from where this motion is, within the limits of acceleration and jerk; each degree of
    /// freedom on its own, so without a metric the end of the path may bend.
    ///
    /// # Errors
    /// As [`Self::new`].
    pub fn stop(&self, limits: &MotionLimits) -> Result<Self, MotionError> {
        let motion = JointMotion::stop(self.motion.at(self.motion.time_s()).state(), limits)?;
        let goal = self.pose_at(motion.target_pos());
        Ok(Self { goal, motion, ..self.clone() })
    }

    /// Length of the whole motion in seconds.
    pub fn duration_s(&self) -> f64 {
        self.motion.duration_s()
    }

    /// Where it ends.
    pub fn goal(&self) -> &Isometry3<f64> {
        &self.goal
    }

    /// Distance between start and goal, in the metric where one is used, else in metres.
    pub fn distance(&self) -> f64 {
        self.distance.unwrap_or_else(|| self.shift.norm())
    }

    /// Angle between start and goal in radians.
    pub fn angle_rad(&self) -> f64 {
        self.turn.norm()
    }

    fn pose_at(&self, pos: &[f64]) -> Isometry3<f64> {
        let (shift, part) = match (self.distance, pos) {
            (Some(distance), &[travelled]) => {
                let part = if distance > 0.0 { travelled / distance } else { 1.0 };
                (self.shift * part, part)
            }
            (_, &[x, y, z, angle]) => {
                let total = self.turn.norm();
                (Vector3::new(x, y, z), if total > 0.0 { angle / total } else { 1.0 })
            }
            _ => (self.shift, 1.0),
        };
        Isometry3::from_parts(
            Translation3::from(self.start.translation.vector + shift),
            self.start.rotation * nalgebra::UnitQuaternion::from_scaled_axis(self.turn * part),
        )
    }
}
