//! What can be reached from a browser: its user need not be the one who started the program.

use std::path::{Path, PathBuf};

use handeye_files::bounds::Bounds;

use crate::command::Command;
use crate::text::Text;
use crate::{connect, export, keep_out, session, taught};
use handeye_link::{CellSource, Drivers};
use handeye_wording::text;

/// Folders that are read and written for browsers, and programs that are started for them.
#[derive(Debug, Clone, Default)]
pub struct Reach {
    folders: Vec<Bounds>,
    /// Each folder in it is one user's upload.
    uploads: Option<PathBuf>,
    drivers: Vec<Drivers>,
}

impl Reach {
    /// These folders with everything in them.
    pub fn new(folders: impl IntoIterator<Item = PathBuf>) -> Self {
        Self { folders: folders.into_iter().map(|folder| Bounds::within(&folder)).collect(), ..Self::default() }
    }

    /// With a folder that holds one folder per upload: an uploader learns nothing about what else is here.
    #[must_use]
    pub fn with_uploads(self, folder: PathBuf) -> Self {
        Self { uploads: Some(folder), ..self }
    }

    /// Drivers that may be started: those that a user at this machine has started before.
    #[must_use]
    pub fn with_drivers(self, drivers: Vec<Drivers>) -> Self {
        Self { drivers, ..self }
    }

    /// Whether a file or folder, which need not exist, is in one of the folders. Links are followed.
    pub fn has(&self, path: &Path) -> bool {
        self.folders.iter().any(|folder| folder.has(path))
    }

    /// What files in a folder may refer to: in an upload, only files of the upload; elsewhere, files of the folder that
    /// browsers reach.
    pub(crate) fn bounds_of(&self, path: &Path) -> Bounds {
        let upload = self.uploads.as_ref().and_then(|uploads| {
            let own = path.strip_prefix(uploads).ok()?.components().next()?;
            Some(Bounds::within(&uploads.join(own))).filter(|upload| upload.has(path))
        });
        let reached = || self.folders.iter().filter(|folder| folder.has(path));
        // The innermost.
        let depth = |bounds: &&Bounds| bounds.folder().map_or(0, |folder| folder.components().count());
        upload.or_else(|| reached().max_by_key(depth).cloned()).unwrap_or_else(|| Bounds::within(path))
    }

    /// Why a command is not carried out; `None` if it may be.
    pub(crate) fn refusal(&self, command: &Command) -> Option<Text> {
        match command {
            Command::Session(
                session::Command::Open(path)
                | session::Command::SaveAs(path)
                | session::Command::ListFolder(path)
                | session::Command::OpenFolder(path)
                | session::Command::New(Some(path)),
            )
            | Command::Export(export::Command::SetFolder(Some(path)))
            | Command::KeepOut(keep_out::Command::Import(path) | keep_out::Command::Export(path))
            | Command::Taught(taught::Command::Import(path) | taught::Command::Export(path))
                if !self.has(path) =>
            {
                Some(text!(
                    "From a browser {path} cannot be reached: start `handeye serve` with --allow and its folder",
                    path = path.display()
                ))
            }
            Command::Connect(connect::Command::Connect(CellSource::Drivers(drivers))) if !self.may_start(drivers) => {
                Some(text!(
                    "From a browser no program is started that was not started here before: start `handeye serve` with \
                 --driver, or give an address tcp://HOST:PORT"
                ))
            }
            _ => None,
        }
    }

    fn may_start(&self, drivers: &Drivers) -> bool {
        let is_address = |driver: &Option<String>| driver.as_ref().is_none_or(|driver| driver.starts_with("tcp://"));
        (is_address(&drivers.robot) && is_address(&drivers.camera)) || self.drivers.contains(drivers)
    }
}

/// What files in a folder that is opened may refer to: anything, if the user is at this machine.
pub(crate) fn bounds_of(reach: Option<&Reach>, path: &Path) -> Bounds {
    reach.map_or(Bounds::ANYWHERE, |reach| reach.bounds_of(path))
}

#[cfg(test)]
mod tests {
    use super::*;

    use crate::solve;

    #[test]
    fn what_is_outside_is_not_reached_by_any_way() {
        let base = tempfile::tempdir().expect("a folder");
        let inside = base.path().join("sessions");
        std::fs::create_dir_all(inside.join("one")).expect("made");
        std::fs::create_dir(base.path().join("sessions of others")).expect("made");
        std::os::unix::fs::symlink(base.path(), inside.join("out")).expect("linked");
        let reach = Reach::new([inside.clone()]);
        for path in ["", "one", "one/new/folder", "one/../one"] {
            assert!(reach.has(&inside.join(path)), "{path}");
        }
        for path in ["..", "../sessions of others", "out", "out/x", "one/../../x", "new/../../x", "/etc/passwd"] {
            assert!(!reach.has(&inside.join(path)), "{path}");
        }
        assert!(reach.refusal(&Command::Session(session::Command::Open(PathBuf::from("/etc")))).is_some());
        assert!(reach.refusal(&Command::Session(session::Command::Open(inside))).is_none());
        assert!(reach.refusal(&Command::Solve(solve::Command::Solve)).is_none());
    }

    #[test]
    fn an_upload_names_what_is_in_it_and_another_folder_what_browsers_reach() {
        let base = tempfile::tempdir().expect("a folder");
        let uploads = base.path().join("sessions/uploads");
        for folder in ["sessions/uploads/1/set", "sessions/uploads/2", "sessions/monday", "data/set", "data/images"] {
            std::fs::create_dir_all(base.path().join(folder)).expect("made");
        }
        let reach = Reach::new(["sessions", "data"].map(|name| base.path().join(name))).with_uploads(uploads.clone());
        let has = |of: &str, path: &str| reach.bounds_of(&base.path().join(of)).has(&base.path().join(path));
        assert!(has("sessions/uploads/1/set", "sessions/uploads/1/other.png"));
        assert!(!has("sessions/uploads/1/set", "sessions/uploads/2/a.png"));
        assert!(!has("sessions/uploads/1/set", "sessions/monday/images/0001.png"));
        assert!(has("data/set", "data/images/1.png"), "the folder was allowed with all that is in it");
        assert!(!has("data/set", "sessions/monday/images/0001.png") && !has("data/set", "private.png"));
        assert!(!has("elsewhere", "data/set"));
    }

    #[test]
    fn programs_are_started_from_a_browser_only_if_they_were_started_before() {
        let driver = |robot: &str| Drivers { robot: Some(robot.to_owned()), camera: None };
        let connect = |robot: &str| Command::Connect(connect::Command::Connect(CellSource::Drivers(driver(robot))));
        let reach = Reach::default().with_drivers(vec![driver("python3 mine.py")]);
        assert!(reach.refusal(&connect("rm -r /")).is_some());
        assert!(reach.refusal(&connect("python3 mine.py")).is_none());
        assert!(reach.refusal(&connect("tcp://127.0.0.1:9")).is_none());
    }
}
