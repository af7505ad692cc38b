//! The session: the thread that keeps it, its folder, undo and redo.

pub(crate) mod dialog;
