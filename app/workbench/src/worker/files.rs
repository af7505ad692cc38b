//! Reading and writing that belongs to one click: images of a capture, folders, exports, pose files.

use std::io;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::thread::Builder;

use handeye_dataset as dataset;
use handeye_dataset::taught_poses::{TaughtPose, TaughtPoses};
use handeye_export::{ExportInput, ExportNames, ExportView, Format};
use handeye_geometry::depth::{ColourMap, DepthImage};
use handeye_geometry::targets::TargetSpec;
use handeye_plan::surroundings::KeepOutFile;
use handeye_print::Page;
use handeye_result::CalibrationResult;
use handeye_session::{CaptureRecord, Session};

use super::link::Outlet;
use crate::export::state::{PreviewFile, Written};
use crate::live::depth;
use crate::live::state::{ColouredDepth, FrameImages};
use crate::messages::state::Severity;
use crate::session::state::{FolderEntry, FolderKind, FolderListing};
use crate::settings::SettingsWrite;
use crate::text::Text;
use crate::{export, keep_out, messages, session, taught};
use handeye_wording::text;

/// What can be requested.
pub enum FileTask {
    /// The images of a capture.
    Review {
        /// The session.
        folder: PathBuf,
        capture: Box<CaptureRecord>,
        /// The colours of its depths.
        colours: ColourMap,
    },
    /// The folders in a folder.
    List(PathBuf),
    /// A folder in the file manager of the system.
    OpenFolder(PathBuf),
    /// The text of every format.
    Preview(Box<ExportJob>),
    /// Write the chosen formats.
    Export {
        job: Box<ExportJob>,
        /// Names of formats.
        formats: Vec<String>,
        /// Where.
        folder: PathBuf,
    },
    /// Read taught poses.
    ReadPoses(PathBuf),
    /// Read boxes to keep out of.
    ReadKeepOut(PathBuf),
    /// Write boxes to keep out of.
    WriteKeepOut {
        /// Where.
        file: PathBuf,
        text: String,
        /// Whether the user waits for it to be reported.
        is_wished: bool,
    },
    /// Write a board for a printer.
    PrintTarget {
        target: TargetSpec,
        page: Page,
        /// Where.
        file: PathBuf,
    },
    /// Write the settings.
    Settings(SettingsWrite),
    /// Write taught poses.
    WritePoses {
        /// Where.
        file: PathBuf,
        poses: Vec<TaughtPose>,
        /// Which joints of the arm are prismatic, counted from 0 at the base.
        prismatic: Vec<usize>,
    },
}

/// What exports are made of.
#[derive(Debug, Clone)]
pub struct ExportJob {
    pub result: CalibrationResult,
    /// Names of frames and files.
    pub names: ExportNames,
    /// Views with their robot poses.
    pub views: Vec<ExportView>,
}

impl ExportJob {
    fn input(&self) -> ExportInput<'_> {
        ExportInput { result: &self.result, names: &self.names, views: &self.views }
    }
}

/// Does one task after the other and reports each.
pub fn perform(task: FileTask, outlet: &Outlet) {
    match task {
        FileTask::Review { folder, capture, colours } => review(&folder, &capture, colours, outlet),
        FileTask::List(folder) => outlet.report(session::Event::Folder(list(folder))),
        FileTask::OpenFolder(folder) => open_folder(folder, |folder| open::that(folder), outlet),
        FileTask::Preview(job) => outlet.report(export::Event::Previews(preview(&job))),
        FileTask::Export { job, formats, folder } => {
            let files = write(&job, &formats, &folder);
            outlet.report(export::Event::Written(Written { folder, files }));
        }
        FileTask::Settings(settings) => {
            if let Err(warning) = settings.perform() {
                outlet.report(messages::Event::from(warning));
            }
        }
        FileTask::PrintTarget { target, page, file } => {
            let (severity, message) = crate::target::print::write(&target, page, &file);
            outlet.notice(severity, message);
        }
        FileTask::ReadKeepOut(file) => {
            match KeepOutFile::read(&file).and_then(|content| content.surroundings(&file).map(|_around| content)) {
                Ok(content) => outlet.report(keep_out::Event::Read(Box::new(content))),
                Err(error) => outlet.notice(Severity::Error, text!("The boxes were not read: {error}", error = error)),
            }
        }
        FileTask::WriteKeepOut { file, text, is_wished } => match keep_out::file::write(&file, &text) {
            Ok(()) if is_wished => {
                outlet.notice(Severity::Info, text!("Boxes written to {file}", file = file.display()));
            }
            Ok(()) => {}
            Err(error) => {
                let text = text!("The boxes were not written to {file}: {error}", file = file.display(), error = error);
                outlet.notice(Severity::Error, text);
            }
        },
        FileTask::ReadPoses(file) => match TaughtPoses::read(&file) {
            Ok(taught) => outlet.report(taught::Event::Read { poses: taught.poses }),
            Err(error) => outlet.notice(Severity::Error, text!("The poses were not read: {error}", error = error)),
        },
        FileTask::WritePoses { file, poses, prismatic } => {
            let taught = TaughtPoses { prismatic, start_joints_rad: None, limits: None, poses };
            match taught.write(&file) {
                Ok(()) => outlet.notice(Severity::Info, text!("Poses written to {file}", file = file.display())),
                Err(error) => {
                    outlet.notice(Severity::Error, text!("The poses were not written: {error}", error = error));
                }
            }
        }
    }
}

