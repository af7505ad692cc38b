//! server of the cell.
