//! Exports.

use handeye_export::ExportNames;
use handeye_session::{CaptureRecord, Edit};

use super::command::{Command, Event};
use crate::export::state::Written;
use crate::live::state::exports_of;
use crate::messages::state::Severity;
use crate::model::Model;
use crate::session::desk::SessionThreads;
use crate::session::requests::edit;
use crate::shell::state::Pane;
use crate::worker::files::{ExportJob, FileTask};
use handeye_wording::text;

/// Does what is wanted of exports.
pub(crate) fn apply(model: &mut Model, desk: &SessionThreads, command: Command) {
    match command {
        Command::ChooseFormats(formats) => model.export.chosen = formats,
        Command::ShowFormat(format) => model.export.shown = format,
        Command::SetNames(names) => set_export_names(model, desk, names),
        Command::SetFolder(folder) => model.export.folder = folder,
        Command::Export => export(model, desk),
    }
}

/// Takes in what was written.
pub(crate) fn absorb(model: &mut Model, event: Event) {
    match event {
        Event::Previews(previews) => model.export.previews = previews.into_iter().collect(),
        Event::Written(files) => written(model, files),
    }
}

fn export_job(model: &Model) -> Option<Box<ExportJob>> {
    let solved = model.solve.current()?;
    let views = solved
        .captures
        .iter()
        .filter_map(|id| model.document().capture(*id))
        .filter(|capture| capture.is_in_use())
        .filter_map(CaptureRecord::export_view)
        .collect();
    let names = model.export.names.clone();
    Some(Box::new(ExportJob { result: solved.result.clone(), names, views }))
}

/// Has the text of every format made for the present result.
pub(crate) fn preview_exports(model: &mut Model, desk: &SessionThreads) {
    model.export.previews.clear();
    if let Some(job) = export_job(model) {
        let asked = desk.files(FileTask::Preview(job));
        model.notify_if_refused(text!("The exports are not shown"), asked);
    }
}

fn export(model: &mut Model, desk: &SessionThreads) {
    let Some(job) = export_job(model) else {
        model.notify(Severity::Warning, text!("There is nothing to export yet: solve first"));
        return;
    };
    let state = &model.export;
    let formats: Vec<String> = state.chosen.iter().cloned().collect();
    let folder = state.folder.clone().or_else(|| model.session.folder.as_deref().map(exports_of));
    let Some(folder) = folder.filter(|_| !formats.is_empty()) else {
        model.notify(Severity::Warning, text!("Choose at least one format, and a folder"));
        return;
    };
    let asked = desk.files(FileTask::Export { job, formats, folder });
    model.export.writing = asked.is_ok();
    model.notify_if_refused(text!("Nothing was exported"), asked);
}

fn written(model: &mut Model, written: Written) {
    model.export.writing = false;
    match &written.files {
        Ok(files) => {
            model.export.is_present = true;
            let count = files.len();
            let reported = text!("{count} {count|file|files} written, read back and compared", count = count);
            model.notify_in(Pane::Export, Severity::Info, reported);
        }
        Err(why) => {
            let reported = text!("Nothing was exported: {why}", why = why);
            model.notify_in(Pane::Export, Severity::Error, reported);
        }
    }
    model.export.written = Some(written);
}

fn set_export_names(model: &mut Model, desk: &SessionThreads, names: ExportNames) {
    match serde_json::to_value(&names) {
        Ok(value) => edit(model, desk, Edit::SetExportNames(value)),
        Err(error) => model.notify(Severity::Error, text!("The names cannot be kept: {why}", why = error.to_string())),
    }
    model.export.names = names;
    preview_exports(model, desk);
}
