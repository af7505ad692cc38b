//! The answer: how large its error may be, where the camera is, and why it should be believed or not.

mod answer;
mod estimate;
mod evidence;
mod figures;
mod findings;
mod headline;
mod methods;
mod quality;
mod status;
mod workspace;

use egui::Ui;

use crate::style::parts;
use handeye_workbench::command::Outbox;
use handeye_workbench::model::Model;

/// The pane.
pub fn result_ui(ui: &mut Ui, model: &Model, outbox: &mut Outbox) {
    parts::body_ui(ui, "result", |ui| {
        status::status_ui(ui, model, outbox);
        let Some(solved) = &model.solve.solved else { return };
        // The expected error, and where it holds, are those of a tip.
        let has_robot = solved.calibration.hand_eye.is_some();
        if has_robot {
            headline::headline_ui(ui, model, solved, outbox);
        }
        answer::answer_ui(ui, model, solved);
        estimate::estimate_ui(ui, model, solved);
        answer::truth_ui(ui, model, solved);
        if has_robot {
            workspace::workspace_ui(ui, model, outbox);
        }
        findings::findings_ui(ui, model, solved);
        quality::camera_ui(ui, model, solved);
        quality::noise_ui(ui, model, solved);
        methods::methods_ui(ui, model, solved, outbox);
    });
}

#[cfg(test)]
mod tests;
