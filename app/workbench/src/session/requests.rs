//! What is asked of the threads of the session and of those that look for the board.

use std::path::PathBuf;

use handeye_session::Edit;

use crate::messages::state::Severity;
use crate::model::Model;
use crate::session::archive::ArchiveTask;
use crate::session::desk::SessionThreads;
use crate::worker::files::FileTask;
use crate::worker::threads::Workers;
use crate::worker::vision::VisionTask;
use handeye_wording::text;

pub(super) fn ask_archive(model: &mut Model, desk: &SessionThreads, task: ArchiveTask) {
    let asked = desk.archive(task);
    if asked.is_err() {
        model.notify(Severity::Error, text!("The disk does not keep up: nothing was changed. Try again in a moment"));
    }
}

/// Changes the document. It is shown when it is on the disk.
pub(crate) fn edit(model: &mut Model, desk: &SessionThreads, edit: Edit) {
    ask_archive(model, desk, ArchiveTask::Edit(Box::new(edit)));
}

pub(crate) fn list_folder(model: &mut Model, desk: &SessionThreads, folder: PathBuf) {
    let asked = desk.files(FileTask::List(folder));
    model.notify_if_refused(text!("The folder was not read"), asked);
}

/// Sends the target to the threads that look for the board.
pub(crate) fn send_target(model: &mut Model, workers: &Workers) {
    let target = model.document().meta.target;
    let asked = workers.ask_vision(VisionTask::SetTarget(target));
    model.notify_if_refused(text!("The target was not changed"), asked);
}

/// Sends them the camera's intrinsics.
pub(crate) fn send_intrinsics(model: &mut Model, workers: &Workers) {
    let Some(intrinsics) = model.intrinsics() else { return };
    let asked = workers.ask_vision(VisionTask::SetIntrinsics(intrinsics));
    model.notify_if_refused(text!("The camera was not changed"), asked);
}
