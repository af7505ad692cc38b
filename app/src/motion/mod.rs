//! Moving the arm: goals, jogging, and what refuses or ends a motion.

pub(crate) mod desk;
pub(crate) mod grip;
pub(crate) mod jog_line;
pub(crate) mod live;
pub(crate) mod pane;
pub(crate) mod state;
pub(crate) mod update;
pub(crate) mod worker;
