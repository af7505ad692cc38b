//! Pose of the tip for which the camera keeps its view of the board or the tip stays at a corner.

use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};

use super::Estimate;
use handeye_estimate::handeye::HandEye;
use handeye_estimate::verify::Predictor;
use handeye_geometry::frames::{Base, Camera, Pose, Target, Tip};
use handeye_geometry::targets::TargetSpec;

/// What is kept while the board moves.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Keep {
    /// The board in the camera.
    View(Pose<Camera, Target>),
    /// The tip in front of a corner.
    Corner {
        /// Index into the target's points.
        index: usize,
        /// Distance in front of it \[m\], along the board's normal towards the viewer.
        stand_off_m: f64,
        /// Orientation of the tip in the base.
        base_from_tip_orientation: UnitQuaternion<f64>,
    },
}

/// Where the tip should be at the time of an estimate, and how it should move on.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TipGoal {
    /// Pose of the tip at that time.
    pub base_from_tip: Pose<Base, Tip>,
    /// Velocity of the tip, in base axes [m/s].
    pub velocity_m_s: Vector3<f64>,
    /// Angular velocity of the tip, in base axes [rad/s].
    pub angular_velocity_rad_s: Vector3<f64>,
}

impl Keep {
    /// The tip by which this is kept, for a camera on the tip. Its velocities are those of a body rigidly attached to
    /// the board; the tip in front of a corner goes along with the corner and does not turn.
    ///
    /// `None` for a camera next to the robot (eye to hand) (the board is then on the tip, or its view does not depend
    /// on the tip), for a corner that the board does not have, and for numbers that are not finite.
    pub fn tip_goal(&self, estimate: &Estimate, calibrated: &Predictor, target: &TargetSpec) -> Option<TipGoal> {
        let HandEye::EyeInHand { tip_from_camera, .. } = calibrated.hand_eye else { return None };
        let goal = match *self {
            Self::View(camera_from_target) => {
                let base_from_camera: Pose<Base, Camera> = estimate.base_from_target * camera_from_target.inverse();
                let base_from_tip = base_from_camera * tip_from_camera.inverse();
                TipGoal {
                    base_from_tip,
                    velocity_m_s: velocity_of(estimate, &base_from_tip.translation()),
                    angular_velocity_rad_s: estimate.angular_velocity_rad_s,
                }
            }
            Self::Corner { index, stand_off_m, base_from_tip_orientation } => {
                if index >= target.len() {
                    return None;
                }
                // z points into the board.
                let on_target = target.point(index) - Vector3::z() * stand_off_m;
                let at = (estimate.base_from_target.isometry() * on_target).coords;
                TipGoal {
                    base_from_tip: Isometry3::from_parts(Translation3::from(at), base_from_tip_orientation).into(),
                    velocity_m_s: velocity_of(estimate, &at),
                    angular_velocity_rad_s: Vector3::zeros(),
                }
            }
        };
        let velocities = goal.velocity_m_s.iter().chain(goal.angular_velocity_rad_s.iter());
        (goal.base_from_tip.is_finite() && velocities.into_iter().all(|v| v.is_finite())).then_some(goal)
    }
}

/// Velocity of the point of the board (and of what is rigidly attached to it) that is at `at` in the base [m/s].
fn velocity_of(estimate: &Estimate, at: &Vector3<f64>) -> Vector3<f64> {
    estimate.velocity_m_s + estimate.angular_velocity_rad_s.cross(&(at - estimate.base_from_target.translation()))
}

#[cfg(test)]
#[path = "goal_tests.rs"]
mod tests;
