//! The archive: the one thread that writes the session. What it has reported is on the disk.

mod exported;
mod folders;
mod import;

use std::path::{Path, PathBuf};
use std::sync::Arc;

use crossbeam_channel::{Receiver, select};
use handeye_dataset::taught_poses::TaughtPose;
use handeye_files::bounds::Bounds;
use handeye_result::CalibrationResult;
use handeye_result::guided_record::{GUIDED_RECORD, GuidedRecord};
use handeye_session::{Document, Edit, SessionError, SessionMeta, Store};

use crate::capture::Measured;
use crate::capture::state::{CaptureRefused, CaptureWait, RefusalKind};
use crate::import::state::Converted;
use crate::messages::state::Severity;
use crate::session::state::{FolderKind, Observed, SessionState};
use crate::text::Text;
use crate::worker::files::kind_of;
use crate::worker::link::Outlet;
use crate::{capture, session};
use handeye_wording::text;

pub use folders::{free_folder, timestamp, timestamp_rfc3339};

/// What a session starts with.
#[derive(Debug, Clone)]
pub struct Beginning {
    /// Mode, target, camera, truth.
    pub meta: SessionMeta,
    /// Poses to visit.
    pub taught: Vec<TaughtPose>,
}

impl Beginning {
    /// A session without captures, with what is known about the cell here.
    fn within(&self, document: &Document) -> Document {
        let mut document = document.clone();
        document.meta.arm.clone_from(&self.meta.arm);
        document.meta.joint_kinds.clone_from(&self.meta.joint_kinds);
        document.meta.ground_truth.clone_from(&self.meta.ground_truth);
        document
    }
}

/// Requests to the archive.
#[derive(Debug)]
pub enum ArchiveTask {
    /// What a session starts with when the first change needs one. One that was started here, or whose cell is not known, adopts
    /// the cell as long as nothing was captured in it.
    Prepare(Box<Beginning>),
    /// Start a session in a folder; without one, under the folder of sessions.
    New {
        /// Where.
        folder: Option<PathBuf>,
        beginning: Box<Beginning>,
    },
    /// Continue a session, or start one with the images and poses of a data set.
    Open {
        folder: PathBuf,
        /// What its files may refer to.
        bounds: Bounds,
    },
    /// Start a session with the recorded sample that comes with the program.
    Sample,
    /// Start a session from a recording that was converted to a data set.
    Import(Arc<Converted>),
    /// Continue the session in a folder, or start one there if there is none.
    OpenOrNew {
        /// Where.
        folder: PathBuf,
        beginning: Box<Beginning>,
    },
    /// Continue with a complete copy in another folder.
    SaveAs(PathBuf),
    /// Change the document.
    Edit(Box<Edit>),
    /// Undo the last change.
    Undo,
    /// Redo the last undone change.
    Redo,
    /// Keep a result next to the captures it came from.
    Result {
        /// The session that it belongs to; a different one that is open by now does not get it.
        folder: PathBuf,
        result: Box<CalibrationResult>,
    },
    /// Keep the record of guided capture next to the captures.
    Guided {
        /// The session that it belongs to.
        folder: PathBuf,
        /// What was proposed, and what came of it.
        record: Box<GuidedRecord>,
    },
}

/// The session thread.
pub struct Archive {
    outlet: Outlet,
    sessions: PathBuf,
    beginning: Option<Beginning>,
    store: Option<Store>,
    /// Whether the open session was started by this program, and not opened.
    is_begun_here: bool,
}

impl Archive {
    /// Nothing is written before the first change. New sessions go under `sessions`.
    pub fn new(sessions: PathBuf, outlet: Outlet) -> Self {
        Self { outlet, sessions, beginning: None, store: None, is_begun_here: false }
    }

    /// Works until both channels are closed. What was handed in before that is still written.
    pub fn run(mut self, tasks: &Receiver<ArchiveTask>, captures: &Receiver<Measured>) {
        loop {
            select! {
                recv(tasks) -> task => match task {
                    Ok(task) => self.perform(task),
                    Err(_closed) => break,
                },
                recv(captures) -> measured => match measured {
                    Ok(measured) => self.keep(&measured),
                    Err(_closed) => break,
                },
            }
        }
        for task in tasks.try_iter() {
            self.perform(task);
        }
        for measured in captures.try_iter() {
            self.keep(&measured);
        }
    }

