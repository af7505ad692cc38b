//! The board on paper, at its true size.

use std::path::Path;

use handeye_files::atomic_file;
use handeye_geometry::targets::TargetSpec;
use handeye_print::{Page, target_pdf};

use crate::messages::state::Severity;
use crate::text::Text;
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
