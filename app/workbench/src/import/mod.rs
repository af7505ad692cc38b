//! Other people's recordings become data sets and sessions.

pub mod state;
pub mod understand;
pub(crate) mod update;
pub mod worker;
