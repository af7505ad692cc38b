//! The session: its document, its captures and what was seen in them.

use std::path::PathBuf;
use std::sync::Arc;

use handeye_dataset::taught_poses::TaughtPose;
use handeye_estimate::handeye::Mode;
use handeye_geometry::targets::TargetSpec;
use handeye_session::{CaptureId, Edit, Role};

use super::command::{Command, Event};
use crate::app::context::{Context, Numbers};
use crate::app::reach::{Reach, bounds_of};
use crate::capture::state::CapturePurpose;
use crate::guided::update::forget_guided;
use crate::live::state::FrameImages;
use crate::messages::state::Severity;
use crate::model::Model;
use crate::session::archive::{ArchiveTask, Beginning, timestamp_rfc3339};
use crate::session::desk::SessionThreads;
use crate::session::requests::{ask_archive, edit, list_folder, send_target};
use crate::session::start;
use crate::session::state::{Observed, RecentSession, Review, SessionState};
use crate::shell::state::Dialog;
use crate::shell::update::set_dialog;
use crate::solve::observer::ObserveJob;
use crate::solve::update::{forget_solve, solve_if_changed};
use crate::taught::update::reference_poses;
use crate::text::Text;
use crate::worker::files::FileTask;
use crate::worker::threads::Workers;
use handeye_link::ArmDoubt;
use handeye_wording::text;

/// Does what is wanted of the session.
pub(crate) fn apply(
    model: &mut Model,
    workers: &Workers,
    desk: &SessionThreads,
    reach: Option<&Reach>,
    command: Command,
) {
    match command {
        Command::New(folder) => new_session(model, desk, folder),
        Command::Open(folder) => open(model, desk, reach, folder),
        Command::OpenSample => open_sample(model, desk),
        Command::SaveAs(folder) => save_as(model, desk, folder),
        Command::ListFolder(folder) => list_folder(model, desk, folder),
        Command::OpenFolder(folder) => open_folder(model, desk, folder),
        Command::Undo => undo(model, desk),
        Command::Redo => redo(model, desk),
        Command::Select(ids) => select(model, desk, ids),
        Command::BackToLive => model.review = None,
        Command::SetExcluded { ids, excluded } => edit(model, desk, Edit::SetExcluded { ids, excluded }),
        Command::SetPurpose { ids, purpose } => set_purpose(model, desk, ids, purpose),
        Command::Delete(ids) => delete(model, desk, ids),
        Command::SetMode(mode) => set_mode(model, workers, desk, mode),
        Command::SetCamera(camera) => edit(model, desk, Edit::SetCamera(camera)),
        Command::SetRobotAccuracy(mm) => edit(model, desk, Edit::SetRobotAccuracy(mm)),
    }
}

/// Takes in what is on the disk and what was seen in it.
pub(crate) fn absorb(cx: &mut Context, event: Event) {
    match event {
        Event::Document(state) => document_changed(cx, *state),
        Event::Opened { exported } => session_opened(&mut cx.model, &cx.desk, exported),
        Event::Failed { why } => session_failed(&mut cx.model, why),
        Event::Observed { id, target, observed } => {
            capture_observed(&mut cx.model, &mut cx.desk, &mut cx.numbers, id, target, observed);
        }
        Event::Review { id, images } => reviewed(&mut cx.model, id, images),
        Event::Folder(listing) => cx.model.folder = Some(listing),
        Event::Recent(recent) => cx.model.recent = recent,
    }
}

/// What a new session starts with, given what is known about the cell.
fn beginning(model: &Model) -> Box<Beginning> {
    let cell = model.cell.as_ref();
    let mut meta = start::meta(cell.and_then(|cell| cell.truth.as_ref()), timestamp_rfc3339());
    meta.arm = start::arm(cell.and_then(|cell| cell.arm.as_ref()));
    meta.joint_kinds = cell.and_then(|cell| start::joint_kinds(cell.joints.iter().map(|joint| joint.kind)));
    // They would send any other arm to an arbitrary place.
    let poses = if model.has_reference_poses() { reference_poses() } else { Vec::new() };
    let cell = model.taught_on(meta.target);
    let taught = poses.into_iter().map(|pose| TaughtPose { cell: cell.clone(), ..pose }).collect();
    Box::new(Beginning { meta, taught })
}

