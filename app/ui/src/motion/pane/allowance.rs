//! Whether the workbench may move a robot behind a driver: only after the user has allowed it, once for each
//! connection.

use egui::{Button, RichText, Ui};

use crate::style::parts;
use crate::style::theme::{Palette, Tone};
use handeye_workbench::command::Outbox;
use handeye_workbench::connect;
use handeye_workbench::model::{Model, Moves};
use handeye_workbench::tr;

/// The question, or the way back.
pub fn allowance_ui(ui: &mut Ui, model: &Model, outbox: &mut Outbox) {
    let language = model.view.language;
    if !matches!(model.moves(), Moves::OnceArmed { .. }) || !model.control.is_connected() {
        return;
    }
    if model.robot.as_ref().is_some_and(|robot| robot.is_armed) {
        parts::notice_ui(ui, Tone::Warning, tr!(language, "The workbench may move this robot"), |ui| {
            if ui.button(tr!(language, "Only read it")).clicked() {
                outbox.send(connect::Command::Arm(false));
            }
        });
        return;
    }
    let reported = tr!(
        language,
        "The robot is only read. Before the workbench may move it: nobody in its reach, the emergency stop at hand, a low speed"
    );
    parts::notice_ui(ui, Tone::Busy, reported, |ui| {
        let palette = Palette::of(ui);
        let words = RichText::new(tr!(language, "Let the workbench move it")).color(palette.on_accent);
        if ui.add(Button::new(words).fill(palette.accent)).clicked() {
            outbox.send(connect::Command::Arm(true));
        }
    });
}
