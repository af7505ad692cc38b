//! The error that the goal of a guided session refers to.

use nalgebra::Matrix3;
use statrs::distribution::{ChiSquared, ContinuousCDF as _};

use super::{LEVEL_SURE, worst};
use handeye_estimate::diagnose::{Calibration, Promise, Promised};
use handeye_estimate::handeye::joint::SmallSample;
use handeye_estimate::uncertainty::quality::TipBox;
use handeye_geometry::point_error;

/// The error of an answer to which its goal refers.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct JudgedError {
    /// The stated error.
    pub promised: Promised,
    /// The same at the upper limit of the noise levels, metres.
    pub at_upper_levels_m: f64,
    /// The box in which it holds; `None` for the place where the camera saw the board.
    pub tool_box: Option<TipBox>,
}

impl JudgedError {
    /// The error of an answer, for a goal \[m\]: where the camera saw the board, or at the worst point of a box. `None` where
    /// nothing may be stated.
    pub(crate) fn of(calibration: &Calibration, goal_m: f64, tool_box: Option<&TipBox>) -> Option<Self> {
        let promised = calibration.promised(goal_m, tool_box)?;
        let joint = calibration.joint.as_ref()?;
        if promised.of == Promise::Point {
            let hand_eye = calibration.hand_eye_covariance()?;
            let upper = upper_level(joint.small_sample.degrees_of_freedom);
            let at_upper_levels_m = worst(calibration, tool_box, |point| {
                let covariance = point_error::covariance(hand_eye, point) / joint.small_sample.scale;
                Some(calibration.error_95_m(point)?.max(point_error::radius_95(&covariance) * upper))
            })?;
            return Some(Self { promised, at_upper_levels_m, tool_box: tool_box.copied() });
        }
        // An error by a stated accuracy has no estimated level.
        let (law, known_m) = match promised.of {
            Promise::ReachByAccuracy => (joint.small_sample, promised.least_m),
            _ => (calibration.arm()?.small_sample, 0.0),
        };
        let freedom = law.degrees_of_freedom;
        // The stated error includes that the levels may be larger.
        let law = SmallSample { degrees_of_freedom: freedom, ..SmallSample::KNOWN };
        let stated = law.radius_95(&Matrix3::identity()) / SmallSample::KNOWN.radius_95(&Matrix3::identity());
        let times = (upper_level(freedom) / stated).max(1.0);
        let estimated_m = (promised.error_m.powi(2) - known_m.powi(2)).max(0.0).sqrt();
        Some(Self { promised, at_upper_levels_m: known_m.hypot(estimated_m * times), tool_box: tool_box.copied() })
    }

    /// Ratio by which the part of the error that views lower has to shrink for the goal; `None` where no view gets there.
    pub(crate) fn ratio_to(&self, goal_m: f64) -> Option<f64> {
        let above = |error_m: f64| error_m * error_m - self.promised.least_m * self.promised.least_m;
        let (goal, now) = (above(goal_m), above(self.at_upper_levels_m));
        if now <= goal { Some(1.0) } else { (goal > 0.0).then(|| (goal / now).sqrt()) }
    }
}

/// The upper limit of a noise level over its estimate with this many degrees of freedom.
pub(super) fn upper_level(degrees_of_freedom: f64) -> f64 {
    match ChiSquared::new(degrees_of_freedom) {
        Ok(chi) if degrees_of_freedom.is_finite() => {
            (degrees_of_freedom / chi.inverse_cdf(1.0 - LEVEL_SURE)).max(1.0).sqrt()
        }
        _ => 1.0,
    }
}

#[cfg(test)]
mod tests {
    use handeye_estimate::diagnose::calibrate_with;
    use handeye_estimate::diagnose::findings::FindingOptions;
    use handeye_estimate::handeye::Mode;
    use handeye_estimate::robot_accuracy::RobotAccuracy;
    use handeye_estimate::{Method, Options};
    use handeye_geometry::observations::Noise;
    use handeye_geometry::progress::CancelToken;
    use handeye_simulate::session::{Setup, session};

    use super::*;

    /// A robot of which only the accuracy is known is judged by that, at the board and in a box in front of a camera next
    /// to it.
    #[test]
    fn what_follows_from_a_stated_accuracy_is_no_part_of_what_noise_levels_may_make_larger() {
        let noise = Noise { corner_px: 0.1, robot_m: 2e-5, robot_rad: 1e-4, ..Noise::EXACT };
        for mode in [Mode::EyeInHand, Mode::EyeToHand] {
            let observations = session(&Setup { noise, ..Setup::new(mode, 12, 9) }).observations(false);
            let wanted = FindingOptions::default().with_robot_accuracy(Some(RobotAccuracy::new(0.5, None)));
            let cancel = CancelToken::default();
            let calibration =
                calibrate_with(&observations, Method::Joint, Options::default(), &wanted, &cancel).expect("solves");
            let judged = JudgedError::of(&calibration, 3e-4, None).expect("a reach");
            let Promised { error_m, least_m, of } = judged.promised;
            assert_eq!(of, Promise::ReachByAccuracy, "{mode:?}");
            // The noise levels of twelve views may be larger by less than half, and so may the part of the error that rests
            // on them.
            let [stated, upper] = [error_m, judged.at_upper_levels_m].map(|m| m.powi(2) - least_m.powi(2));
            assert!(stated <= upper * (1.0 + 1e-9) && upper < 2.25 * stated, "{stated} {upper} {judged:?}");
            assert!(least_m > 3e-4 && judged.ratio_to(3e-4).is_none(), "no view gets there: {judged:?}");
            assert_eq!(judged.ratio_to(2.0 * judged.at_upper_levels_m), Some(1.0));
            let seen = calibration.views[0].camera_from_target.expect("seen").translation();
            let around = |half_m: f64| nalgebra::Point3::from(seen.add_scalar(half_m));
            let tool_box = TipBox::in_camera(around(-0.01), around(0.01));
            let in_box = JudgedError::of(&calibration, 3e-4, Some(&tool_box)).expect("in its box").promised;
            let expected = if mode == Mode::EyeToHand { Promise::ReachByAccuracy } else { Promise::Point };
            assert_eq!(in_box.of, expected, "a point of a camera on the arm is in many places");
        }
    }

    #[test]
    fn what_no_view_lowers_is_no_part_of_what_has_to_become_less() {
        let promised = Promised { error_m: 5e-4, least_m: 3e-4, of: Promise::ReachCorrected };
        let judged = JudgedError { promised, at_upper_levels_m: 5e-4, tool_box: None };
        // In addition 0.4 mm, of which a goal of 0.36 mm leaves 0.2.
        let ratio = judged.ratio_to((9e-8_f64 + 4e-8).sqrt()).expect("within reach");
        assert!((ratio - 0.5).abs() < 1e-12, "{ratio}");
        assert_eq!(judged.ratio_to(6e-4), Some(1.0));
        assert_eq!(judged.ratio_to(2e-4), None);
    }
}
