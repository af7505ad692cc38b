//! `--arm-errors`: errors of the built-in cell's arm.

use clap::ValueEnum;
use clap::builder::PossibleValue;
use handeye_cell::scene::ArmErrorsSpec;

/// Errors of an arm's links, by name.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ArmErrorsChoice {
    /// As those of a usual arm without a calibration of its own.
    Nominal,
    /// Not at all.
    None,
}

// Derived, it would describe each value, which changes the layout of the help of all options.
impl ValueEnum for ArmErrorsChoice {
    fn value_variants<'a>() -> &'a [Self] {
        &[Self::Nominal, Self::None]
    }

    fn to_possible_value(&self) -> Option<PossibleValue> {
        let [nominal, none] = Self::NAMES;
        Some(PossibleValue::new(match self {
            Self::Nominal => nominal,
            Self::None => none,
        }))
    }
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
