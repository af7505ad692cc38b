//! scene of the cell.
