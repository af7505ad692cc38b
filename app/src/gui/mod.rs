//! The window of the workbench.
//!
//! Data flows in one direction: workers report events, [`App`] changes the model, panes draw the model and return
//! commands, which [`App`] applies after the frame. A pane is a function `…_ui` without I/O, locks, sleeps or solves.

mod actions;
mod args;
mod arrival;
mod dialogs;
mod help;
mod palette;
pub(crate) mod shell;
mod signals;
#[cfg(test)]
mod snapshot_tests;
pub(crate) mod status;
mod steps;
pub mod style;
#[cfg(test)]
pub(crate) mod testing;
mod widget_list;
mod window;

pub use args::GuiArgs;
use std::sync::Arc;
use std::time::{Duration, Instant};

use anyhow::anyhow;
use eframe::NativeOptions;
use egui::ViewportBuilder;
use handeye_core::plan::Surroundings;

use crate::app::{App, Connect, Start};
use crate::command::Event;
pub use crate::gui::shell::layout::Layout;
use crate::model::{CellSource, Drivers};
use crate::rerun_log::RerunChoice;
use crate::settings::{self, SettingsFile};
use crate::worker::{Clock, Waker};
use signals::Signals;
use window::Remembered;
pub use window::Window;

/// What the workers report within this time is drawn at once: an image and the board in it, the robot's state.
const GATHER: Duration = Duration::from_millis(20);

/// Name of the file of boxes beside the settings.
const KEEP_OUT_FILE: &str = "keep_out.toml";

/// Opens the window and returns when it is closed, by a person or by a signal that asks for the end.
///
/// # Errors
/// When no window can be opened, most likely because there is no screen.
pub fn run(args: GuiArgs) -> anyhow::Result<()> {
    let variable = |name: &str| std::env::var(name).ok();
    let (file, settings, warnings) = SettingsFile::open(settings::default_path(), variable);
    let drivers = Drivers { robot: args.driver, camera: args.camera_driver };
    let source = match args.connect {
        Some(address) => CellSource::Address(address),
        None if drivers != Drivers::default() => CellSource::Drivers(drivers),
        None => settings.source(),
    };
    let objects = args.objects.paths(settings.objects.clone());
    let file = file.with_objects(&objects);
    if let Some(file) = &args.keep_out {
        // A window that moves the arm without them would be worse than none.
        Surroundings::read(file)?;
    }
    let options = NativeOptions {
        viewport: ViewportBuilder::default()
            .with_app_id(settings::FOLDER)
            .with_title("Handeye Workbench")
            .with_inner_size([1440.0, 900.0])
            .with_min_inner_size([1024.0, 700.0]),
        // There are no gradients to smooth, and without a graphics card every pixel would cost more.
        dithering: false,
        ..NativeOptions::default()
    };
    let signals = Signals::listen();
    let open = move |creation: &eframe::CreationContext<'_>| {
        signals.wakes(&creation.egui_ctx);
        let ctx = creation.egui_ctx.clone();
        let waker: Waker = Arc::new(move || ctx.request_repaint_after(GATHER));
        let started = Instant::now();
        let clock: Clock = Arc::new(move || started.elapsed().as_secs_f64());
        let connect: Connect = Arc::new(crate::connect::connector);
        let remembered = Remembered::stored(creation.storage);
        let start = Start {
            source,
            view: remembered.view(settings.view()),
            addresses: settings.addresses.clone(),
            drivers: settings.drivers.clone(),
            objects,
            keep_out: args.keep_out.or_else(|| settings::default_path().map(|path| path.with_file_name(KEEP_OUT_FILE))),
            sessions: settings.sessions_folder(),
            open: args.session,
            rerun: args.rerun.choice(RerunChoice::Record),
        };
        let mut app = App::start(start, connect, clock, waker)?;
        app.absorb(Event::Recent(remembered.recent));
        for warning in warnings {
            app.absorb(warning.into());
        }
        if let Some(file) = variable(widget_list::VARIABLE) {
            creation.egui_ctx.add_plugin(widget_list::WidgetList::new(file.into()));
        }
        let layout = stored_layout(creation.storage);
        let window = Window::new(app, layout, file, &creation.egui_ctx).that_heeds(signals);
        Ok(Box::new(window) as Box<dyn eframe::App>)
    };
    // Layout and size of the window are kept in a folder of that name.
    eframe::run_native(settings::FOLDER, options, Box::new(open)).map_err(|error| {
        anyhow!("cannot open a window: {error}; without a screen use the subcommands, see `handeye --help`")
    })
}

/// The layout of the last time; the first one when there is none that can be read.
fn stored_layout(storage: Option<&dyn eframe::Storage>) -> Layout {
    storage
        .and_then(|storage| eframe::get_value::<Layout>(storage, crate::gui::shell::layout::STORAGE_KEY))
        .map_or_else(Layout::default, Layout::brought_up_to_date)
}
