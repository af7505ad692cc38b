//! Visiting all poses, and how that goes.

use egui::{Button, Ui};

use crate::shell::asked::asked_ui;
use crate::shell::reasons::immovable;
use crate::shell::reasons::needs_robot;
use crate::style::parts;
use handeye_wording::text;
use handeye_workbench::command::Outbox;
use handeye_workbench::model::{CapturePurpose, Model, PoseSequence, StopOutcome};
use handeye_workbench::text::Text;
use handeye_workbench::tr;
use handeye_workbench::{connect, motion, taught};

/// Buttons that begin a sequence, or its progress.
pub fn sequence_ui(ui: &mut Ui, model: &Model, outbox: &mut Outbox) {
    match &model.sequence {
        Some(sequence) if model.sequence_runs => progress_ui(ui, model, sequence, outbox),
        sequence => {
            asked_ui(ui, model, outbox);
            begin_ui(ui, model, outbox);
            if let Some(sequence) = sequence.as_ref().filter(|sequence| !sequence.is_planned()) {
                summary_ui(ui, model, sequence, outbox);
            }
        }
    }
}

fn begin_ui(ui: &mut Ui, model: &Model, outbox: &mut Outbox) {
    let language = model.view.language;
    let is_empty = model.taught().is_empty();
    let reason = immovable(model).or_else(|| is_empty.then(|| tr!(language, "Teach poses first")));
    parts::caption_ui(ui, tr!(language, "Run all poses"));
    ui.horizontal_wrapped(|ui| {
        ui.spacing_mut().button_padding.x = 7.0;
        for (purpose, name, what) in [
            (
                Some(CapturePurpose::Calibrate),
                tr!(language, "Capture at each"),
                tr!(language, "Visits every pose and captures the board for the calibration"),
            ),
            (
                Some(CapturePurpose::Verify),
                tr!(language, "Verify at each"),
                tr!(language, "Visits every pose and captures the board for verification: it never enters the fit"),
            ),
            (None, tr!(language, "Move only"), tr!(language, "Visits every pose and captures nothing")),
        ] {
            let reason = reason.or_else(|| purpose.and_then(|_| needs_robot(model)));
            if parts::gated_ui(ui, reason, Button::new(name)).on_hover_text(what).clicked() {
                outbox.send(taught::Command::RunSequence { purpose });
            }
        }
        home_ui(ui, model, outbox);
    });
}

/// The button to return the arm to its initial pose, and to reset the built-in cell.
pub fn home_ui(ui: &mut Ui, model: &Model, outbox: &mut Outbox) {
    let language = model.view.language;
    if model.home.is_some() {
        let button = Button::new(tr!(language, "Home"));
        let what =
            tr!(language, "Moves the arm to where it stood when the cell was connected, around what is in the way");
        if parts::gated_ui(ui, immovable(model), button).on_hover_text(what).clicked() {
            outbox.send(motion::Command::GoHome);
        }
    }
    if model.source.is_built_in() {
        let button = Button::new(tr!(language, "Reset the cell"));
        let what = tr!(
            language,
            "Restarts the built-in cell: arm and board return to where they started; the session stays open"
        );
        let reason = model.sequence_runs.then(|| tr!(language, "A sequence is under way"));
        if parts::gated_ui(ui, reason, button).on_hover_text(what).clicked() {
            outbox.send(connect::Command::ResetCell);
        }
    }
}

/// Which poses were skipped, one line for each reason.
pub fn skipped_ui(ui: &mut Ui, model: &Model, sequence: &PoseSequence) {
    let mut reasons: Vec<(&Text, Vec<&str>)> = Vec::new();
    for (name, outcome) in sequence.names.iter().zip(&sequence.outcomes) {
        let StopOutcome::Skipped(why) = outcome else { continue };
        match reasons.iter_mut().find(|(reported, _)| *reported == why) {
            Some((_, names)) => names.push(name),
            None => reasons.push((why, vec![name])),
        }
    }
    for (why, names) in reasons {
        let reported = text!("Skipped {names}: {why}", names = names.join(", "), why = why.clone());
        parts::caption_ui(ui, &reported.in_language(model.view.language));
    }
}

/// In the pane of the captures: the progress of a sequence of taught poses and, if poses were skipped or it was interrupted, how it
/// went and what to do.
pub fn visits_ui(ui: &mut Ui, model: &Model, sequence: &PoseSequence, outbox: &mut Outbox) {
    let is_whole = sequence.outcomes.len() == sequence.names.len()
        && sequence.outcomes.iter().all(|outcome| *outcome == StopOutcome::Done);
    if model.sequence_runs || is_whole {
        return;
    }
    parts::hint_ui(ui, &went(sequence).in_language(model.view.language));
    skipped_ui(ui, model, sequence);
    ui.horizontal_wrapped(|ui| home_ui(ui, model, outbox));
}

/// Its progress, and the button that ends it.
pub fn progress_ui(ui: &mut Ui, model: &Model, sequence: &PoseSequence, outbox: &mut Outbox) {
    let language = model.view.language;
    let (done, of) = (sequence.outcomes.len(), sequence.names.len());
    let reported = match sequence.current() {
        Some(name) => text!("Pose {n} of {of}: {name}", n = done + 1, of = of, name = name),
        None => text!("{of} {of|pose was|poses were} visited", of = of),
    }
    .in_language(language);
    if parts::progress_ui(ui, done as f32 / of.max(1) as f32, &reported, tr!(language, "Stop the sequence")) {
        outbox.send(taught::Command::StopSequence);
    }
    asked_ui(ui, model, outbox);
}

/// How the last one went, and the button to continue it if poses are left.
pub fn summary_ui(ui: &mut Ui, model: &Model, sequence: &PoseSequence, outbox: &mut Outbox) {
    parts::hint_ui(ui, &went(sequence).in_language(model.view.language));
    continue_ui(ui, model, sequence, outbox);
}

fn went(sequence: &PoseSequence) -> Text {
    let done = sequence.outcomes.iter().filter(|outcome| **outcome == StopOutcome::Done).count();
    let skipped = sequence.outcomes.len() - done;
    let left = sequence.names.len().saturating_sub(sequence.outcomes.len());
    text!(
        "Last sequence: {done} of {of} done, {skipped} skipped, {left} not visited",
        done = done,
        of = sequence.names.len(),
        skipped = skipped,
        left = left
    )
}

/// The button that continues an interrupted sequence.
pub fn continue_ui(ui: &mut Ui, model: &Model, sequence: &PoseSequence, outbox: &mut Outbox) {
    let language = model.view.language;
    if !sequence.can_continue() {
        return;
    }
    let button = Button::new(tr!(language, "Continue the sequence"));
    let what = tr!(language, "Goes on at the pose at which it was broken off, with those that are left");
    if parts::gated_ui(ui, immovable(model), button).on_hover_text(what).clicked() {
        outbox.send(taught::Command::ContinueSequence);
    }
}
