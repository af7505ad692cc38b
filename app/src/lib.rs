//! The Handeye Workbench: a window and a command line over the libraries in `core` and `sim_link`.
#![cfg_attr(not(test), warn(clippy::print_stdout, clippy::print_stderr))]

pub mod app;
pub mod by_hand;
pub mod capture;
pub mod cli;
pub mod command;
pub mod connect;
pub mod export;
pub mod gui;
pub mod guided;
mod http;
pub mod import;
mod jpeg;
pub mod keep_out;
pub mod limits;
pub mod live;
pub mod messages;
pub mod model;
pub mod motion;
pub mod observe;
mod report;
pub mod rerun_log;
mod sample;
mod scene;
pub mod serve;
pub mod session;
pub mod settings;
pub mod solve;
pub mod target;
pub mod taught;
pub mod text;
pub mod track;
pub mod truth;
pub mod verify;
pub mod worker;

pub use handeye_wording::text;