    fn perform(&mut self, task: ArchiveTask) {
        match task {
            ArchiveTask::Prepare(beginning) => {
                self.take_on(&beginning);
                self.beginning = Some(*beginning);
                if self.store.is_none() {
                    self.report_document();
                }
            }
            ArchiveTask::New { folder, beginning } => self.begin(folder, *beginning),
            ArchiveTask::Open { folder, bounds } => self.open(&folder, &bounds),
            ArchiveTask::Sample => self.import_sample(),
            ArchiveTask::Import(converted) => self.import_converted(&converted),
            ArchiveTask::OpenOrNew { folder, beginning } => {
                if kind_of(&folder) == FolderKind::Plain {
                    self.begin(Some(folder), *beginning);
                } else {
                    // It was named where this program was started.
                    self.open(&folder, &Bounds::ANYWHERE);
                }
            }
            ArchiveTask::SaveAs(folder) => self.save_as(&folder),
            ArchiveTask::Edit(edit) => self.change(|store| store.apply(*edit)),
            ArchiveTask::Undo => self.change(Store::undo),
            ArchiveTask::Redo => self.change(Store::redo),
            ArchiveTask::Result { folder, result } => self.keep_result(&folder, *result),
            ArchiveTask::Guided { folder, record } => self.keep_guided(&folder, &record),
        }
    }

    /// No captures of another cell are involved, and what the user stated for target, mode and poses is kept.
    fn take_on(&mut self, beginning: &Beginning) {
        let Some(document) = self.store.as_ref().map(Store::document) else { return };
        let meta = &document.meta;
        let is_unknown = meta.arm.is_none() && meta.joint_kinds.is_none() && meta.ground_truth.is_none();
        if self.is_begun_here || is_unknown {
            let of_cell = beginning.within(document);
            self.change(|store| store.begin_again(of_cell));
        }
    }

    fn open(&mut self, folder: &Path, bounds: &Bounds) {
        match kind_of(folder) {
            FolderKind::Dataset => return self.import(folder, bounds),
            FolderKind::Images | FolderKind::Plain if folder.exists() => {
                return self.outlet.report(crate::import::Event::NoSession(folder.to_path_buf()));
            }
            _ => {}
        }
        if self.store.as_ref().is_some_and(|store| store.folder() == folder) {
            self.outlet.report(session::Event::Opened { exported: exported::is_exported(folder) });
            return;
        }
        if let Err(error) = bounds.check_links(folder) {
            let why = text!("The session was not opened: {error}", error = error);
            return self.outlet.report(session::Event::Failed { why });
        }
        let opened = Store::open(folder);
        self.take(opened, |error| text!("The session was not opened: {error}", error = error));
    }

    fn begin(&mut self, folder: Option<PathBuf>, beginning: Beginning) {
        self.beginning = Some(beginning);
        let created = self.create(folder);
        let is_created = created.is_ok();
        self.take(created, |error| text!("The session could not be created: {error}", error = error));
        self.is_begun_here |= is_created;
    }

    /// A session for what has to be kept.
    fn create(&self, folder: Option<PathBuf>) -> Result<Store, SessionError> {
        let folder = folder.unwrap_or_else(|| free_folder(&self.sessions, &timestamp()));
        let Beginning { meta, taught } = self.beginning.clone().unwrap_or_else(|| Beginning {
            meta: crate::session::start::meta(None, timestamp_rfc3339()),
            taught: Vec::new(),
        });
        let mut document = Document::new(meta);
        document.taught = taught;
        Store::create_with(&folder, document)
    }

    /// The open session; one is started when there is something to keep and none is open.
    fn store(&mut self) -> Result<&mut Store, SessionError> {
        let store = if let Some(store) = self.store.take() {
            store
        } else {
            let store = self.create(None)?;
            self.is_begun_here = true;
            self.outlet.notice(Severity::Info, text!("New session in {folder}", folder = store.folder().display()));
            store
        };
        Ok(self.store.insert(store))
    }

