//! The move that waits until the user allows it.

use egui::{Button, RichText, Ui};

use crate::shell::reasons::unmovable;
use crate::style::marks::Marks;
use crate::style::parts;
use crate::style::theme::{Palette, Tone};
use handeye_wording::text;
use handeye_workbench::command::Outbox;
use handeye_workbench::model::{Model, Motion};
use handeye_workbench::motion::way::Way;
use handeye_workbench::taught;
use handeye_workbench::tr;

/// What it is, how far it is, and what the user can do with it; nothing if no move waits.
pub fn asked_ui(ui: &mut Ui, model: &Model, outbox: &mut Outbox) {
    let Some(asked) = &model.asked else { return };
    let language = model.view.language;
    let what = asked.what.clone();
    let reported = match Way::to(&asked.goal, model) {
        Some(way) => text!("The arm waits to move to {what}: {way}", what = what, way = way.text(model)),
        None => text!("The arm waits to move to {what}", what = what),
    };
    parts::notice_ui(ui, Tone::Busy, &reported.in_language(language), |ui| {
        let hindrance = unmovable(model).or_else(|| match model.motion {
            Motion::Idle => None,
            _ => Some(tr!(language, "The arm is moving: wait until it stands, or stop it")),
        });
        let words = RichText::new(tr!(language, "Move there")).strong().color(Marks::of(ui).on_accent);
        let button = Button::new(words).fill(Palette::of(ui).accent);
        let what = tr!(language, "The path is clear of all known obstacles. STOP ends the move");
        if parts::gated_ui(ui, hindrance, button).on_hover_text(what).clicked() {
            outbox.send(taught::Command::ConfirmMove);
        }
        let (name, what) = if model.sequence_runs {
            (
                tr!(language, "Skip this pose"),
                tr!(language, "Leaves this pose out; the sequence goes on with another one"),
            )
        } else {
            (tr!(language, "Do not move"), tr!(language, "The arm stays where it is"))
        };
        if ui.button(name).on_hover_text(what).clicked() {
            outbox.send(taught::Command::SkipMove);
        }
    });
}
