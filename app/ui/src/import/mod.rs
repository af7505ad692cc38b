//! Other people's recordings become data sets and sessions.

pub(crate) mod dialog;
