//! The recording for Rerun: what happens is noted, and looking at it.

use std::sync::Arc;

use super::command::{Command, Event};
use super::recorded::Recorded;
use crate::app::context::Numbers;
use crate::command::Event as AnyEvent;
use crate::model::Model;
use crate::recording::{Entry, Recording};
use crate::session::desk::SessionThreads;
use crate::shell::state::Dialog;
use crate::shell::update::set_dialog;
use crate::solve::SolveOutcome;
use crate::text::Language;
use crate::{connect, live, session, solve, track};

/// Does what is wanted of the recording.
pub(crate) fn apply(recording: Option<&dyn Recording>, command: Command) {
    match command {
        Command::OpenRerun => {
            if let Some(recording) = recording {
                recording.open_viewer();
            }
        }
    }
}

/// Takes in how the recording is doing.
pub(crate) fn absorb(model: &mut Model, desk: &SessionThreads, event: Event) {
    match event {
        Event::Rerun(state) => model.rerun = state,
        Event::NoBrowser => show_rerun_address(model, desk),
    }
}

/// Shows where the web viewer is, to copy it. A dialog that is in use stays: the address is also behind the button.
fn show_rerun_address(model: &mut Model, desk: &SessionThreads) {
    if model.dialog.is_none() {
        set_dialog(model, desk, Some(Dialog::RerunAddress));
    }
}

/// Notes what was reported.
pub(crate) fn note(recording: &dyn Recording, model: &Model, numbers: &Numbers, event: &AnyEvent) {
    let entry = match event {
        AnyEvent::Connect(connect::Event::Robot(robot)) => Entry::Robot {
            sim_time_s: robot.sim_time_s,
            base_from_tip: robot.base_from_tip,
            joints_rad: robot.joints_rad,
        },
        AnyEvent::Live(live::Event::Frame { info, images: Some(images), .. }) => {
            Entry::Image { info: Box::new(info.clone()), images: Arc::clone(images) }
        }
        AnyEvent::Live(live::Event::Detection(detection)) => Entry::Detection(Arc::new((**detection).clone())),
        AnyEvent::Connect(connect::Event::Cell(facts)) => Entry::Cell(Arc::new((**facts).clone())),
        AnyEvent::Session(session::Event::Document(state)) => {
            Entry::Document { folder: state.folder.clone(), document: Arc::clone(&state.document) }
        }
        // What was seen for another target is no longer of interest.
        AnyEvent::Session(session::Event::Observed { id, target, observed: Some(observed) })
            if *target == model.document().meta.target =>
        {
            Entry::Observed { id: *id, observed: Arc::clone(observed) }
        }
        AnyEvent::Solve(solve::Event::Ended { job, outcome: SolveOutcome::Solved(solved) }) if *job == numbers.job => {
            Entry::Solved(Arc::clone(solved))
        }
        AnyEvent::Track(track::Event::Tracked(tracked)) => Entry::Tracked(Arc::clone(tracked)),
        _ => return,
    };
    recording.note(entry);
}

/// Notes what the user has changed, and what was reported.
pub(crate) fn note_changes(recording: &dyn Recording, model: &Model, recorded: &mut Recorded) {
    if recorded.step != Some(model.step) {
        recorded.step = Some(model.step);
        recording.note(Entry::Step(model.step));
    }
    if recorded.selection != model.selection {
        recorded.selection.clone_from(&model.selection);
        recording.note(Entry::Selected(model.selection.clone()));
    }
    if recorded.planned.len() != model.planned_poses().len()
        || recorded.planned.iter().zip(model.planned_poses()).any(|(pose, planned)| *pose != planned.base_from_tip)
    {
        recorded.planned = model.planned_poses().iter().map(|planned| planned.base_from_tip).collect();
        recording.note(Entry::Planned(recorded.planned.clone()));
    }
    let around = [model.keep_out.scene_obstacles.clone().unwrap_or_default(), Arc::clone(&model.keep_out.around)];
    if recorded.around.as_ref() != Some(&around) {
        let [scene_obstacles, own] = around.clone();
        recorded.around = Some(around);
        recording.note(Entry::KeepOut { scene_obstacles, own });
    }
    let unrecorded: Vec<_> = model.messages.iter().rev().take_while(|it| it.number >= recorded.reported).collect();
    for message in unrecorded.into_iter().rev() {
        recorded.reported = message.number + 1;
        recording
            .note(Entry::Message { severity: message.severity, words: message.text.in_language(Language::English) });
    }
}
