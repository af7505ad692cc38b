//! The window: collects what happened, draws the panes, applies what the user wants.

use std::time::Duration;

use egui::Ui;

use super::app::App;
use super::panes;
use super::textures::LiveTextures;
use super::theme;
use crate::command::Outbox;
use crate::model::{ThemeChoice, ViewSettings};

/// Redraws at least this often, because ages and durations are shown.
const CLOCK_PERIOD: Duration = Duration::from_millis(250);

/// Key of the settings in eframe's storage.
const SETTINGS_KEY: &str = "view";

/// Application and graphics.
pub struct Window {
    app: App,
    textures: LiveTextures,
    theme: Option<ThemeChoice>,
    outbox: Outbox,
}

impl Window {
    /// For an application.
    pub fn new(app: App, ctx: &egui::Context) -> Self {
        theme::install(ctx);
        Self { app, textures: LiveTextures::default(), theme: None, outbox: Outbox::default() }
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

    /// Draws everything and applies what the user asked for.
    pub fn window_ui(&mut self, ui: &mut Ui) {
        let Self { app, textures, outbox, .. } = self;
        textures.update(ui.ctx(), app.model());
        panes::all_ui(ui, app.model(), textures, outbox);
        if outbox.is_empty() {
            ui.request_repaint_after(CLOCK_PERIOD);
        } else {
            app.apply_all(outbox);
            ui.request_repaint();
        }
    }

    /// The application.
    #[cfg(test)]
    pub fn app(&mut self) -> &mut App {
        &mut self.app
    }

    /// How many frames went to the graphics card.
    #[cfg(test)]
    pub fn uploads(&self) -> u64 {
        self.textures.uploads()
    }
}

impl eframe::App for Window {
    fn logic(&mut self, ctx: &egui::Context, _frame: &mut eframe::Frame) {
        self.collect(ctx);
    }

    fn ui(&mut self, ui: &mut Ui, _frame: &mut eframe::Frame) {
        self.window_ui(ui);
    }

    fn save(&mut self, storage: &mut dyn eframe::Storage) {
        eframe::set_value(storage, SETTINGS_KEY, &self.app.model().view);
    }
}

/// The settings of the last time; defaults when there are none that can be read.
pub fn stored_settings(storage: Option<&dyn eframe::Storage>) -> ViewSettings {
    storage.and_then(|storage| eframe::get_value(storage, SETTINGS_KEY)).unwrap_or_default()
}

#[cfg(test)]
#[path = "window_tests.rs"]
mod tests;
