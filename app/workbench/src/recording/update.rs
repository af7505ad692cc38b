//! The recording for Rerun: what happens is noted, and looking at it.

use std::sync::Arc;

use crate::app::App;
use crate::command::Event;
use crate::model::Dialog;
use crate::recording::{Entry, Recording};
use crate::solve::SolveOutcome;
use crate::text::Language;
use crate::{connect, live, session, solve, track};

impl App {
    /// Has everything recorded from here on; without it nothing is.
    pub fn record_into(&mut self, recording: impl Recording + 'static) {
        self.recording = Some(Box::new(recording));
    }

    pub(crate) fn open_rerun(&mut self) {
        if let Some(recording) = &self.recording {
            recording.open_viewer();
        }
    }

    /// Shows where the web viewer is, to copy it. A dialog that somebody uses stays: the address is also behind the button.
    pub(crate) fn show_rerun_address(&mut self) {
        if self.model.dialog.is_none() {
            self.set_dialog(Some(Dialog::RerunAddress));
        }
    }

    /// Notes what was reported. Without a recording this is a single comparison.
    pub(crate) fn record(&self, event: &Event) {
        let Some(recording) = &self.recording else { return };
        let entry = match event {
            Event::Connect(connect::Event::Robot(robot)) => Entry::Robot {
                sim_time_s: robot.sim_time_s,
                base_from_tip: robot.base_from_tip,
                joints_rad: robot.joints_rad,
            },
            Event::Live(live::Event::Frame { info, images: Some(images), .. }) => {
                Entry::Image { info: Box::new(info.clone()), images: Arc::clone(images) }
            }
            Event::Live(live::Event::Detection(detection)) => Entry::Detection(Arc::new((**detection).clone())),
            Event::Connect(connect::Event::Cell(facts)) => Entry::Cell(Arc::new((**facts).clone())),
            Event::Session(session::Event::Document(state)) => {
                Entry::Document { folder: state.folder.clone(), document: Arc::clone(&state.document) }
            }
            // What was seen for another target is no longer of interest.
            Event::Session(session::Event::Observed { id, target, observed: Some(observed) })
                if *target == self.model.document().meta.target =>
            {
                Entry::Observed { id: *id, observed: Arc::clone(observed) }
            }
            Event::Solve(solve::Event::Ended { job, outcome: SolveOutcome::Solved(solved) })
                if *job == self.numbers.job =>
            {
                Entry::Solved(Arc::clone(solved))
            }
            Event::Track(track::Event::Tracked(tracked)) => Entry::Tracked(Arc::clone(tracked)),
            _ => return,
        };
        recording.note(entry);
    }

    /// Notes what the user has changed, and what was said.
    pub(crate) fn record_changes(&mut self) {
        let Self { model, recording: Some(recording), recorded, .. } = self else { return };
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
        let around = [model.keep_out.standing.clone().unwrap_or_default(), Arc::clone(&model.keep_out.around)];
        if recorded.around.as_ref() != Some(&around) {
            let [standing, own] = around.clone();
            recorded.around = Some(around);
            recording.note(Entry::KeepOut { standing, own });
        }
        let unsaid: Vec<_> = model.messages.iter().rev().take_while(|it| it.number >= recorded.said).collect();
        for message in unsaid.into_iter().rev() {
            recorded.said = message.number + 1;
            recording.note(Entry::Said { severity: message.severity, words: message.text.say(Language::English) });
        }
    }
}
