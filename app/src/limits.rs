//! How fast the arm moves when nobody says otherwise.

use handeye_core::poses_file;
use handeye_sim_link::client::MotionLimits;

/// Limits of the reference tour: of every motion in the window, and of pose files without their own.
pub const TOUR: poses_file::MotionLimits = poses_file::MotionLimits {
    joint_velocity: 310.0 * std::f64::consts::PI / 180.0,
    joint_acceleration: 100.0 * std::f64::consts::PI / 180.0,
    joint_jerk: 80.0 * std::f64::consts::PI / 180.0,
    tip_velocity: 30.0,
    tip_acceleration: 1.0,
    tip_jerk: 1.0,
};

/// For motions of the six joints, at a share of the speed.
pub fn of_joints(limits: &poses_file::MotionLimits, share: f64) -> MotionLimits {
    let [velocity, acceleration, jerk] =
        slower([limits.joint_velocity, limits.joint_acceleration, limits.joint_jerk], share);
    MotionLimits::uniform(6, velocity, acceleration, jerk)
}

/// For motions of the tip (x, y, z, angle), at a share of the speed.
pub fn of_tip(limits: &poses_file::MotionLimits, share: f64) -> MotionLimits {
    let [velocity, acceleration, jerk] = slower([limits.tip_velocity, limits.tip_acceleration, limits.tip_jerk], share);
    MotionLimits::uniform(4, velocity, acceleration, jerk)
}

/// The limits of the same motion in slower time: at half the speed it takes twice as long. The velocity alone would not
/// do, because short motions end before they are as fast as they may be.
fn slower([velocity, acceleration, jerk]: [f64; 3], share: f64) -> [f64; 3] {
    [velocity * share, acceleration * share.powi(2), jerk * share.powi(3)]
}
