//! The board on paper, at its true size.

use std::path::{Path, PathBuf};

use handeye_files::atomic_file;
use handeye_geometry::targets::TargetSpec;
use handeye_print::{Page, target_pdf};

use crate::model::Model;
use crate::model::Severity;
use crate::text::Text;
use crate::worker::{FileTask, SessionThreads};
use handeye_wording::Value;
use handeye_wording::text;

/// Writes it; returns the report.
pub(crate) fn write(target: &TargetSpec, page: Page, file: &Path) -> (Severity, Text) {
    match written(target, page, file) {
        Ok(()) => (
            Severity::Info,
            text!(
                "{file} is written. Print it at 100 % (actual size); both rulers on it must then be 100 mm long",
                file = file.display()
            ),
        ),
        Err(why) => (Severity::Error, text!("The board was not written: {why}", why = why)),
    }
}

fn written(target: &TargetSpec, page: Page, file: &Path) -> Result<(), Value> {
    if let Some(folder) = file.parent() {
        std::fs::create_dir_all(folder)?;
    }
    Ok(atomic_file::write(file, &target_pdf(target, page)?)?)
}

/// The name of its file, which distinguishes boards.
fn file_name(target: &TargetSpec) -> String {
    let size = match target {
        TargetSpec::AprilTag(tag) => format!("{}", tag.id),
        TargetSpec::AprilGrid(board) => format!("{}x{}", board.columns, board.rows),
        _ => format!("{}x{}", target.grid().columns, target.grid().rows),
    };
    format!("{}_{size}.pdf", target.kind())
}

/// Writes the board of the session for a printer, into the session or next to the others.
pub(crate) fn print_target(model: &mut Model, desk: &SessionThreads, page: Page) {
    let target = model.document().meta.target;
    let folder: &PathBuf = model.session.folder.as_ref().unwrap_or(&model.sessions);
    let file = folder.join(file_name(&target));
    let asked = desk.files(FileTask::PrintTarget { target, page, file });
    model.notify_if_refused(text!("The board was not written"), asked);
}
