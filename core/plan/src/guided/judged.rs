//! The error that the goal of a guided session is asked of.

use nalgebra::Matrix3;
use statrs::distribution::{ChiSquared, ContinuousCDF as _};

use super::{LEVEL_SURE, worst};
use handeye_estimate::diagnose::{Calibration, Promise, Promised};
use handeye_estimate::handeye::joint::SmallSample;
use handeye_estimate::uncertainty::quality::TipBox;
use handeye_geometry::point_error;

/// The error of an answer as its goal is asked of it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct JudgedError {
    /// What is stated.
    pub promised: Promised,
    /// The same at the upper limit of the noise levels, metres.
    pub at_upper_levels_m: f64,
    /// In which box; `None` where the camera saw the board.
    pub tool_box: Option<TipBox>,
}

impl JudgedError {
    /// Of an answer, for a goal \[m\]: where the camera saw the board, or at the worst point of a box. `None` where nothing may be
    /// stated.
    pub fn of(calibration: &Calibration, goal_m: f64, tool_box: Option<&TipBox>) -> Option<Self> {
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
        let freedom = calibration.arm()?.small_sample.degrees_of_freedom;
        // That the levels may be larger is a part of what is stated.
        let law = SmallSample { degrees_of_freedom: freedom, ..SmallSample::KNOWN };
        let stated = law.radius_95(&Matrix3::identity()) / SmallSample::KNOWN.radius_95(&Matrix3::identity());
        let times = (upper_level(freedom) / stated).max(1.0);
        Some(Self { promised, at_upper_levels_m: promised.error_m * times, tool_box: tool_box.copied() })
    }

    /// By which part of what it is now that which views lower has to become for the goal; `None` where no view gets there.
    pub fn ratio_to(&self, goal_m: f64) -> Option<f64> {
        let above = |error_m: f64| error_m * error_m - self.promised.least_m * self.promised.least_m;
        let (goal, now) = (above(goal_m), above(self.at_upper_levels_m));
        if now <= goal { Some(1.0) } else { (goal > 0.0).then(|| (goal / now).sqrt()) }
    }
}

/// The upper limit of a noise level over its estimate from so many numbers.
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
    use super::*;

    #[test]
    fn what_no_view_lowers_is_no_part_of_what_has_to_become_less() {
        let promised = Promised { error_m: 5e-4, least_m: 3e-4, of: Promise::ReachCorrected };
        let judged = JudgedError { promised, at_upper_levels_m: 5e-4, tool_box: None };
        // 0.4 mm beside it, of which a goal of 0.36 mm leaves 0.2.
        let ratio = judged.ratio_to((9e-8_f64 + 4e-8).sqrt()).expect("within reach");
        assert!((ratio - 0.5).abs() < 1e-12, "{ratio}");
        assert_eq!(judged.ratio_to(6e-4), Some(1.0));
        assert_eq!(judged.ratio_to(2e-4), None);
    }
}
