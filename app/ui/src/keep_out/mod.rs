//! Boxes that the arm keeps out of, in addition to the obstacles that the cell reports: drawn in the 3D pane, kept in a
//! file.

pub(crate) mod editor;
