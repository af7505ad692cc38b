//! The window of the workbench.
//!
//! Data flows in one direction: workers report events, [`App`] changes the model, panes draw the model and return
//! commands, which [`App`] applies after the frame. A pane is a function `…_ui` without I/O, locks, sleeps or solves.

mod app;
#[cfg_attr(not(test), expect(dead_code, reason = "the frame of the window shows them"))]
mod dialogs;
mod numbers;
mod panes;
#[cfg(test)]
mod sample;
mod status;
mod textures;
mod theme;
mod window;

use std::sync::Arc;
use std::time::Instant;

use anyhow::anyhow;
use eframe::NativeOptions;
use egui::ViewportBuilder;

pub use app::App;

use crate::cli::GuiArgs;
use crate::command::Event;
use crate::model::{CellSource, Severity};
use crate::text::Text;
use crate::worker::{Clock, Connector, LiveConnector, Waker};
use window::Window;

/// Name under which the system keeps the window's settings.
const APP_ID: &str = "handeye-workbench";

/// Opens the window and returns when it is closed.
///
/// # Errors
/// When no window can be opened, most likely because there is no screen.
pub fn run(args: GuiArgs) -> anyhow::Result<()> {
    let source = args.connect.map_or(CellSource::BuiltIn, CellSource::Address);
    let options = NativeOptions {
        viewport: ViewportBuilder::default()
            .with_app_id(APP_ID)
            .with_title("Handeye Workbench")
            .with_inner_size([1440.0, 900.0])
            .with_min_inner_size([1024.0, 700.0]),
        ..NativeOptions::default()
    };
    let session = args.session;
    let open = move |creation: &eframe::CreationContext<'_>| {
        let ctx = creation.egui_ctx.clone();
        let waker: Waker = Arc::new(move || ctx.request_repaint());
        let started = Instant::now();
        let clock: Clock = Arc::new(move || started.elapsed().as_secs_f64());
        let connector: Arc<dyn Connector> = Arc::new(LiveConnector::new(source.clone()));
        let view = window::stored_settings(creation.storage);
        let mut app = App::start(source, view, &connector, clock, &waker)?;
        if let Some(session) = session {
            let text = Text::verbatim(format!("sessions are not opened yet: {}", session.display()));
            app.absorb(Event::Notice { severity: Severity::Warning, text });
        }
        Ok(Box::new(Window::new(app, &creation.egui_ctx)) as Box<dyn eframe::App>)
    };
    eframe::run_native(APP_ID, options, Box::new(open)).map_err(|error| {
        anyhow!("cannot open a window: {error}; without a screen use the subcommands, see `handeye --help`")
    })
}
