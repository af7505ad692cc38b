//! Default speeds of the arm.

use handeye_arm::JointKind;
use handeye_coppeliasim::MotionLimits;
use handeye_dataset::taught_poses;
use handeye_plan::Pace;

/// Limits of the reference sequence: of every motion in the window, and of pose files without their own.
pub const SEQUENCE: taught_poses::MotionLimits = taught_poses::MotionLimits {
    joint_velocity: 310.0 * std::f64::consts::PI / 180.0,
    joint_acceleration: 100.0 * std::f64::consts::PI / 180.0,
    joint_jerk: 80.0 * std::f64::consts::PI / 180.0,
    tip_velocity: 30.0,
    tip_acceleration: 1.0,
    tip_jerk: 1.0,
};

/// For motions of joints of these kinds, at a share of the speed. A prismatic joint takes the tip along as far as it goes
/// itself, so it has the limits of the tip.
pub fn of_joints(
    limits: &taught_poses::MotionLimits,
    share: f64,
    kinds: impl Iterator<Item = JointKind>,
) -> MotionLimits {
    let of_kind = |kind| match kind {
        JointKind::Revolute => pace(limits, share),
        JointKind::Prismatic => pace_of_tip(limits, share),
    };
    let mut all = MotionLimits { velocity: Vec::new(), acceleration: Vec::new(), jerk: Vec::new() };
    for Pace { speed, acceleration, jerk } in kinds.map(of_kind) {
        all.velocity.push(speed);
        all.acceleration.push(acceleration);
        all.jerk.push(jerk);
    }
    all
}

/// For motions of the tip (x, y, z, angle), at a share of the speed.
pub fn of_tip(limits: &taught_poses::MotionLimits, share: f64) -> MotionLimits {
    let Pace { speed, acceleration, jerk } = pace_of_tip(limits, share);
    MotionLimits::uniform(4, speed, acceleration, jerk)
}

/// Pace of revolute joints at a share of the speed. The velocity alone would not suffice, because short motions end before
/// they reach it.
pub fn pace(limits: &taught_poses::MotionLimits, share: f64) -> Pace {
    Pace { speed: limits.joint_velocity, acceleration: limits.joint_acceleration, jerk: limits.joint_jerk }
        .slower(share)
}

fn pace_of_tip(limits: &taught_poses::MotionLimits, share: f64) -> Pace {
    Pace { speed: limits.tip_velocity, acceleration: limits.tip_acceleration, jerk: limits.tip_jerk }.slower(share)
}

#[cfg(test)]
mod tests {
    use handeye_motion::{self as motion, JointMotion, MotionState, Sync};

    use super::*;

    /// How long the cell's generator of motions takes for joint 1 to turn by an angle.
    fn duration_s(share: f64, angle_rad: f64) -> f64 {
        let MotionLimits { velocity, acceleration, jerk } =
            of_joints(&SEQUENCE, share, [JointKind::Revolute].into_iter());
        let limits = motion::MotionLimits::uniform(1, velocity[0], acceleration[0], jerk[0]);
        let start = MotionState::at_rest(vec![0.0]);
        let motion = JointMotion::new(start, &[angle_rad], &[0.0], Some(&limits), Sync::Phase).expect("a motion");
        motion.duration_s()
    }

    #[test]
    fn a_quarter_of_the_speed_takes_four_times_as_long_however_short_the_way() {
        for angle_rad in [0.01, 0.4, 5.0] {
            let ratio = duration_s(0.25, angle_rad) / duration_s(1.0, angle_rad);
            assert!((ratio - 4.0).abs() < 1e-6, "{ratio} over {angle_rad} rad");
        }
    }

    #[test]
    fn a_motion_takes_as_long_as_guided_capture_reckons() {
        for (share, angle_rad) in [(1.0, 0.01), (1.0, 0.4), (0.25, 1.0), (0.5, 5.0)] {
            let (took_s, reckoned_s) = (duration_s(share, angle_rad), pace(&SEQUENCE, share).duration_s(angle_rad));
            assert!(
                (took_s - reckoned_s).abs() < 1e-6 * took_s,
                "{reckoned_s} s instead of {took_s} s over {angle_rad} rad"
            );
        }
    }
}
