//! A document with what was done to it: undo and redo.

use std::collections::{BTreeMap, VecDeque};
use std::sync::Arc;

use super::capture_id::CaptureId;
use super::document::{CaptureRecord, Document};
use super::edit::Edit;
use super::edit_error::EditError;

/// Number of changes that can be undone. More than a user needs, and a few megabytes with a hundred captures.
///
/// It may be raised and never lowered: a journal may hold as many undos in a row.
pub const UNDO_STEPS: usize = 200;

/// A document, what can be undone and what can be redone. Two histories to which the same was done are equal.
#[derive(Debug, Clone, PartialEq)]
pub struct History {
    document: Arc<Document>,
    /// Oldest first; each with the document before it.
    past: VecDeque<Step>,
    /// The next redo last; each with the document after it.
    future: Vec<Step>,
    /// The largest capture number so far, also of captures that are gone.
    last_capture: CaptureId,
}

#[derive(Debug, Clone, PartialEq)]
struct Step {
    edit: Arc<Edit>,
    other: Arc<Document>,
}

impl History {
    /// A document to which nothing was done yet.
    pub fn new(document: Document) -> Self {
        let last_capture = document.captures.iter().map(|capture| capture.id).max().unwrap_or(CaptureId(0));
        Self { document: Arc::new(document), past: VecDeque::new(), future: Vec::new(), last_capture }
    }

    /// The same with the numbers up to `last` used by captures that are gone.
    pub(super) fn with_numbers_used(mut self, last: CaptureId) -> Self {
        self.last_capture = self.last_capture.max(last);
        self
    }

    /// The document as it is now.
    pub fn document(&self) -> &Arc<Document> {
        &self.document
    }

    /// The number for the next capture.
    ///
    /// # Errors
    /// [`EditError::NoNumberLeft`].
    pub fn next_capture_id(&self) -> Result<CaptureId, EditError> {
        self.last_capture.0.checked_add(1).map(CaptureId).ok_or(EditError::NoNumberLeft)
    }

    pub(super) fn last_capture(&self) -> CaptureId {
        self.last_capture
    }

    /// Changes the document; what was undone before can no longer be redone.
    ///
    /// # Errors
    /// As [`Document::apply`]; [`EditError::UsedNumber`] also for the id of a removed capture. Nothing changes then.
    pub fn apply(&mut self, edit: Edit) -> Result<(), EditError> {
        if let Edit::AddCapture(record) = &edit
            && record.id <= self.last_capture
        {
            return Err(EditError::UsedNumber(record.id));
        }
        let after = Arc::new(self.document.apply(&edit)?);
        if let Edit::AddCapture(record) = &edit {
            self.last_capture = record.id;
        }
        let before = std::mem::replace(&mut self.document, after);
        self.past.push_back(Step { edit: Arc::new(edit), other: before });
        if self.past.len() > UNDO_STEPS {
            self.past.pop_front();
        }
        self.future.clear();
        Ok(())
    }

    /// Takes the last change back.
    ///
    /// # Errors
    /// [`EditError::NothingToUndo`].
    pub fn undo(&mut self) -> Result<(), EditError> {
        let Step { edit, other: before } = self.past.pop_back().ok_or(EditError::NothingToUndo)?;
        let after = std::mem::replace(&mut self.document, before);
        self.future.push(Step { edit, other: after });
        Ok(())
    }

    /// Makes the change again that was undone last.
    ///
    /// # Errors
    /// [`EditError::NothingToRedo`].
    pub fn redo(&mut self) -> Result<(), EditError> {
        let Step { edit, other: after } = self.future.pop().ok_or(EditError::NothingToRedo)?;
        let before = std::mem::replace(&mut self.document, after);
        self.past.push_back(Step { edit, other: before });
        Ok(())
    }

    /// The change that [`Self::undo`] would undo.
    pub fn undo_edit(&self) -> Option<&Edit> {
        self.past.back().map(|step| &*step.edit)
    }

    /// The change that [`Self::redo`] would redo.
    pub fn redo_edit(&self) -> Option<&Edit> {
        self.future.last().map(|step| &*step.edit)
    }

    /// Every capture that the document has now, or has after undos or redos.
    pub(super) fn reachable_captures(&self) -> BTreeMap<CaptureId, &CaptureRecord> {
        let steps = self.past.iter().chain(&self.future).map(|step| &step.other);
        steps.chain([&self.document]).flat_map(|document| &document.captures).map(|c| (c.id, c)).collect()
    }
}

#[cfg(test)]
#[path = "history_tests.rs"]
mod tests;
