//! Why a change to a session is refused.

use serde::{Deserialize, Serialize};

use super::capture_id::CaptureId;
use handeye_wording::Text;

/// The kind of change of the taught poses.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum TaughtChange {
    /// A pose of this name is new.
    Add(String),
    /// The pose of this name is gone.
    Remove(String),
    /// A pose has another name.
    Rename {
        /// Its name before.
        from: String,
        /// Its name now.
        to: String,
    },
    /// The pose of this name is visited earlier or later.
    Reorder(String),
    /// So many poses came from a file.
    Import(u32),
    /// All poses are others.
    Replace,
}

/// Why a change is refused. The document is then as before.
#[derive(Debug, Clone, PartialEq, thiserror::Error, handeye_wording::Localized)]
#[non_exhaustive]
pub enum EditError {
    /// There is no such capture, or it was removed.
    #[error("capture {0} is not in this session: choose one of the captures in the list")]
    UnknownCapture(CaptureId),
    /// The change names no capture at all.
    #[error("no capture is named: choose at least one")]
    NoCapture,
    /// The number of a new capture was used before.
    #[error("the number {0} was used by another capture of this session: take the next free one")]
    UsedNumber(CaptureId),
    /// All numbers are used.
    #[error("the session has used all capture numbers: begin a new session")]
    NoNumberLeft,
    /// Two taught poses of one name.
    #[error("two taught poses have the name {0:?}: names tell poses apart, so give one of them another")]
    SamePoseName(String),
    /// The stated change of the taught poses does not match the poses.
    #[error("the taught poses do not show what was done to them ({0}): send all poses as they are afterwards")]
    TaughtChange(TaughtChange),
    /// A value that a session must not have.
    #[error("{at}: {what}", at = &**at, what = &**what)]
    Bad {
        // Boxed, as most functions of a session hand this error on.
        /// The value.
        at: Box<Text>,
        /// The error.
        what: Box<Text>,
    },
    /// The document already is as the change would make it; an undo step would show nothing.
    #[error("nothing changes: the session is like this already")]
    NoChange,
    /// There is no change before this one, or it is no longer recorded.
    #[error("there is nothing to undo")]
    NothingToUndo,
    /// The last thing done was not an undo.
    #[error("there is nothing to redo")]
    NothingToRedo,
}

impl EditError {
    /// The error for a value that is not valid in a session.
    pub(super) fn bad(at: Text, what: Text) -> Self {
        Self::Bad { at: Box::new(at), what: Box::new(what) }
    }
}
