//! Values of a description that have a place in it, and their units.

use serde::Deserialize;
use toml::Spanned;

use crate::error::DatasetProblem;

#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
pub(super) enum AngleUnit {
    #[serde(rename = "rad")]
    Radian,
    #[serde(rename = "deg")]
    Degree,
}

pub(super) type Spanning = (std::ops::Range<usize>, DatasetProblem);

pub(super) fn bad<T: std::fmt::Display>(value: &Spanned<T>, key: &'static str, want: &'static str) -> Spanning {
    (value.span(), DatasetProblem::BadValue { key, value: value.get_ref().to_string(), want })
}
