//! The window of the workbench.
//!
//! Data flows in one direction: workers report events, [`App`](handeye_workbench::app::App) changes the model, panes draw the
//! model and return commands, which it applies after the frame. A pane is a function `…_ui` without I/O, locks, sleeps
//! or solves.

pub mod actions;
mod args;
mod arrival;
mod by_hand;
mod capture;
mod connect;
mod dialogs;
mod export;
#[cfg(feature = "window")]
mod fit;
mod guided;
mod help;
mod import;
mod keep_out;
pub mod live;
mod messages;
mod motion;
pub mod opening;
mod palette;
mod rerun_button;
mod scene;
mod session;
pub(crate) mod shell;
pub mod signals;
#[cfg(test)]
mod small_window_tests;
#[cfg(test)]
mod snapshot_tests;
mod solve;
pub(crate) mod status;
mod steps;
pub mod stop_button;
pub mod style;
mod target;
mod taught;
#[cfg(test)]
pub(crate) mod testing;
mod track;
pub mod typed;
mod verify;
pub(crate) mod waker;
mod widget_list;
pub mod window;

pub use args::GuiArgs;
pub use shell::layout::Layout;
pub use window::Window;

/// Size of the window \[points\].
pub const SIZE: [f32; 2] = [1440.0, 900.0];

/// Below this size panes no longer have room \[points\].
pub const LEAST_SIZE: [f32; 2] = [1024.0, 700.0];

/// Opens the window, after `begin` with its application, and returns when it is closed, by the user or by a signal that requests
/// the end.
///
/// # Errors
/// When `begin` fails, or no window can be opened, most likely because there is no screen.
#[cfg(feature = "window")]
pub fn run(args: GuiArgs, begin: opening::Begin) -> anyhow::Result<()> {
    let opening = opening::Opening::read(args, begin)?;
    let options = eframe::NativeOptions {
        viewport: egui::ViewportBuilder::default()
            .with_app_id(handeye_workbench::settings::FOLDER)
            .with_title("Handeye Workbench")
            .with_inner_size(SIZE)
            .with_min_inner_size(LEAST_SIZE),
        // There are no gradients to smooth, and without a graphics card every pixel would cost more.
        dithering: false,
        ..eframe::NativeOptions::default()
    };
    let signals = signals::Signals::listen();
    let open = move |creation: &eframe::CreationContext<'_>| {
        let (remembered, layout) = window::stored(creation.storage);
        let window = opening.window(&creation.egui_ctx, remembered, layout, None)?.that_heeds(signals);
        Ok(Box::new(window) as Box<dyn eframe::App>)
    };
    // Layout and size of the window are kept in a folder with that name.
    eframe::run_native(handeye_workbench::settings::FOLDER, options, Box::new(open)).map_err(|error| {
        anyhow::anyhow!(
            "cannot open a window: {error}; without a screen use `handeye serve` and a browser, or the subcommands, see \
             `handeye --help`"
        )
    })
}

/// This program was built without a window.
///
/// # Errors
/// Always.
#[cfg(not(feature = "window"))]
pub fn run(_args: GuiArgs, _begin: opening::Begin) -> anyhow::Result<()> {
    anyhow::bail!("this program was built without a window: `handeye serve` shows it in a browser")
}
