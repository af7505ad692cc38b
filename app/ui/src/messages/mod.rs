//! What the program says: log, toasts, the banner.

pub(crate) mod banner;
pub(crate) mod pane;
pub(crate) mod toasts;
