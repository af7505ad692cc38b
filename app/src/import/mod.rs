//! Other people's recordings become data sets and sessions.

pub(crate) mod dialog;
pub mod state;
pub mod understand;
pub(crate) mod update;
pub mod worker;
