//! Commands and events of messages.

use serde::{Deserialize, Serialize};

use crate::messages::state::Severity;
use crate::text::Text;

/// What the user wants of messages.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "testing", derive(strum::EnumDiscriminants))]
#[cfg_attr(feature = "testing", strum_discriminants(name(CommandKind), derive(PartialOrd, Ord, strum::EnumIter)))]
pub enum Command {
    /// The user has closed a message.
    Dismiss(u64),
}

/// What has happened to messages.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub enum Event {
    /// Something to tell the user.
    Notice {
        /// How much it matters.
        severity: Severity,
        /// The words.
        text: Text,
    },
}
