//! A pane alone on the screen, over a model that the test makes: what it shows, and which commands it sends.

use egui::{Ui, Vec2};
use egui_kittest::Harness;
use egui_kittest::kittest::Queryable as _;

use crate::live::textures::Textures;
use crate::style::theme;
use handeye_workbench::command::{Command, Outbox};
use handeye_workbench::model::{ImagePoint, Model};

/// What a pane is drawn from, and its output.
pub(crate) struct PaneState {
    /// What it shows.
    pub model: Model,
    /// What the user wants.
    pub outbox: Outbox,
    /// The images.
    pub textures: Textures,
    /// The pixel under the pointer, of panes that give one.
    pub pointed: Option<ImagePoint>,
}

/// As long as a frame on a usual screen, so that two clicks can be a double click \[s\].
const STEP_S: f32 = 1.0 / 60.0;

/// A pane under test.
pub(crate) struct PaneHarness {
    /// For what the functions below do not do.
    pub harness: Harness<'static, PaneState>,
}

impl PaneHarness {
    /// A pane of a size.
    pub(crate) fn new(model: Model, size: Vec2, pane_ui: fn(&mut Ui, &mut PaneState)) -> Self {
        let state = PaneState { model, outbox: Outbox::default(), textures: Textures::default(), pointed: None };
        let harness = Harness::builder().with_size(size).with_step_dt(STEP_S).build_ui_state(
            move |ui, state: &mut PaneState| {
                state.textures.live.update(ui.ctx(), &state.model);
                pane_ui(ui, state);
            },
            state,
        );
        let mut pane = Self { harness };
        theme::install(&pane.harness.ctx);
        pane.steps();
        pane.commands();
        pane
    }

    /// Draws it a few times.
    pub(crate) fn steps(&mut self) {
        self.harness.run_steps(3);
    }

    /// The commands since the last call.
    pub(crate) fn commands(&mut self) -> Vec<Command> {
        self.harness.state_mut().outbox.drain().map(|(command, _)| command).collect()
    }

    /// The model, to change it.
    pub(crate) fn model(&mut self) -> &mut Model {
        &mut self.harness.state_mut().model
    }

    /// Whether words are on the screen.
    pub(crate) fn sees(&self, words: &str) -> bool {
        self.harness.query_all_by_label_contains(words).count() > 0
    }

    /// Clicks the widget with this label; returns the commands.
    pub(crate) fn click(&mut self, label: &str) -> Vec<Command> {
        self.commands();
        self.harness.get_by_label(label).click();
        self.steps();
        self.commands()
    }

    /// Where something is.
    pub(crate) fn rect(&self, label: &str) -> egui::Rect {
        self.harness.get_by_label(label).rect()
    }
}
