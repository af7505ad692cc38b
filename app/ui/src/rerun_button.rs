//! The button that opens the recording in Rerun.

use egui::{Button, RichText, Ui};

use crate::style::theme::{self, Palette};
use handeye_wording::text;
use handeye_workbench::command::Outbox;
use handeye_workbench::model::{RerunState, ViewerState};
use handeye_workbench::recording;
use handeye_workbench::text::Language;
use handeye_workbench::tr;

/// Height of the button.
const HEIGHT: f32 = 30.0;

/// The button; what it would do and the state of the recording are in its hint.
pub fn rerun_button_ui(ui: &mut Ui, rerun: &RerunState, language: Language, outbox: &mut Outbox) {
    let palette = Palette::of(ui);
    let ink = match rerun.viewer {
        _ if !rerun.on => palette.weak.gamma_multiply(0.45),
        ViewerState::Failed(_) => palette.warning,
        ViewerState::Closed => palette.text.gamma_multiply(0.8),
        ViewerState::Opening | ViewerState::Native | ViewerState::Web { .. } | ViewerState::Connected { .. } => {
            palette.text
        }
    };
    let words = match rerun.viewer {
        ViewerState::Opening => tr!(language, "Rerun…"),
        _ => tr!(language, "Rerun"),
    };
    let button = Button::new(RichText::new(words).color(ink)).min_size(theme::least(ui, 0.0, HEIGHT)).frame(false);
    let response = ui.add_enabled(rerun.on && rerun.viewer != ViewerState::Opening, button);
    let response = response.on_hover_ui(|ui| hint_ui(ui, rerun, language));
    let response = response.on_disabled_hover_ui(|ui| hint_ui(ui, rerun, language));
    if let ViewerState::Web { url } = &rerun.viewer {
        response.context_menu(|ui| {
            if ui.button(tr!(language, "Copy the address of the web viewer")).clicked() {
                ui.ctx().copy_text(url.clone());
                ui.close();
            }
        });
    }
    if response.clicked() {
        outbox.send(recording::Command::OpenRerun);
    }
}

fn hint_ui(ui: &mut Ui, rerun: &RerunState, language: Language) {
    ui.set_max_width(420.0);
    if !rerun.on {
        ui.label(tr!(language, "Nothing is recorded: the program was started with --rerun off"));
        return;
    }
    let viewer = match &rerun.viewer {
        ViewerState::Closed => text!("Show the recording in Rerun: the cell in 3D and on a time line"),
        ViewerState::Opening => text!("The Rerun viewer is being opened"),
        ViewerState::Native => text!("The Rerun viewer is open"),
        ViewerState::Web { url } => text!("The recording is shown at {url}: open it in a browser", url = url),
        ViewerState::Connected { url } => text!("The recording goes to the viewer at {url} already", url = url),
        ViewerState::Failed(why) => why.clone(),
    };
    ui.label(viewer.in_language(language));
    if let Some(file) = &rerun.file {
        ui.label(text!("Recorded into {file}", file = file.display()).in_language(language));
    }
    if rerun.left_out > 0 {
        let text = text!(
            "{count} live {count|entry was|entries were} left out: the viewer or the disk is slow",
            count = rerun.left_out
        );
        ui.label(text.in_language(language));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::driven::Driven;
    use handeye_workbench::command::Command;
    use handeye_workbench::model::Model;
    use handeye_workbench::testing::sample;

    fn button_ui(ui: &mut Ui, model: &Model, outbox: &mut Outbox) {
        rerun_button_ui(ui, &model.rerun, model.view.language, outbox);
    }

    #[test]
    fn the_button_opens_a_viewer_and_rests_while_nothing_is_recorded() {
        let mut model = sample::captured();
        model.rerun.on = true;
        let mut bar = Driven::new(button_ui, model);
        assert_eq!(bar.click("Rerun"), [Command::Recording(recording::Command::OpenRerun)]);
        bar.model().rerun.on = false;
        bar.steps();
        assert!(!bar.is_enabled("Rerun"));
        bar.model().rerun = RerunState { on: true, viewer: ViewerState::Opening, ..RerunState::default() };
        bar.steps();
        assert!(!bar.is_enabled("Rerun…"), "one viewer at a time");
    }
}
