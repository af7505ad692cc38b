//! The window: collects what happened, draws the panes, applies what the user wants.

use std::path::Path;
#[cfg(feature = "window")]
use std::sync::Arc;
use std::time::Duration;

use egui::Ui;
use serde::{Deserialize, Serialize};

use super::actions;
use super::arrival::{Arrival, Busy};
use super::dialogs;
use super::palette::CommandPalette;
use super::shell::layout::Layout;
#[cfg(feature = "window")]
use super::shell::layout::STORAGE_KEY;
#[cfg(feature = "window")]
use super::signals::Signals;
use super::style::fonts;
use super::style::theme;
#[cfg(feature = "window")]
use super::typed;
use crate::live::textures::Textures;
use handeye_workbench::app::App;
use handeye_workbench::command::{Command, Outbox};
use handeye_workbench::model::{
    CaptureOptions, Dialog, Goal, JogSettings, Model, Overlays, RecentSession, ThemeChoice, ViewSettings,
};
use handeye_workbench::settings::SettingsFile;
use handeye_workbench::{motion, recording, session, shell};

/// Redraws at least this often, because ages and durations are shown.
const CLOCK_PERIOD: Duration = Duration::from_millis(250);

/// What is remembered from one start to the next in addition to settings and layout.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct Remembered {
    overlays: Overlays,
    jog: JogSettings,
    capture: CaptureOptions,
    goal: Goal,
    /// Sessions that were open, newest first.
    pub recent: Vec<RecentSession>,
}

impl Remembered {
    /// Key in eframe's storage.
    #[cfg(feature = "window")]
    const STORAGE_KEY: &str = "remembered";
    /// Number of sessions that are remembered.
    const SESSIONS: usize = 12;

    fn of(model: &Model) -> Self {
        let ViewSettings { overlays, jog, capture, goal, .. } = model.view;
        let recent = model.recent.iter().take(Self::SESSIONS).cloned().collect();
        Self { overlays, jog, capture, goal, recent }
    }

    /// Settings with the values remembered here.
    pub(crate) fn view(&self, settings: ViewSettings) -> ViewSettings {
        let Self { overlays, jog, capture, goal, recent: _ } = self;
        ViewSettings { overlays: *overlays, jog: *jog, capture: *capture, goal: *goal, ..settings }
    }
}

/// Application, graphics, and what concerns only the window: where panes are, which dialog is open.
pub struct Window {
    app: App,
    textures: Textures,
    theme: Option<ThemeChoice>,
    outbox: Outbox,
    layout: Layout,
    arrival: Arrival,
    palette: CommandPalette,
    settings: SettingsFile,
    /// Whether the system requests the end.
    #[cfg(feature = "window")]
    signals: Option<Arc<Signals>>,
    #[cfg(feature = "window")]
    leaving: bool,
    /// Whether it has been checked that the window fits the screen.
    #[cfg(feature = "window")]
    is_fitted: bool,
}

impl Window {
    /// For an application, with a remembered layout, and with the place where changed settings are written.
    pub fn new(app: App, layout: Layout, settings: SettingsFile, ctx: &egui::Context) -> Self {
        theme::install(ctx);
        Self {
            app,
            textures: Textures::default(),
            theme: None,
            outbox: Outbox::default(),
            layout,
            arrival: Arrival::default(),
            palette: CommandPalette::default(),
            settings,
            #[cfg(feature = "window")]
            signals: None,
            #[cfg(feature = "window")]
            leaving: false,
            #[cfg(feature = "window")]
            is_fitted: false,
        }
    }

    /// Closes when a signal requests it.
    #[cfg(feature = "window")]
    #[must_use]
    pub(crate) fn that_heeds(self, signals: Arc<Signals>) -> Self {
        signals.lead_to(Arc::clone(self.app.stop_line()), Arc::clone(self.app.waker()));
        Self { signals: Some(signals), ..self }
    }

