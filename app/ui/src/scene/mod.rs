//! Where everything is in the cell: one list of items, from which the 3D pane is painted and the recording is written.

pub(crate) mod pane;
