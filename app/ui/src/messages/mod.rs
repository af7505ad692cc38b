//! What the program reports: log, toasts, the banner.

pub(crate) mod banner;
pub(crate) mod pane;
pub(crate) mod toasts;
