//! Drivers: which, and a pose typed where no driver reports one.

pub(crate) mod pane;
pub(crate) mod typed_pose;
