//! The number of a capture.

use std::fmt;

use serde::{Deserialize, Serialize};

/// Names a capture for as long as the session lives: the number in its file name, from 1. It is never used again in
/// the same session, also not after the capture was deleted or its making undone.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(transparent)]
pub struct CaptureId(pub u32);

impl fmt::Display for CaptureId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.fmt(f)
    }
}

handeye_wording::plain_values!(CaptureId);

impl CaptureId {
    /// Stands for a capture without a number while an old session is read.
    pub(super) fn none() -> Self {
        Self(0)
    }
}
