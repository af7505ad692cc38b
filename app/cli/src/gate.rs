//! `--gate`: conditions on a result that decide the exit code.

use std::fmt;
use std::str::FromStr;

use handeye_result::{CalibrationResult, Quality};

/// A condition such as `tip_error_95_mm<0.5`.
#[derive(Debug, Clone, PartialEq)]
pub struct Gate {
    number: Number,
    or_equal: bool,
    limit: f64,
}

/// The numbers that a condition may use, by their keys in the result.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Number {
    Rms,
    Sigma,
    HeldOut,
    TipError,
    Reach,
    ReachCorrected,
    RobotPosition,
    RobotOrientation,
}

impl Number {
    const ALL: [Self; 8] = [
        Self::Rms,
        Self::Sigma,
        Self::HeldOut,
        Self::TipError,
        Self::Reach,
        Self::ReachCorrected,
        Self::RobotPosition,
        Self::RobotOrientation,
    ];

    fn key(self) -> &'static str {
        match self {
            Self::Rms => "rms_px",
            Self::Sigma => "sigma_px",
            Self::HeldOut => "heldout_rms_px",
            Self::TipError => "tip_error_95_mm",
            Self::Reach => "reach_error_95_mm",
            Self::ReachCorrected => "reach_error_corrected_95_mm",
            Self::RobotPosition => "robot_sigma_mm",
            Self::RobotOrientation => "robot_sigma_deg",
        }
    }

    fn of(self, quality: &Quality) -> Option<f64> {
        match self {
            Self::Rms => quality.rms_px,
            Self::Sigma => quality.sigma_px,
            Self::HeldOut => quality.heldout_rms_px,
            Self::TipError => quality.tip_error_95_mm,
            Self::Reach => quality.reach_error_95_mm,
            Self::ReachCorrected => quality.reach_error_corrected_95_mm,
            Self::RobotPosition => quality.robot_sigma_mm,
            Self::RobotOrientation => quality.robot_sigma_deg,
        }
    }
}

/// Why a result does not pass its gates; empty when it does, and when there are none. A problem passes no gate: the numbers
/// of an unusable result mean nothing.
pub fn failures(gates: &[Gate], result: &CalibrationResult) -> Vec<String> {
    let problem = result.problem().filter(|_| !gates.is_empty());
    let problem = problem.map(|finding| format!("{} is a problem: {}", finding.code, finding.text));
    problem.into_iter().chain(gates.iter().filter_map(|gate| gate.failure(&result.quality))).collect()
}

impl Gate {
    /// Why a result does not pass; `None` when it does. A number that is not known does not pass.
    fn failure(&self, quality: &Quality) -> Option<String> {
        let key = self.number.key();
        match self.number.of(quality) {
            None => Some(format!("gate {self}: {key} is not known for this result")),
            Some(value) if value < self.limit || (self.or_equal && value == self.limit) => None,
            Some(value) => Some(format!("gate {self}: {key} is {value:.4}")),
        }
    }
}

impl fmt::Display for Gate {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}{}{}", self.number.key(), if self.or_equal { "<=" } else { "<" }, self.limit)
    }
}

impl FromStr for Gate {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let (key, rest) = text.split_once('<').ok_or_else(|| format!("{text:?} has no <: write NAME<LIMIT"))?;
        let (or_equal, limit) = match rest.strip_prefix('=') {
            Some(limit) => (true, limit),
            None => (false, rest),
        };
        let number = Number::ALL.into_iter().find(|number| number.key() == key.trim()).ok_or_else(|| {
            let keys: Vec<&str> = Number::ALL.iter().map(|number| number.key()).collect();
            format!("{:?} is not a number of a result: take one of {}", key.trim(), keys.join(", "))
        })?;
        let limit: f64 = limit.trim().parse().map_err(|_not_a_number| format!("{limit:?} is not a number"))?;
        if !limit.is_finite() {
            return Err(format!("{limit} is no limit"));
        }
        Ok(Self { number, or_equal, limit })
    }
}

#[cfg(test)]
mod tests {
    use handeye_estimate::diagnose::record::FindingRecord;

    use super::*;

    #[test]
    fn a_result_passes_below_its_limit_and_not_when_the_number_is_unknown() {
        let gate: Gate = "tip_error_95_mm<0.5".parse().expect("a gate");
        let with = |error: Option<f64>| Quality { tip_error_95_mm: error, ..Quality::default() };
        assert_eq!(gate.failure(&with(Some(0.49))), None);
        assert_eq!(
            gate.failure(&with(Some(0.5))).as_deref(),
            Some("gate tip_error_95_mm<0.5: tip_error_95_mm is 0.5000")
        );
        assert!(gate.failure(&with(None)).is_some());
        let or_equal: Gate = "tip_error_95_mm <= 0.5".parse().expect("a gate");
        assert_eq!(or_equal.failure(&with(Some(0.5))), None);
    }

    #[test]
    fn a_problem_passes_no_gate_however_good_the_numbers_are() {
        let gate: Gate = "rms_px<1".parse().expect("a gate");
        let finding = |severity: &str| FindingRecord {
            code: "wrong_length_unit".to_owned(),
            severity: severity.to_owned(),
            text: "Millimetres.".to_owned(),
            views: Vec::new(),
            evidence: Vec::new(),
        };
        let mut result = CalibrationResult { findings: vec![finding("warning")], ..CalibrationResult::default() };
        result.quality.rms_px = Some(0.1);
        assert!(failures(std::slice::from_ref(&gate), &result).is_empty());
        result.findings.push(finding("problem"));
        assert_eq!(failures(&[gate], &result), ["wrong_length_unit is a problem: Millimetres."]);
        assert!(failures(&[], &result).is_empty(), "without a gate the findings speak for themselves");
    }

    #[test]
    fn what_is_no_gate_says_why() {
        for bad in ["tip_error_95_mm>0.5", "tip_error<1", "rms_px<one", "rms_px<inf"] {
            assert!(bad.parse::<Gate>().is_err(), "{bad}");
        }
    }
}
