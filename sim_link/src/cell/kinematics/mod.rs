//! kinematics of the cell.
