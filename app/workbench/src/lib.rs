//! The workbench without a window: the model, what may change it, the threads that work for it.
//!
//! Data flows in one direction: workers report events, [`app::App`] changes the model, and whatever shows the model returns
//! commands. Never depends on egui, a screen, Rerun, or a subcommand.

pub mod app;
pub mod arguments;
pub mod by_hand;
pub mod capture;
pub mod command;
pub mod connect;
pub mod export;
pub mod guided;
pub mod import;
pub mod jpeg;
pub mod keep_out;
pub mod live;
pub mod messages;
pub mod model;
pub mod motion;
pub mod observe;
pub mod recording;
pub mod report;
pub mod sample;
pub mod scene;
pub mod session;
pub mod settings;
pub mod shell;
pub mod solve;
pub mod target;
pub mod taught;
#[cfg(feature = "testing")]
pub mod testing;
pub mod text;
pub mod track;
pub mod truth;
pub mod verify;
pub mod worker;

pub use handeye_wording::text;