    /// Closes the window if a signal has come; the arm need not wait for the last frames.
    #[cfg(feature = "window")]
    fn heed_signals(&mut self, ctx: &egui::Context) {
        if !self.leaving && self.signals.as_ref().is_some_and(|signals| signals.is_asked()) {
            self.leaving = true;
            self.app.begin_to_leave();
            ctx.send_viewport_cmd(egui::ViewportCommand::Close);
        }
    }

    /// Takes in what happened, while the window may be hidden.
    pub fn collect(&mut self, ctx: &egui::Context) {
        self.app.collect();
        let model = self.app.model();
        if self.theme != Some(model.view.theme) {
            theme::choose(ctx, model.view.theme);
            self.theme = Some(model.view.theme);
        }
    }

    /// Draws everything and applies the user's commands.
    pub fn window_ui(&mut self, ui: &mut Ui) {
        if !fonts::are_there(ui.ctx()) {
            // The very first frame of a test; eframe draws its first frame with the fonts.
            theme::install(ui.ctx());
            ui.request_repaint();
            return;
        }
        self.keyboard(ui.ctx());
        self.dropped(ui.ctx());
        self.arrive(ui.ctx());
        let Self { app, textures, outbox, layout, arrival, palette, .. } = self;
        let model = app.model();
        textures.live.update(ui.ctx(), model);
        let in_front = layout.in_front();
        crate::shell::all_ui(ui, model, textures, layout, outbox);
        if layout.in_front() != in_front {
            arrival.chosen();
        }
        dialogs::dialogs_ui(ui.ctx(), model, outbox);
        if model.dialog == Some(Dialog::Palette) {
            palette.palette_ui(ui.ctx(), model, outbox);
        }
        if outbox.is_empty() {
            ui.request_repaint_after(CLOCK_PERIOD);
        } else {
            self.apply_all(ui.ctx());
            ui.request_repaint();
        }
    }

    /// Esc stops the arm whatever else is going on. Only if there was nothing to stop, it closes what is open: closing a
    /// menu must not end a sequence unnoticed, and a user who stops an arm does not look at menus.
    fn keyboard(&mut self, ctx: &egui::Context) {
        if ctx.input(|input| input.key_pressed(actions::STOP_KEY)) {
            self.outbox.send(motion::Command::Stop);
            if self.app.model().is_under_way() {
                let stops = |event: &egui::Event| matches!(event, egui::Event::Key { key: actions::STOP_KEY, .. });
                ctx.input_mut(|input| input.events.retain(|event| !stops(event)));
            } else if self.app.model().dialog.is_some() {
                self.outbox.send(shell::Command::SetDialog(None));
            }
        }
        if self.app.model().dialog.is_none() {
            for command in actions::pressed(ctx, self.app.model()) {
                self.outbox.send(command);
            }
        }
    }

    /// Shows the result of a sequence, unless the user is busy elsewhere.
    fn arrive(&mut self, ctx: &egui::Context) {
        let model = self.app.model();
        let busy = Busy {
            elsewhere: ctx.text_edit_focused() || model.dialog.is_some(),
            pointing: ctx.input(|input| input.pointer.any_down()),
        };
        if let Some(step) = self.arrival.look(model, busy) {
            self.layout.arrive_at(step);
        }
    }

    /// A session or a data set that is dropped on the window is opened.
    fn dropped(&mut self, ctx: &egui::Context) {
        let dropped = ctx.input(|input| input.raw.dropped_files.last().map(|file| file.path().to_path_buf()));
        if let Some(folder) = dropped {
            self.outbox.send(session::Command::Open(folder));
        }
    }

