//! render of the cell.
