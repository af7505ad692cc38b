//! What the bars say about the session. The only place where they look at it.

use crate::model::Model;
use crate::text::Text;

/// The session in a few words.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct SessionFacts {
    /// Its name; `None` before there is anything to keep.
    pub name: Option<String>,
    /// Whether all of it is on the disk.
    pub saved: bool,
    /// What undo would take back.
    pub undo: Option<Text>,
    /// What redo would make again.
    pub redo: Option<Text>,
}

/// What the model says.
pub fn of(_model: &Model) -> SessionFacts {
    SessionFacts::default()
}
