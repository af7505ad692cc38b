//! Recordings of other tools become data sets and sessions.

pub(crate) mod dialog;
