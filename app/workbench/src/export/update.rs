//! Exports.

use handeye_session::CaptureRecord;

use crate::app::App;
use crate::model::{Pane, Severity, Written, exports_of};
use crate::worker::{ExportJob, FileTask};
use handeye_wording::text;

impl App {
    fn export_job(&self) -> Option<Box<ExportJob>> {
        let solved = self.model.solve.current()?;
        let views = solved
            .captures
            .iter()
            .filter_map(|id| self.model.document().capture(*id))
            .filter(|capture| capture.is_in_use())
            .filter_map(CaptureRecord::export_view)
            .collect();
        let names = self.model.export.names.clone();
        Some(Box::new(ExportJob { result: solved.result.clone(), names, views }))
    }

    /// Has the text of every format made for the present result.
    pub(crate) fn preview_exports(&mut self) {
        self.model.export.previews.clear();
        if let Some(job) = self.export_job() {
            let asked = self.desk.files(FileTask::Preview(job));
            self.expect(text!("The exports are not shown"), asked);
        }
    }

    pub(crate) fn export(&mut self) {
        let Some(job) = self.export_job() else {
            self.say(Severity::Warning, text!("There is nothing to export yet: solve first"));
            return;
        };
        let state = &self.model.export;
        let formats: Vec<String> = state.chosen.iter().cloned().collect();
        let folder = state.folder.clone().or_else(|| self.model.session.folder.as_deref().map(exports_of));
        let Some(folder) = folder.filter(|_| !formats.is_empty()) else {
            self.say(Severity::Warning, text!("Choose at least one format, and a folder"));
            return;
        };
        let asked = self.desk.files(FileTask::Export { job, formats, folder });
        self.model.export.writing = asked.is_ok();
        self.expect(text!("Nothing was exported"), asked);
    }

    pub(crate) fn written(&mut self, written: Written) {
        self.model.export.writing = false;
        match &written.files {
            Ok(files) => {
                self.model.export.is_present = true;
                let count = files.len();
                let said = text!("{count} {count|file|files} written, read back and compared", count = count);
                self.say_in(Pane::Export, Severity::Info, said);
            }
            Err(why) => {
                let said = text!("Nothing was exported: {why}", why = why);
                self.say_in(Pane::Export, Severity::Error, said);
            }
        }
        self.model.export.written = Some(written);
    }
}
