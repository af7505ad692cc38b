//! Duration of joint motions.

/// The limits of a joint that moves from rest to rest.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pace {
    /// Largest speed, rad/s.
    pub speed: f64,
    /// Largest acceleration, rad/s².
    pub acceleration: f64,
    /// Largest jerk, rad/s³; infinite where it is not limited.
    pub jerk: f64,
}

impl Pace {
    /// The same motions slowed down: at half the speed each takes twice as long.
    #[must_use]
    pub fn slower(&self, share: f64) -> Self {
        let Self { speed, acceleration, jerk } = *self;
        Self { speed: speed * share, acceleration: acceleration * share.powi(2), jerk: jerk * share.powi(3) }
    }

    /// The shortest time in which a joint moves by this angle \[rad\], seconds.
    ///
    /// Source: Biagiotti and Melchiorri, "Trajectory Planning for Automatic Machines and Robots", 2008, section 3.4 (double S
    /// velocity profile with zero speed at both ends).
    pub fn duration_s(&self, way: f64) -> f64 {
        let Self { speed, acceleration, jerk } = *self;
        // From rest to the highest speed, jerk both ways.
        let ramp_s = if speed * jerk < acceleration.powi(2) {
            2.0 * (speed / jerk).sqrt()
        } else {
            speed / acceleration + acceleration / jerk
        };
        if way >= speed * ramp_s {
            return way / speed + ramp_s;
        }
        // The highest speed is not reached; below this way neither is the highest acceleration.
        if way < 2.0 * acceleration.powi(3) / jerk.powi(2) {
            return 4.0 * (0.5 * way / jerk).cbrt();
        }
        let jerks_s = acceleration / jerk;
        jerks_s + (jerks_s.powi(2) + 4.0 * way / acceleration).sqrt()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_way_takes_what_its_phases_add_up_to() {
        let pace = Pace { speed: 1.0, acceleration: 2.0, jerk: 8.0 };
        // Ramps of 0.25 s of jerk, 0.25 s of acceleration, 0.25 s of jerk cover 0.375 rad each, and 0.25 rad are left.
        assert!((pace.duration_s(1.0) - 1.75).abs() < 1e-12, "{}", pace.duration_s(1.0));
        // Four phases of jerk: 2 j t³.
        assert!((pace.duration_s(2.0 * 8.0 * 0.1_f64.powi(3)) - 0.4).abs() < 1e-12);
        let without_jerk = Pace { jerk: f64::INFINITY, ..pace };
        assert!(
            (without_jerk.duration_s(1.0) - 1.5).abs() < 1e-12 && (without_jerk.duration_s(0.125) - 0.5).abs() < 1e-12
        );
        assert_eq!((pace.duration_s(0.0), without_jerk.duration_s(0.0)), (0.0, 0.0));
    }

    #[test]
    fn slower_time_stretches_every_motion_alike() {
        let pace = Pace { speed: 5.4, acceleration: 1.7, jerk: 1.4 };
        for way in [1e-4, 0.1, 1.0, 3.0, 20.0, 100.0] {
            let ratio = pace.slower(0.25).duration_s(way) / pace.duration_s(way);
            assert!((ratio - 4.0).abs() < 1e-9, "{ratio} over {way}");
        }
    }
}
