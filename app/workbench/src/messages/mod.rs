//! What the program says: log, toasts, the banner.

pub(crate) mod state;
pub(crate) mod update;
