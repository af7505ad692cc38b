//! Hold to move: a jog begins when a button or key goes down and ends when it goes up, when the pointer leaves the
//! button, or when the window loses the focus.

use egui::{Button, Id, Response, RichText, Sense, Ui};

use crate::style::parts;
use handeye_workbench::command::Outbox;
use handeye_workbench::model::Jog;
use handeye_workbench::motion;

/// What is held, during one frame.
pub struct Hold {
    /// In the frame before.
    before: Option<Jog>,
    now: Option<Jog>,
    tapped: Option<Jog>,
}

fn id() -> Id {
    Id::new("jog that is held")
}

/// A button to be held. One that only senses clicks is released by egui after 0.8 s or a few points of movement, when
/// neither can be a click now.
pub fn button(face: RichText) -> Button<'static> {
    Button::new(face).sense(Sense::click_and_drag())
}

impl Hold {
    /// At the beginning of a frame.
    pub fn begin(ui: &Ui) -> Self {
        Self { before: parts::remembered(ui, id()), now: None, tapped: None }
    }

    /// A button of the pane.
    pub fn button(&mut self, ui: &Ui, response: &Response, jog: Jog) {
        // A button that has become disabled under the pointer counts as released.
        let is_down = response.enabled() && response.is_pointer_button_down_on() && response.contains_pointer();
        // A pointer that comes back with the button still down has released it: a jog only begins with a press.
        let begins = ui.input(|input| input.pointer.any_pressed());
        if is_down && (begins || self.before == Some(jog)) {
            self.now = Some(jog);
        } else if response.clicked() && self.before != Some(jog) {
            // Pressed and released within a frame, or by a key or a screen reader.
            self.tapped = Some(jog);
        }
    }

    /// A key of the pane. A held button has priority.
    pub fn key(&mut self, jog: Jog) {
        self.now = self.now.or(Some(jog));
    }

    /// At the end of a frame.
    pub fn finish(self, ui: &Ui, outbox: &mut Outbox) {
        let has_focus = ui.input(|input| input.focused);
        let now = self.now.filter(|_| has_focus);
        if let Some(jog) = now.filter(|_| self.before == now) {
            outbox.send(motion::Command::JogHeld(jog));
        } else {
            if self.before.is_some() {
                outbox.send(motion::Command::JogReleased);
            }
            if let Some(jog) = now {
                outbox.send(motion::Command::Jog(jog));
            } else if let Some(jog) = self.tapped {
                outbox.send(motion::Command::Jog(jog));
                outbox.send(motion::Command::JogReleased);
            }
        }
        if now.is_some() {
            ui.ctx().request_repaint();
        }
        parts::remember(ui, id(), now);
    }
}
