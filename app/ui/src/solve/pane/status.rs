//! What the solver does, and what to do if it has no answer.

use egui::{Button, RichText, Ui};
use handeye_estimate::handeye::motion::MIN_VIEWS;
use handeye_geometry::progress::Stage;

use crate::style::parts;
use crate::style::theme::{Palette, Tone};
use handeye_wording::text;
use handeye_workbench::command::Outbox;
use handeye_workbench::model::{Model, SolveStatus};
use handeye_workbench::solve;
use handeye_workbench::text::Language;
use handeye_workbench::tr;

/// Progress, failure, or how the answer came about.
pub fn status_ui(ui: &mut Ui, model: &Model, outbox: &mut Outbox) {
    let language = model.view.language;
    match &model.solve.status {
        SolveStatus::Running { stage, part, since_s, .. } => running_ui(ui, model, *stage, *part, *since_s, outbox),
        SolveStatus::Failed { why } => {
            let text =
                text!("There is no answer for the present captures. {why}", why = why.clone()).in_language(language);
            parts::notice_ui(ui, Tone::Bad, &text, |ui| again_ui(ui, language, outbox));
        }
        SolveStatus::Cancelled => {
            let text = tr!(language, "Solving was cancelled");
            parts::notice_ui(ui, Tone::Warning, text, |ui| again_ui(ui, language, outbox));
        }
        SolveStatus::Idle => idle_ui(ui, model, outbox),
    }
}

fn running_ui(ui: &mut Ui, model: &Model, stage: Stage, part: f64, since_s: f64, outbox: &mut Outbox) {
    let language = model.view.language;
    let seconds = (model.now_s - since_s).max(0.0) as u64;
    let doing = stage_name(stage, language);
    let text = text!("Solving for {seconds} s: {doing}", seconds = seconds, doing = doing).in_language(language);
    if parts::progress_ui(ui, part as f32, &text, tr!(language, "Cancel solving")) {
        outbox.send(solve::Command::Cancel);
    }
    if model.solve.solved.is_some() && !model.solve.fresh {
        parts::hint_ui(ui, tr!(language, "The numbers below are of the earlier captures until it is done."));
    }
}

fn idle_ui(ui: &mut Ui, model: &Model, outbox: &mut Outbox) {
    let language = model.view.language;
    let Some(solved) = &model.solve.solved else {
        let count = model.document().in_use().count();
        let has_robot = model.document().mode().is_some();
        let detail = if has_robot {
            text!(
                "A calibration takes at least three captures of the board, ten are good. Captures so far: {count}. It is solved automatically as soon as there are enough.",
                count = count
            )
        } else {
            text!(
                "A calibration of the camera takes at least three images of the board in use, now {count}.",
                count = count
            )
        };
        parts::empty_ui(ui, tr!(language, "No calibration yet"), &detail.in_language(language));
        ui.vertical_centered(|ui| {
            let reason = (count < MIN_VIEWS).then(|| {
                if has_robot {
                    tr!(language, "Capture the board from more poses first")
                } else {
                    tr!(language, "Use more of the images")
                }
            });
            if parts::gated_ui(ui, reason, Button::new(tr!(language, "Solve"))).clicked() {
                outbox.send(solve::Command::Solve);
            }
        });
        return;
    };
    if model.solve.fresh {
        ui.horizontal(|ui| {
            let how = text!(
                "Solved from {count} captures in {time} s",
                count = solved.captures.len(),
                time = seconds(solved.took_s)
            );
            let weak = Palette::of(ui).weak;
            ui.label(RichText::new(how.in_language(language)).color(weak));
            if ui.button(tr!(language, "Solve again")).clicked() {
                outbox.send(solve::Command::Solve);
            }
        });
    } else {
        let text = tr!(language, "Out of date: this result is from earlier captures or settings");
        parts::notice_ui(ui, Tone::Warning, text, |ui| again_ui(ui, language, outbox));
    }
}

fn again_ui(ui: &mut Ui, language: Language, outbox: &mut Outbox) {
    if ui.button(tr!(language, "Solve again")).clicked() {
        outbox.send(solve::Command::Solve);
    }
}

/// Two digits while it is short.
fn seconds(took_s: f64) -> String {
    if took_s < 10.0 { format!("{took_s:.1}") } else { format!("{took_s:.0}") }
}

fn stage_name(stage: Stage, language: Language) -> &'static str {
    match stage {
        Stage::Intrinsics => tr!(language, "calibrating the camera"),
        Stage::TargetPoses => tr!(language, "locating the target"),
        Stage::ClosedForms => tr!(language, "solving the closed forms"),
        Stage::Joint => tr!(language, "estimating jointly"),
        Stage::HeldOut => tr!(language, "predicting held-out views"),
        Stage::Prediction => tr!(language, "predicting the error by number of views"),
        Stage::Verification => tr!(language, "verifying captures"),
        other => other.label(),
    }
}
