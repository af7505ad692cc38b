//! Moving the arm: goals, jogging, and what refuses or ends a motion.

pub(crate) mod pane;
