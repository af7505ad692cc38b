//! What no session resolves: the one floor below which nothing is a finding, an outlier or a failed verification.
//!
//! Simulated sessions may be exact. What is left in them is the rounding of grey levels, how a renderer draws an edge, and the
//! rounding of numbers. It is not Gaussian noise, views and corners share it, and tests whose noise levels are estimated from the
//! data take it for a fault, because there is no other noise. So all tests use noise levels that are at least those of the best
//! robots and cameras, and what is smaller than they resolve is not reported. The estimate, its weights and its stated error do
//! not use this floor.
//!
//! Derivation: `docs/maths/resolution.md`.

use crate::handeye::joint::Noise;
pub(crate) use handeye_pairs::pose_graph::{ANGLE_RAD, PLACE_M};
use handeye_wording::text;
use handeye_wording::{Value, shown};

/// Error that all corners of a view may share, pixels: half a grey level over a contrast of 160, which is how far an edge moves
/// when all its pixels are rounded alike. A larger value would hide what sharp images of 0.03 px show about a lens.
pub(crate) const CORNER_PX: f64 = 0.003;
/// A distance of a corner, or the RMS of a view, that is as good as images get, pixels: the detector's own errors are at most
/// 0.03 px in images without noise, and 0.04 px RMS with ten grey levels of it.
pub(crate) const FINE_PX: f64 = 0.05;
/// A depth of the target's plane that no depth camera resolves, metres: a third of the depth error of a disparity known to a
/// hundredth of a pixel (0.03 mm half a metre away, base line 75 mm, 1000 px), and as much as a robot resolves.
pub(crate) const DEPTH_M: f64 = 1e-5;

/// Whether a displacement is one that a robot resolves, by its length \[m\] or its angle \[rad\].
pub(crate) fn is_resolved(metres: f64, radians: f64) -> bool {
    metres >= PLACE_M || radians >= ANGLE_RAD
}

/// A length \[m\] of the robot in words: one that no robot resolves is given as below the resolution.
pub fn place_text(metres: f64) -> Value {
    reported(metres, PLACE_M, &|m| format!("{} mm", shown(m * 1e3, 3)))
}

/// The same for an angle \[rad\].
pub fn angle_text(radians: f64) -> Value {
    reported(radians, ANGLE_RAD, &|rad| format!("{}°", shown(rad.to_degrees(), 3)))
}

fn reported(value: f64, least: f64, number: &dyn Fn(f64) -> String) -> Value {
    if value < least { text!("below {high}", high = number(least)).into() } else { number(value).into() }
}

/// The noise levels of the robot that views are judged by.
pub(crate) fn judged_by(noise: &Noise) -> Noise {
    Noise { robot_m: noise.robot_m.max(PLACE_M), robot_rad: noise.robot_rad.max(ANGLE_RAD), ..*noise }
}

/// The variance \[px²\] that the pose of a view from this many corners is judged by, `variance (JᵀJ)⁻¹` being its covariance:
/// what corners share does not average out over them.
pub(crate) fn pose_variance_px2(variance_px2: f64, corners: usize) -> f64 {
    variance_px2.max(corners as f64 * CORNER_PX * CORNER_PX)
}

#[cfg(test)]
mod tests {
    use super::*;
    use handeye_wording::English;

    #[test]
    fn the_noise_of_a_real_session_is_judged_as_it_is_and_none_as_the_least() {
        let real = Noise { corner_px: 0.1, robot_m: 1e-4, robot_rad: 3.5e-4, ..Noise::EXACT };
        assert_eq!(judged_by(&real), real);
        assert_eq!(pose_variance_px2(0.01, 70), 0.01);
        let least = judged_by(&Noise::EXACT);
        assert_eq!((least.robot_m, least.robot_rad), (PLACE_M, ANGLE_RAD));
        // That shift of every corner is one standard deviation of the pose, however many there are.
        assert!((pose_variance_px2(0.0, 70) - 70.0 * 9e-6).abs() < 1e-15);
        assert!(!is_resolved(9e-6, 1.7e-5) && is_resolved(1e-5, 0.0) && is_resolved(0.0, 1.8e-5));
    }

    #[test]
    fn what_no_robot_resolves_is_said_to_be_below_that_and_not_with_its_zeros() {
        let reported = |value: Value| value.in_language(English);
        assert_eq!([reported(place_text(3.96e-4)), reported(angle_text(1e-3))], ["0.396 mm", "0.057°"]);
        assert_eq!([reported(place_text(0.0)), reported(angle_text(1e-9))], ["below 0.010 mm", "below 0.001°"]);
    }
}
