//! How far a guided sequence is, and how it ends.

use handeye_plan::guided::{CHECKS, Ending};

use super::state::{GuidedProgress, Waits, ended};
use crate::messages::state::Severity;
use crate::model::Model;
use crate::session::archive::ArchiveTask;
use crate::session::desk::SessionThreads;
use crate::session::state::StopOutcome;
use crate::shell::state::Pane;
use crate::text::Text;
use handeye_session::guided::guided_record;

pub(super) fn guided_mut(model: &mut Model) -> Option<&mut GuidedProgress> {
    let runs = model.sequence_runs;
    model.sequence.as_mut().filter(|_| runs)?.guided.as_deref_mut()
}

/// All chosen poses have been visited; whether the guide continues from here.
pub(crate) fn guided_waits(model: &mut Model, desk: &SessionThreads) -> bool {
    let has_captures = !model.document().captures.is_empty();
    let left_out = model.sequence.as_ref().and_then(|sequence| sequence.last_skipped().cloned());
    let Some(guided) = guided_mut(model) else { return false };
    guided.waits = Waits::Answer;
    if !has_captures {
        guided_ends(model, desk, Severity::Warning, left_out.unwrap_or_else(|| Ending::NoStart.text()));
    }
    true
}

/// The robot does not move to a pose of a guided sequence; whether the same happened for the one before. A chosen pose is
/// within the limits of the joints and free to reach, so the pose is then not the reason.
pub(crate) fn guided_was_refused(model: &mut Model) -> bool {
    let Some(guided) = guided_mut(model) else { return false };
    guided.refused_moves += 1;
    guided.refused_moves > 1
}

/// The arm is at a pose of a guided sequence.
pub(crate) fn guided_arrived(model: &mut Model) {
    if let Some(guided) = guided_mut(model) {
        guided.refused_moves = 0;
    }
}

/// A pose of a guided sequence is over.
pub(crate) fn guided_visited(model: &mut Model, outcome: &StopOutcome) {
    let Some(guided) = guided_mut(model) else { return };
    if guided.ending.is_some() {
        guided.tried += 1;
        guided.checked += usize::from(*outcome == StopOutcome::Done);
        return;
    }
    match outcome {
        StopOutcome::Done => guided.guide.captured(),
        StopOutcome::Skipped(_) => guided.guide.failed(),
    }
}

/// Writes what was proposed and what came of it next to the captures. The next record contains it all again, so nothing
/// is lost if the disk is too busy for one.
pub(super) fn keep_guided(model: &mut Model, desk: &SessionThreads) {
    let guided = model.sequence.as_ref().and_then(|sequence| sequence.guided.as_deref());
    if let (Some(guided), Some(folder)) = (guided, model.session.folder.clone()) {
        let task = ArchiveTask::Guided { folder, record: Box::new(guided_record(&guided.guide)) };
        if desk.archive(task).is_err() {
            tracing::debug!("the record of guided capture is written later");
        }
    }
}

/// Whether the sequence is guided and over: the outcome is then already reported.
pub(crate) fn guided_is_over(model: &mut Model, desk: &SessionThreads) -> bool {
    if guided_mut(model).is_some_and(|guided| guided.checked >= CHECKS || guided.tried >= 2 * CHECKS) {
        guided_finished(model, desk);
        return true;
    }
    false
}

pub(super) fn guided_finished(model: &mut Model, desk: &SessionThreads) {
    let Some((severity, reported)) =
        guided_mut(model).and_then(|guided| Some(ended(guided.ending.as_ref()?, guided.checked)))
    else {
        return;
    };
    guided_ends(model, desk, severity, reported);
}

pub(super) fn guided_ends(model: &mut Model, desk: &SessionThreads, severity: Severity, why: Text) {
    keep_guided(model, desk);
    if let Some(guided) = guided_mut(model) {
        guided.is_over = true;
    }
    model.sequence_runs = false;
    model.asked = None;
    match severity {
        Severity::Info => model.notify(severity, why),
        _ => model.notify_in(Pane::Poses, severity, why),
    }
}