    /// Continues with another session, or reports why not and stays with the present one.
    fn take(&mut self, store: Result<Store, SessionError>, words: impl FnOnce(SessionError) -> Text) {
        match store {
            Ok(store) => {
                let exported = exported::is_exported(store.folder());
                self.store = Some(store);
                self.is_begun_here = false;
                self.report_document();
                self.outlet.report(session::Event::Opened { exported });
            }
            Err(error) => self.outlet.report(session::Event::Failed { why: words(error) }),
        }
    }

    fn save_as(&mut self, folder: &Path) {
        let copied = self.store().and_then(|store| store.save_as(folder));
        self.take(copied, |error| text!("The session was not saved: {error}", error = error));
    }

    fn change<T>(&mut self, change: impl FnOnce(&mut Store) -> Result<T, SessionError>) {
        match self.store().and_then(change) {
            Ok(_changed) => self.report_document(),
            Err(error) if error.is_no_change() => self.report_document(),
            Err(error) => {
                // What is shown is what is on the disk.
                self.report_document();
                let text = text!("The change was not made: {error}", error = error);
                self.outlet.notice(Severity::Error, text);
            }
        }
    }

    fn keep(&mut self, measured: &Measured) {
        self.outlet.report(capture::Event::Waits { number: measured.number, wait: CaptureWait::Saving });
        let kept = self.store().and_then(|store| measured.record(store));
        match kept {
            Ok(id) => {
                let observed = Observed {
                    corners: Some(measured.corners.clone()),
                    depth: measured.depth_plane,
                    image_size: measured.rgb.dimensions(),
                    thumbnail: Arc::new(measured.thumbnail.clone()),
                };
                let target = measured.target;
                self.outlet.report(session::Event::Observed { id, target, observed: Some(Arc::new(observed)) });
                self.report_document();
                self.outlet.report(capture::Event::Captured { number: measured.number, id });
            }
            Err(error) => {
                let why = text!("The capture was not kept: {error}", error = error);
                let refused = CaptureRefused { kind: RefusalKind::NotSaved, why, at_s: self.outlet.now_s() };
                self.outlet.report(capture::Event::Refused { number: measured.number, refused });
            }
        }
    }

    /// The digest of the input is that of the files, so that the command line and the window write the same result.
    fn keep_result(&mut self, folder: &Path, mut result: CalibrationResult) {
        let Some(store) = self.store.as_mut().filter(|store| store.folder() == folder) else { return };
        match store.input_sha256() {
            Ok(digest) => result.provenance.input_sha256 = Some(digest),
            Err(error) => tracing::warn!(%error, "the digest of the session is not known"),
        }
        if let Err(error) = store.write_result(&result) {
            let text = text!("The result was not kept: {error}", error = error);
            self.outlet.notice(Severity::Warning, text);
        }
    }

    fn keep_guided(&self, folder: &Path, record: &GuidedRecord) {
        // Another session that is open by now does not get it.
        if self.store.as_ref().is_none_or(|store| store.folder() != folder) {
            return;
        }
        if let Err(error) = record.write(&folder.join(GUIDED_RECORD)) {
            let text = text!("The record of guided capture was not kept: {error}", error = error);
            self.outlet.notice(Severity::Warning, text);
        }
    }

    fn report_document(&self) {
        let state = match (&self.store, &self.beginning) {
            (Some(store), _) => SessionState {
                folder: Some(store.folder().to_path_buf()),
                document: Arc::clone(store.document()),
                undo: store.history().undo_edit().cloned(),
                redo: store.history().redo_edit().cloned(),
            },
            (None, Some(beginning)) => {
                let mut document = Document::new(beginning.meta.clone());
                document.taught.clone_from(&beginning.taught);
                SessionState { folder: None, document: Arc::new(document), undo: None, redo: None }
            }
            (None, None) => return,
        };
        self.outlet.report(session::Event::Document(Box::new(state)));
    }
}
