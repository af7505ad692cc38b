//! The dialog and the step in front, and how the window looks.

use super::command::Command;
use crate::import::update::forget_import;
use crate::model::Model;
use crate::session::desk::SessionThreads;
use crate::session::requests::list_folder;
use crate::shell::state::Dialog;

/// Does what is wanted of the window.
pub(crate) fn apply(model: &mut Model, desk: &SessionThreads, command: Command) {
    match command {
        Command::SetTheme(theme) => model.view.theme = theme,
        Command::SetLanguage(language) => model.view.language = language,
        Command::SetRotationFormat(format) => model.view.rotation = format,
        Command::GoToStep(step) => model.step = step,
        Command::SetDialog(dialog) => set_dialog(model, desk, dialog),
        // The places of the panes are kept by the window.
        Command::ShowPane(_) | Command::ResetLayout => {}
    }
}

pub(crate) fn set_dialog(model: &mut Model, desk: &SessionThreads, dialog: Option<Dialog>) {
    model.dialog = dialog;
    if dialog != Some(Dialog::Import) {
        forget_import(model, desk);
    }
    if matches!(
        model.dialog,
        Some(
            Dialog::Open
                | Dialog::SaveAs
                | Dialog::New
                | Dialog::ImportPoses
                | Dialog::ExportPoses
                | Dialog::ExportFolder
        )
    ) {
        let folder = model.folder.as_ref().map_or_else(|| desk.sessions().to_path_buf(), |it| it.folder.clone());
        list_folder(model, desk, folder);
    }
}
