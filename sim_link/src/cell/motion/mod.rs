//! motion of the cell.
