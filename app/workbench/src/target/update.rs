//! Another target, and the target on paper.

use std::path::PathBuf;

use handeye_geometry::targets::TargetSpec;
use handeye_print::Page;
use handeye_session::Edit;

use super::command::Command;
use crate::guided::update::forget_guided;
use crate::model::Model;
use crate::session::desk::SessionThreads;
use crate::session::requests::edit;
use crate::worker::files::FileTask;
use crate::worker::threads::Workers;
use handeye_wording::text;

/// Does what is wanted of the target.
pub(crate) fn apply(model: &mut Model, workers: &Workers, desk: &SessionThreads, command: Command) {
    match command {
        Command::Set(target) => set_target(model, workers, desk, target),
        Command::Print(page) => print_target(model, desk, page),
    }
}

fn set_target(model: &mut Model, workers: &Workers, desk: &SessionThreads, target: TargetSpec) {
    forget_guided(model, workers);
    edit(model, desk, Edit::SetTarget(target));
}

/// Name of the board's file, different for different boards.
fn file_name(target: &TargetSpec) -> String {
    let size = match target {
        TargetSpec::AprilTag(tag) => format!("{}", tag.id),
        TargetSpec::AprilGrid(board) => format!("{}x{}", board.columns, board.rows),
        _ => format!("{}x{}", target.grid().columns, target.grid().rows),
    };
    format!("{}_{size}.pdf", target.kind())
}

/// Writes the board of the session for a printer, into the session or next to the others.
fn print_target(model: &mut Model, desk: &SessionThreads, page: Page) {
    let target = model.document().meta.target;
    let folder: &PathBuf = model.session.folder.as_ref().unwrap_or(&model.sessions);
    let file = folder.join(file_name(&target));
    let asked = desk.files(FileTask::PrintTarget { target, page, file });
    model.notify_if_refused(text!("The board was not written"), asked);
}