fn review(folder: &Path, capture: &CaptureRecord, colours: ColourMap, outlet: &Outlet) {
    match images(folder, capture, colours) {
        Ok(images) => outlet.report(session::Event::Review { id: capture.id, images: Some(Arc::new(images)) }),
        Err(why) => {
            let text = text!("Capture {id} cannot be read: {why}", id = capture.id, why = why);
            outlet.notice(Severity::Error, text);
        }
    }
}

fn images(folder: &Path, capture: &CaptureRecord, colours: ColourMap) -> Result<FrameImages, Text> {
    let session = Session::open(folder)?;
    let rgb = session.load_rgb(capture)?;
    let depth = session.load_depth_m(capture)?;
    let coloured = |metres: DepthImage| {
        // A recorded depth has its far plane in it: nothing is behind it.
        let far_plane_m = metres.metres.iter().copied().filter(|m| m.is_finite()).fold(0.0, f32::max).max(1e-3);
        let range_m = depth::range_of(&metres, far_plane_m, None).unwrap_or([0.0, far_plane_m]);
        Ok::<_, Text>(ColouredDepth::new(metres, colours, range_m, far_plane_m)?)
    };
    Ok(FrameImages { rgb, depth: depth.map(coloured).transpose()? })
}

/// Has a program show a folder, until the program ends; reports where the folder is if there is none.
fn open_folder(folder: PathBuf, show: impl FnOnce(&Path) -> io::Result<()> + Send + 'static, outlet: &Outlet) {
    if !folder.is_dir() {
        let message = text!("{folder} is not there yet: it is made with the first capture", folder = folder.display());
        return outlet.notice(Severity::Warning, message);
    }
    // The program may stay as long as its window.
    let outlet = outlet.clone();
    let waited = Builder::new().name("file manager".to_owned()).spawn(move || {
        if let Err(error) = show(&folder) {
            let message = text!("No program shows the folder {folder}: {why}", folder = folder.display(), why = error);
            outlet.notice(Severity::Warning, message);
        }
    });
    tracing::debug!(?waited, "a folder is shown");
}

/// Folders with what they are, sessions first, and files of poses.
fn list(folder: PathBuf) -> FolderListing {
    let read = || -> io::Result<Vec<FolderEntry>> {
        let mut entries = Vec::new();
        for entry in std::fs::read_dir(&folder)? {
            let path = entry?.path();
            let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
            let kind = if path.is_dir() { kind_of(&path) } else { FolderKind::File };
            let is_poses = path.extension().is_some_and(|extension| extension == "toml");
            if name.starts_with('.') || (kind == FolderKind::File && !is_poses) {
                continue;
            }
            entries.push(FolderEntry { name, kind });
        }
        entries.sort_by(|a, b| (a.kind, &a.name).cmp(&(b.kind, &b.name)));
        Ok(entries)
    };
    let entries = match read() {
        // The folder of sessions is made with the first of them.
        Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(Vec::new()),
        read => read.map_err(|error| error.to_string()),
    };
    FolderListing { folder, entries }
}

/// What kind of folder it is.
pub fn kind_of(folder: &Path) -> FolderKind {
    if Session::is_session(folder) {
        FolderKind::Session
    } else if folder.join(dataset::DESCRIPTION).is_file() {
        FolderKind::Dataset
    } else if dataset::holds_images(folder) {
        FolderKind::Images
    } else {
        FolderKind::Plain
    }
}

fn preview(job: &ExportJob) -> Vec<(String, Result<Vec<PreviewFile>, Text>)> {
    handeye_export::formats()
        .iter()
        .map(|format| {
            let files = handeye_export::preview(*format, &job.input())
                .map_err(Text::from)
                .map(|files| files.into_iter().map(|file| PreviewFile { name: file.name, text: file.text }).collect());
            (format.name().to_owned(), files)
        })
        .collect()
}

fn write(job: &ExportJob, formats: &[String], folder: &Path) -> Result<Vec<PathBuf>, Text> {
    let formats: Vec<&dyn Format> =
        formats.iter().map(|name| handeye_export::by_name(name)).collect::<Result<_, _>>()?;
    Ok(handeye_export::write_all(folder, &formats, &job.input())?)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::command::Event;
    use crate::text::Language;

    /// Collects reports until all senders are gone.
    fn message(folder: &Path, is_shown: bool) -> Vec<String> {
        let show = move |_: &Path| if is_shown { Ok(()) } else { Err(io::Error::other("no program")) };
        let (events, reported) = crossbeam_channel::bounded(4);
        let outlet = Outlet { events, waker: Arc::new(|| {}), clock: Arc::new(|| 0.0) };
        open_folder(folder.to_path_buf(), show, &outlet);
        drop(outlet);
        let notices = reported.iter().map(|event| match event {
            Event::Messages(messages::Event::Notice { text, .. }) => text.in_language(Language::English),
            other => panic!("{other:?}"),
        });
        notices.collect()
    }

    #[test]
    fn a_folder_of_sessions_that_is_not_there_yet_is_empty_and_one_that_cannot_be_read_says_so() {
        let folder = tempfile::tempdir().expect("a folder");
        assert_eq!(list(folder.path().join("handeye")).entries, Ok(Vec::new()));
        let file = folder.path().join("file");
        std::fs::write(&file, "").expect("written");
        assert!(list(file).entries.is_err());
    }

    #[test]
    fn a_folder_that_nothing_can_show_is_named() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().display().to_string();
        assert_eq!(message(folder.path(), false), [format!("No program shows the folder {path}: no program")]);
        let words = message(&folder.path().join("later"), false);
        assert_eq!(words, [format!("{path}/later is not there yet: it is made with the first capture")]);
        assert!(message(folder.path(), true).is_empty());
    }
}