    fn apply_all(&mut self, ctx: &egui::Context) {
        let commands: Vec<_> = self.outbox.drain().collect();
        for (command, place) in commands {
            tracing::trace!(?command, %place, "command");
            match command {
                // A browser runs on another machine than the file manager.
                Command::Session(session::Command::OpenFolder(folder)) if self.app.model().in_browser => {
                    ctx.open_url(download(&folder));
                }
                Command::Recording(recording::Command::OpenRerun) if self.app.model().in_browser => {
                    ctx.open_url(egui::OpenUrl::new_tab(handeye_workbench::recording::BROWSER_PATH));
                    self.apply(recording::Command::OpenRerun);
                }
                command => self.apply(command),
            }
        }
        let model = self.app.model();
        if let Some(settings) = self.settings.keep(model.view, &model.addresses, &model.drivers, &model.objects) {
            self.app.write_settings(settings);
        }
    }

    /// Handles what concerns the window; the rest is passed to the application.
    pub(super) fn apply(&mut self, command: impl Into<Command>) {
        let command = command.into();
        match command {
            Command::Shell(shell::Command::GoToStep(step)) => {
                self.arrival.chosen();
                self.layout.go_to(step);
                self.app.apply(command);
            }
            Command::Shell(shell::Command::ShowPane(pane)) => {
                self.arrival.chosen();
                self.layout.show(pane);
            }
            Command::Shell(shell::Command::ResetLayout) => self.layout = Layout::default(),
            Command::Shell(shell::Command::SetDialog(_)) => {
                self.palette = CommandPalette::default();
                self.app.apply(command);
            }
            command => self.app.apply(command),
        }
    }

    /// What the next start uses.
    pub fn remembered(&self) -> (Remembered, Layout) {
        (Remembered::of(self.app.model()), self.layout.clone())
    }

    /// The application.
    pub fn app_mut(&mut self) -> &mut App {
        &mut self.app
    }

    /// The application.
    #[cfg(test)]
    pub(crate) fn app(&mut self) -> &mut App {
        &mut self.app
    }

    /// Where the panes are.
    #[cfg(test)]
    pub(crate) fn layout(&mut self) -> &mut Layout {
        &mut self.layout
    }

    /// How many frames went to the graphics card.
    #[cfg(test)]
    pub(crate) fn uploads(&self) -> u64 {
        self.textures.live.uploads()
    }
}

/// The address under which a browser downloads a folder as an archive.
fn download(folder: &Path) -> egui::OpenUrl {
    let folder =
        percent_encoding::percent_encode(folder.as_os_str().as_encoded_bytes(), percent_encoding::NON_ALPHANUMERIC);
    egui::OpenUrl::new_tab(format!("/download?folder={folder}"))
}

#[cfg(feature = "window")]
impl eframe::App for Window {
    fn raw_input_hook(&mut self, _ctx: &egui::Context, input: &mut egui::RawInput) {
        typed::bound(input);
    }

    fn logic(&mut self, ctx: &egui::Context, _frame: &mut eframe::Frame) {
        self.heed_signals(ctx);
        self.collect(ctx);
    }

    fn ui(&mut self, ui: &mut Ui, _frame: &mut eframe::Frame) {
        self.is_fitted = self.is_fitted || super::fit::fit(ui.ctx());
        self.window_ui(ui);
    }

    fn save(&mut self, storage: &mut dyn eframe::Storage) {
        let (remembered, layout) = self.remembered();
        eframe::set_value(storage, STORAGE_KEY, &layout);
        eframe::set_value(storage, Remembered::STORAGE_KEY, &remembered);
    }
}

/// As stored at the end of the last run; the initial layout and the defaults if that cannot be read.
#[cfg(feature = "window")]
pub fn stored(storage: Option<&dyn eframe::Storage>) -> (Remembered, Layout) {
    let Some(storage) = storage else { return Default::default() };
    let layout = eframe::get_value::<Layout>(storage, STORAGE_KEY);
    (
        eframe::get_value(storage, Remembered::STORAGE_KEY).unwrap_or_default(),
        layout.map_or_else(Layout::default, Layout::brought_up_to_date),
    )
}

#[cfg(test)]
#[path = "window_tests.rs"]
mod tests;
