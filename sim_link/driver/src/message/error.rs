//! What is wrong with a message.

use std::fmt;

use super::PROTOCOL;
use super::hello::Ability;

/// What is wrong with a message of a driver. The reader adds the number of the line.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error, handeye_wording::Localized)]
#[non_exhaustive]
pub enum BadMessage {
    /// Nothing between two ends of lines.
    #[error("an empty line: each line is one message")]
    Empty,
    /// Text for people.
    #[error("not a message: standard output is for JSON messages alone, print to standard error")]
    Chatter,
    /// Begins like a message but is not valid JSON.
    #[error("not JSON: {why}")]
    NotJson {
        /// The error of the parser.
        why: String,
    },
    /// A field is missing or of another kind.
    #[error("{kind}: {why}")]
    Field {
        /// Type of the message.
        kind: String,
        /// The error of the parser.
        why: String,
    },
    /// A field has a value that it cannot have.
    #[error("{field}: {why}")]
    Value {
        /// The field of the message.
        field: &'static str,
        /// What is wrong with it.
        why: String,
    },
    /// A transform is invalid.
    #[error("{field}: {why}")]
    Pose {
        /// The field of the message.
        field: &'static str,
        /// What is wrong with it.
        why: String,
    },
    /// The number of bytes does not match size and encoding.
    #[error("bytes: {got}, where width, height and encoding make {need}")]
    Length {
        /// As stated in the message.
        got: u64,
        /// As computed from size and encoding.
        need: u64,
    },
    /// Another version of the protocol.
    #[error("protocol: {got}, this workbench speaks {PROTOCOL}")]
    Protocol {
        /// The driver's version.
        got: u32,
    },
    /// An ability without what it requires.
    #[error("can: {ability} needs {needs}")]
    Needs {
        /// The ability that the driver reports.
        ability: Ability,
        /// What is missing.
        needs: &'static str,
    },
}

impl BadMessage {
    pub(crate) fn value(field: &'static str, why: impl fmt::Display) -> Self {
        Self::Value { field, why: why.to_string() }
    }
}
