//! What is wrong with a message.

use std::fmt;

use super::PROTOCOL;
use super::hello::Ability;

/// What is wrong with a message of a driver. Whoever read it adds which line it was.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error, handeye_wording::Localized)]
#[non_exhaustive]
pub enum BadMessage {
    /// Nothing between two ends of lines.
    #[error("an empty line: each line is one message")]
    Empty,
    /// Text for people.
    #[error("not a message: standard output is for JSON messages alone, print to standard error")]
    Chatter,
    /// It begins like a message and is none.
    #[error("not JSON: {why}")]
    NotJson {
        /// What the parser says.
        why: String,
    },
    /// A field is missing or of another kind.
    #[error("{kind}: {why}")]
    Field {
        /// Type of the message.
        kind: String,
        /// What the parser says.
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
    /// A transform is none.
    #[error("{field}: {why}")]
    Pose {
        /// The field of the message.
        field: &'static str,
        /// What is wrong with it.
        why: String,
    },
    /// The number of bytes does not go with size and encoding.
    #[error("bytes: {got}, where width, height and encoding make {need}")]
    Length {
        /// Said.
        got: u64,
        /// From size and encoding.
        need: u64,
    },
    /// Another version of the protocol.
    #[error("protocol: {got}, this workbench speaks {PROTOCOL}")]
    Protocol {
        /// What the driver speaks.
        got: u32,
    },
    /// An ability without what belongs to it.
    #[error("can: {ability} needs {needs}")]
    Needs {
        /// What the driver says that it can.
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