/// Sets what a session starts with while nothing was captured in it.
pub(crate) fn prepare_session(model: &mut Model, desk: &SessionThreads) {
    // An arm that may still turn out to be known is not yet an unknown one.
    let is_settled = model.cell.as_ref().is_some_and(|cell| !matches!(cell.arm_doubt, Some(ArmDoubt::Open)));
    if model.session.folder.is_none() || is_settled {
        ask_archive(model, desk, ArchiveTask::Prepare(beginning(model)));
    }
}

fn undo(model: &mut Model, desk: &SessionThreads) {
    if model.session.undo.is_some() {
        ask_archive(model, desk, ArchiveTask::Undo);
    }
}

fn redo(model: &mut Model, desk: &SessionThreads) {
    if model.session.redo.is_some() {
        ask_archive(model, desk, ArchiveTask::Redo);
    }
}

fn set_purpose(model: &mut Model, desk: &SessionThreads, ids: Vec<CaptureId>, purpose: CapturePurpose) {
    let role = match purpose {
        CapturePurpose::Calibrate => Role::Calibration,
        CapturePurpose::Verify => Role::Verification,
    };
    edit(model, desk, Edit::SetRole { ids, role });
}

fn delete(model: &mut Model, desk: &SessionThreads, ids: Vec<CaptureId>) {
    if !ids.is_empty() {
        edit(model, desk, Edit::DeleteCaptures(ids));
    }
}

fn set_mode(model: &mut Model, workers: &Workers, desk: &SessionThreads, mode: Mode) {
    forget_guided(model, workers);
    edit(model, desk, Edit::SetMode(mode));
}

fn new_session(model: &mut Model, desk: &SessionThreads, folder: Option<PathBuf>) {
    model.opening = true;
    ask_archive(model, desk, ArchiveTask::New { folder, beginning: beginning(model) });
}

/// Continues a session; a data set is copied into one.
fn open(model: &mut Model, desk: &SessionThreads, reach: Option<&Reach>, folder: PathBuf) {
    model.opening = true;
    let bounds = bounds_of(reach, &folder);
    ask_archive(model, desk, ArchiveTask::Open { folder, bounds });
}

/// A copy of the sample in a session of its own.
fn open_sample(model: &mut Model, desk: &SessionThreads) {
    model.opening = true;
    ask_archive(model, desk, ArchiveTask::Sample);
}

/// Continues the session in a folder, or starts one there.
pub(crate) fn open_or_begin(model: &mut Model, desk: &SessionThreads, folder: PathBuf) {
    model.opening = true;
    ask_archive(model, desk, ArchiveTask::OpenOrNew { folder, beginning: beginning(model) });
}

fn save_as(model: &mut Model, desk: &SessionThreads, folder: PathBuf) {
    model.opening = true;
    ask_archive(model, desk, ArchiveTask::SaveAs(folder));
}

/// Shows a folder in the system's file manager.
fn open_folder(model: &mut Model, desk: &SessionThreads, folder: PathBuf) {
    let asked = desk.files(FileTask::OpenFolder(folder));
    model.notify_if_refused(text!("The folder was not opened"), asked);
}

