//! The purpose of each dialog: its words, its start folder, and its result.

use std::path::{Path, PathBuf};

use handeye_workbench::command::Command;
use handeye_workbench::model::{Dialog, Model, exports_of};
use handeye_workbench::text::Language;
use handeye_workbench::tr;
use handeye_workbench::{export, keep_out, session, taught};

/// Name of a new file of poses.
const POSES_FILE: &str = "poses.toml";
/// Name of a new file of boxes to keep out of.
const KEEP_OUT_FILE: &str = "keep_out.toml";

/// A dialog.
pub struct Purpose {
    pub dialog: Dialog,
    pub title: &'static str,
    /// What to do.
    pub hint: &'static str,
    /// Label of its button.
    pub action: &'static str,
    /// Hint of the empty field.
    pub empty_hint: &'static str,
}

impl Purpose {
    /// In the language of the window.
    pub fn of(dialog: Dialog, language: Language) -> Self {
        let (title, hint, action) = match dialog {
            Dialog::SaveAs => (
                tr!(language, "Save a copy of the session"),
                tr!(language, "The copy is complete, and work goes on in it."),
                tr!(language, "Save the copy"),
            ),
            Dialog::New => (
                tr!(language, "New session"),
                tr!(language, "Everything that is captured is kept in a folder of its own from the start."),
                tr!(language, "Begin"),
            ),
            Dialog::ImportPoses => (
                tr!(language, "Import taught poses"),
                tr!(language, "The poses of the file come after those that are there."),
                tr!(language, "Import"),
            ),
            Dialog::ExportPoses => (
                tr!(language, "Export taught poses"),
                tr!(language, "A file that can be read, edited and imported again."),
                tr!(language, "Write"),
            ),
            Dialog::ImportKeepOut => (
                tr!(language, "Read keep-out boxes"),
                tr!(language, "The boxes of the file come in place of those that are there."),
                tr!(language, "Read"),
            ),
            Dialog::ExportKeepOut => (
                tr!(language, "Write keep-out boxes"),
                tr!(language, "A file that “handeye auto --keep-out” takes, too."),
                tr!(language, "Write"),
            ),
            Dialog::ExportFolder => (
                tr!(language, "Folder for exports"),
                tr!(language, "A folder that is not there is made."),
                tr!(language, "Choose"),
            ),
            _ => (
                tr!(language, "Open a session, data set or recording"),
                tr!(
                    language,
                    "A data set or a recording of another program is copied into a new session and stays as it is."
                ),
                tr!(language, "Open"),
            ),
        };
        Self {
            dialog,
            title,
            hint,
            action,
            empty_hint: if dialog == Dialog::New {
                tr!(language, "Empty: a new folder among the sessions")
            } else {
                tr!(language, "A path")
            },
        }
    }

    /// Whether the last part of the path is a new name, which stays when another folder is listed.
    pub fn is_named(&self) -> bool {
        matches!(self.dialog, Dialog::SaveAs | Dialog::New | Dialog::ExportPoses | Dialog::ExportKeepOut)
    }

    /// Whether Enter on a path that was typed lists it first.
    pub fn enters_typed(&self) -> bool {
        matches!(self.dialog, Dialog::Open | Dialog::ImportPoses | Dialog::ImportKeepOut)
    }

    /// Whether files are shown.
    pub fn shows_files(&self) -> bool {
        matches!(self.dialog, Dialog::ImportPoses | Dialog::ExportPoses | Dialog::ImportKeepOut | Dialog::ExportKeepOut)
    }

    /// Whether the dialog stays until its outcome is known.
    pub fn is_awaited(&self) -> bool {
        matches!(self.dialog, Dialog::Open | Dialog::SaveAs | Dialog::New)
    }

    /// The initial path.
    pub fn first_path(&self, model: &Model) -> String {
        let folder = first_folder(model);
        match &self.dialog {
            Dialog::New => String::new(),
            Dialog::ExportPoses => joined(&folder, POSES_FILE),
            Dialog::ExportKeepOut => joined(&folder, KEEP_OUT_FILE),
            Dialog::SaveAs => {
                let name = model.session.name().unwrap_or_else(|| "session".to_owned());
                joined(&folder, &format!("{name}-copy"))
            }
            Dialog::ExportFolder => {
                let session = model.session.folder.as_deref().map(exports_of);
                let chosen = model.export.folder.clone().or(session);
                chosen.unwrap_or(folder).display().to_string()
            }
            _ => folder.display().to_string(),
        }
    }

    /// The path when another folder is listed.
    pub fn path_in(&self, folder: &Path, typed: &str) -> String {
        match Path::new(typed.trim()).file_name().filter(|_| self.is_named()) {
            Some(name) => folder.join(name).display().to_string(),
            None if self.dialog == Dialog::New => joined(folder, "session"),
            None => folder.display().to_string(),
        }
    }

    /// The command for a path; `None` if the path is not sufficient.
    pub fn command(&self, typed: &str) -> Option<Command> {
        let path = PathBuf::from(typed);
        if typed.is_empty() {
            return (self.dialog == Dialog::New).then_some(session::Command::New(None).into());
        }
        let is_file = path.extension().is_some_and(|extension| extension == "toml");
        match self.dialog {
            Dialog::Open => Some(session::Command::Open(path).into()),
            Dialog::SaveAs => Some(session::Command::SaveAs(path).into()),
            Dialog::New => Some(session::Command::New(Some(path)).into()),
            Dialog::ImportPoses => is_file.then_some(taught::Command::Import(path).into()),
            Dialog::ExportPoses | Dialog::ExportKeepOut => {
                let named = if is_file { path } else { PathBuf::from(format!("{typed}.toml")) };
                let is_poses = self.dialog == Dialog::ExportPoses;
                Some(if is_poses {
                    taught::Command::Export(named).into()
                } else {
                    keep_out::Command::Export(named).into()
                })
            }
            Dialog::ImportKeepOut => is_file.then_some(keep_out::Command::Import(path).into()),
            Dialog::ExportFolder => Some(export::Command::SetFolder(Some(path)).into()),
            Dialog::Help | Dialog::Palette | Dialog::About | Dialog::RerunAddress | Dialog::Import => None,
        }
    }
}

/// Where to look first: the folder that was shown last, or the one with the session that is or was open.
pub fn first_folder(model: &Model) -> PathBuf {
    let listed = model.folder.as_ref().map(|listing| listing.folder.clone());
    let session = model.session.folder.as_deref().or(model.recent.first().map(|recent| recent.folder.as_path()));
    let beside = session.and_then(Path::parent).filter(|parent| !parent.as_os_str().is_empty());
    listed.or_else(|| beside.map(Path::to_path_buf)).unwrap_or_else(|| PathBuf::from("."))
}

/// The folder that a folder is in; the topmost is in itself.
pub fn above(folder: &Path) -> PathBuf {
    let is_up = folder.as_os_str().is_empty() || folder == Path::new(".") || folder.ends_with("..");
    match folder.parent() {
        Some(parent) if !is_up && !parent.as_os_str().is_empty() => parent.to_path_buf(),
        Some(_) if !is_up => PathBuf::from("."),
        None if folder.is_absolute() => folder.to_path_buf(),
        _ => folder.join("../.."),
    }
}

/// A name in a folder, as text.
pub fn joined(folder: &Path, name: &str) -> String {
    folder.join(name).display().to_string()
}
