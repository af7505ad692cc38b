//! The Handeye Workbench: a window and a command line over [`handeye_core`] and [`handeye_sim_link`].
#![cfg_attr(not(test), warn(clippy::print_stdout, clippy::print_stderr))]

pub mod app;
pub mod capture;
pub mod cli;
pub mod command;
pub mod depth_view;
pub mod gui;
pub mod limits;
pub mod model;
pub mod observe;
pub mod rerun_log;
mod scene;
pub mod session_start;
pub mod settings;
mod shortfall;
pub mod text;
pub mod truth;
pub mod worker;

pub use handeye_core::text;