/// The document on the disk has changed.
fn document_changed(cx: &mut Context, state: SessionState) {
    let before = std::mem::replace(&mut cx.model.session, state);
    let (old, new) = (&before.document, Arc::clone(&cx.model.session.document));
    let target_changed = old.meta.target != new.meta.target || before.folder.is_none();
    let another = before.folder != cx.model.session.folder && before.folder.is_some();
    if old.meta.target != new.meta.target || another {
        cx.model.observed.clear();
    }
    if before.folder.is_some() && (old.meta.target != new.meta.target || old.meta.mode != new.meta.mode) {
        // Also by undo: the choices were made for another board, or for another end of the arm.
        forget_guided(&mut cx.model, &cx.workers);
    }
    if old.captures != new.captures || old.meta != new.meta {
        cx.model.export.is_present = false;
    }
    if another {
        forget_solve(cx);
        cx.model.export.written = None;
        cx.model.picked = None;
        // Its poses belong to the other session.
        cx.model.sequence = None;
        cx.model.sequence_runs = false;
        cx.model.asked = None;
        cx.model.by_hand = None;
    }
    if let Some(names) = &new.export_names
        && let Ok(names) = serde_json::from_value(names.clone())
    {
        cx.model.export.names = names;
    }
    remember_session(&mut cx.model);
    let document = Arc::clone(&cx.model.session.document);
    cx.model.selection.retain(|id| document.capture(*id).is_some());
    if cx.model.review.as_ref().is_some_and(|review| document.capture(review.id).is_none()) {
        cx.model.review = None;
    }
    if target_changed || another {
        send_target(&mut cx.model, &cx.workers);
    }
    observe_missing(&mut cx.model, &mut cx.desk);
    solve_if_changed(&mut cx.model, &mut cx.desk, &mut cx.numbers);
}

/// Puts the session on the disk, however it came to be, first among the recent ones.
fn remember_session(model: &mut Model) {
    let Some(folder) = model.session.folder.clone() else { return };
    let captures = model.document().captures.len();
    model.recent.retain(|recent| recent.folder != folder);
    model.recent.insert(0, RecentSession { folder, captures });
}

fn session_opened(model: &mut Model, desk: &SessionThreads, exported: bool) {
    model.opening = false;
    model.scene_is_fitted = false;
    model.export.is_present = exported;
    model.selection.clear();
    model.review = None;
    if matches!(model.dialog, Some(Dialog::Open | Dialog::Import | Dialog::SaveAs | Dialog::New)) {
        set_dialog(model, desk, None);
    }
    if let Some(folder) = model.session.folder.clone() {
        model.notify(Severity::Info, text!("Session {folder} is open", folder = folder.display()));
    }
}

fn session_failed(model: &mut Model, why: Text) {
    model.opening = false;
    model.notify(Severity::Error, why);
}

/// Has the captures searched that have not been searched for the present target.
fn observe_missing(model: &mut Model, desk: &mut SessionThreads) {
    let Some(folder) = model.session.folder.clone() else { return };
    let document = Arc::clone(&model.session.document);
    let captures: Vec<_> =
        document.captures.iter().filter(|it| !model.observed.contains_key(&it.id)).cloned().collect();
    if !captures.is_empty() {
        desk.observe(ObserveJob { folder, target: document.meta.target, captures });
    }
}

fn capture_observed(
    model: &mut Model,
    desk: &mut SessionThreads,
    numbers: &mut Numbers,
    id: CaptureId,
    target: TargetSpec,
    observed: Option<Arc<Observed>>,
) {
    if target == model.document().meta.target {
        model.observed.insert(id, observed);
        solve_if_changed(model, desk, numbers);
    }
}

fn select(model: &mut Model, desk: &SessionThreads, ids: Vec<CaptureId>) {
    let shown = ids.last().copied();
    model.selection = ids;
    let Some(id) = shown else {
        model.review = None;
        return;
    };
    if model.review.as_ref().is_some_and(|review| review.id == id) {
        return;
    }
    model.review = Some(Review { id, images: None });
    let capture = model.document().capture(id).cloned();
    let (Some(folder), Some(capture)) = (model.session.folder.clone(), capture) else { return };
    let asked = desk.files(FileTask::Review { folder, capture: Box::new(capture), colours: model.view.depth_colours });
    model.notify_if_refused(text!("The capture is not shown"), asked);
}

fn reviewed(model: &mut Model, id: CaptureId, images: Option<Arc<FrameImages>>) {
    if let Some(review) = model.review.as_mut().filter(|review| review.id == id) {
        review.images = images;
    }
}
