//! What a window is opened with, on the desktop and for a browser: command line, settings, and the state of the last
//! one.

use std::sync::Arc;
use std::time::Instant;

use handeye_coppeliasim::cell::CellPaths;
use handeye_plan::Surroundings;

use super::shell::layout::Layout;
use super::waker::waker_of;
use super::window::{Remembered, Window};
use super::{GuiArgs, widget_list};
use handeye_workbench::app::{App, Connect, InBrowser, Start};
use handeye_workbench::arguments::ArmErrorsChoice;
use handeye_workbench::model::{CellSource, Drivers};
use handeye_workbench::settings::{self, Settings, SettingsFile, Warning};
use handeye_workbench::worker::Clock;
use handeye_workbench::{messages, session};

/// Name of the file of boxes next to the settings.
const KEEP_OUT_FILE: &str = "keep_out.toml";

/// Everything that is known before there is a window.
pub struct Opening {
    args: GuiArgs,
    file: SettingsFile,
    settings: Settings,
    warnings: Vec<Warning>,
    source: CellSource,
    objects: CellPaths,
    begin: Begin,
}

/// What is done with the application before anything happens in it, such as starting a recording.
pub type Begin = Box<dyn FnOnce(&mut App) -> anyhow::Result<()>>;

impl Opening {
    /// Reads the settings; what cannot be read there is reported in the window.
    ///
    /// # Errors
    /// When the keep-out file or the requested scene exists and cannot be read.
    pub fn read(args: GuiArgs, begin: Begin) -> anyhow::Result<Self> {
        let (file, settings, warnings) = SettingsFile::open(settings::default_path(), variable);
        let drivers = Drivers { robot: args.driver.clone(), camera: args.camera_driver.clone() };
        let source = match (&args.connect, &args.scene) {
            (Some(address), _) => CellSource::Address(address.clone()),
            (None, Some(scene)) => CellSource::BuiltIn(scene.clone()),
            (None, None) if drivers != Drivers::default() => CellSource::Drivers(drivers),
            (None, None) if args.arm_errors.is_some() => settings.built_in(),
            (None, None) => settings.source(),
        };
        if let Some(scene) = &args.scene {
            scene.load()?;
        }
        let objects = args.objects.paths(settings.objects.clone());
        let file = file.with_objects(&objects);
        if let Some(file) = &args.keep_out {
            // A window that moves the arm without them would be worse than no window.
            Surroundings::read(file)?;
        }
        Ok(Self { args, file, settings, warnings, source, objects, begin })
    }

    /// The session to open, from the command line.
    pub fn session(&self) -> Option<&std::path::Path> {
        self.args.session.as_deref()
    }

    /// Drivers that the command line or the settings name.
    pub fn drivers(&self) -> Vec<Drivers> {
        let asked = match &self.source {
            CellSource::Drivers(drivers) => Some(drivers.clone()),
            _ => None,
        };
        self.settings.drivers.iter().cloned().chain(asked).collect()
    }

    /// The folder of sessions.
    pub fn sessions(&self) -> std::path::PathBuf {
        self.settings.sessions_folder()
    }

    /// Starts the workers and puts a window over them.
    ///
    /// # Errors
    /// When a thread cannot be started, or `begin` fails.
    pub fn window(
        self,
        ctx: &egui::Context,
        remembered: Remembered,
        layout: Layout,
        in_browser: Option<InBrowser>,
    ) -> anyhow::Result<Window> {
        let Self { args, file, settings, warnings, source, objects, begin } = self;
        let waker = waker_of(ctx)?;
        let started = Instant::now();
        let clock: Clock = Arc::new(move || started.elapsed().as_secs_f64());
        let arm_errors = args.arm_errors.map(ArmErrorsChoice::levels);
        let connect: Connect = Arc::new(move |source, objects| source.cell_with(objects, arm_errors));
        let start = Start {
            source,
            view: remembered.view(settings.view()),
            addresses: settings.addresses.clone(),
            drivers: settings.drivers.clone(),
            objects,
            keep_out: args.keep_out.or_else(|| settings::default_path().map(|path| path.with_file_name(KEEP_OUT_FILE))),
            sessions: settings.sessions_folder(),
            open: args.session,
            in_browser,
        };
        let mut app = App::start(start, connect, clock, waker)?;
        begin(&mut app)?;
        app.absorb(session::Event::Recent(remembered.recent));
        for warning in warnings {
            app.absorb(messages::Event::from(warning));
        }
        if let Some(file) = variable(widget_list::VARIABLE) {
            ctx.add_plugin(widget_list::WidgetList::new(file.into()));
        }
        Ok(Window::new(app, layout, file, ctx))
    }
}

fn variable(name: &str) -> Option<String> {
    std::env::var(name).ok()
}
