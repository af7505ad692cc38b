//! A pane alone, for tests: driven by the labels of its controls, with a model of its own.

use egui::{Ui, vec2};
use egui_kittest::Harness;
use egui_kittest::kittest::{NodeT as _, Queryable as _};

use crate::style::theme;
use handeye_workbench::command::{Command, Outbox};
use handeye_workbench::model::Model;

pub(crate) type PaneUi = fn(&mut Ui, &Model, &mut Outbox);

/// Nothing has to be scrolled to.
const HEIGHT: f32 = 2400.0;

/// The pane with its model and its commands.
pub(crate) struct Driven {
    /// Draws it.
    pub harness: Harness<'static, (Model, Outbox)>,
}

impl Driven {
    /// As wide as a tile, and high enough that nothing has to be scrolled to.
    pub(crate) fn new(pane: PaneUi, model: Model) -> Self {
        let harness = Harness::builder().with_size(vec2(420.0, HEIGHT)).build_ui_state(
            move |ui, (model, outbox): &mut (Model, Outbox)| {
                // Fonts are there from the frame after the one that they are installed in.
                let installed = egui::Id::new("installed");
                if ui.data(|data| data.get_temp::<()>(installed)).is_some() {
                    pane(ui, model, outbox);
                } else {
                    theme::install(ui.ctx());
                    ui.data_mut(|data| data.insert_temp(installed, ()));
                }
            },
            (model, Outbox::default()),
        );
        let mut driven = Self { harness };
        driven.steps();
        driven
    }

    /// The same in another width.
    pub(crate) fn widen(&mut self, width: f32) {
        self.harness.set_size(vec2(width, HEIGHT));
        self.steps();
    }

    /// Draws until the change is visible.
    pub(crate) fn steps(&mut self) {
        self.harness.run_steps(3);
    }

    /// The model, to change it.
    pub(crate) fn model(&mut self) -> &mut Model {
        &mut self.harness.state_mut().0
    }

    /// The commands since the last call.
    pub(crate) fn commands(&mut self) -> Vec<Command> {
        self.harness.state_mut().1.drain().map(|(command, _)| command).collect()
    }

    /// Whether a text is on the screen.
    pub(crate) fn sees(&self, part: &str) -> bool {
        self.harness.query_all_by_label_contains(part).count() > 0
    }

    /// Whether a control can be used.
    pub(crate) fn is_enabled(&self, label: &str) -> bool {
        !self.harness.get_by_label(label).accesskit_node().is_disabled()
    }

    /// Clicks a control and returns its commands.
    pub(crate) fn click(&mut self, label: &str) -> Vec<Command> {
        self.commands();
        self.harness.get_by_label(label).click();
        self.steps();
        self.commands()
    }

    /// Puts a text into a field in place of what is in it.
    pub(crate) fn retype(&mut self, label: &str, text: &str) {
        self.harness.get_by_label(label).click();
        self.steps();
        self.harness.key_press_modifiers(egui::Modifiers::COMMAND, egui::Key::A);
        self.steps();
        self.harness.get_by_label(label).type_text(text);
        self.steps();
    }

    /// Puts a text into a field that is empty or selects all when it is entered.
    pub(crate) fn type_into(&mut self, label: &str, text: &str) {
        self.harness.get_by_label(label).click();
        self.steps();
        self.harness.get_by_label(label).type_text(text);
        self.steps();
    }

    /// Presses and releases a key, and returns its commands.
    pub(crate) fn press(&mut self, key: egui::Key) -> Vec<Command> {
        self.commands();
        self.harness.key_press(key);
        self.steps();
        self.commands()
    }

    /// Whether everything is inside the width of the pane.
    pub(crate) fn nothing_is_cut_off(&self) -> bool {
        let width = self.harness.ctx.content_rect().width();
        let placed = self.harness.query_all_by(|node| node.raw_bounds().is_some());
        placed.into_iter().all(|node| node.rect().max.x <= width + 0.5)
    }
}
