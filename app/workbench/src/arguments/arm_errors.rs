//! `--arm-errors`: errors of the built-in cell's arm.

use clap::ValueEnum;
use handeye_cell::scene::ArmErrorsSpec;

/// Errors of an arm's links, by name.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum ArmErrorsChoice {
    /// As those of a usual arm without a calibration of its own
    Nominal,
    /// Not at all
    None,
}

impl ArmErrorsChoice {
    /// Their names.
    pub const NAMES: [&str; 2] = ["nominal", "none"];

    /// The levels that they are drawn from.
    pub fn levels(self) -> ArmErrorsSpec {
        match self {
            Self::Nominal => ArmErrorsSpec::NOMINAL,
            Self::None => ArmErrorsSpec::NONE,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_choice_has_its_name() {
        let names = ArmErrorsChoice::value_variants().iter().filter_map(ArmErrorsChoice::to_possible_value);
        assert!(names.map(|name| name.get_name().to_owned()).eq(ArmErrorsChoice::NAMES));
    }
}
