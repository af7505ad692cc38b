//! The session: its document, its captures and what was seen in them.

use std::path::PathBuf;
use std::sync::Arc;

use handeye_dataset::CameraInput;
use handeye_dataset::taught_poses::TaughtPose;
use handeye_estimate::handeye::Mode;
use handeye_export::ExportNames;
use handeye_geometry::targets::TargetSpec;
use handeye_session::{CaptureId, Edit, Role};

use crate::app::App;
use crate::model::{CapturePurpose, Dialog, FrameImages, Observed, RecentSession, Review, SessionState, Severity};
use crate::session::start;
use crate::taught::update::reference_poses;
use crate::text::Text;
use crate::worker::{ArchiveTask, Beginning, FileTask, ObserveJob, VisionTask, timestamp_rfc3339};
use handeye_wording::text;

impl App {
    /// What a new session begins with, by what is known of the cell.
    fn beginning(&self) -> Box<Beginning> {
        let cell = self.model.cell.as_ref();
        let mut meta = start::meta(cell.and_then(|cell| cell.truth.as_ref()), timestamp_rfc3339());
        meta.arm = start::arm(cell.and_then(|cell| cell.arm.as_ref()));
        meta.joint_kinds = cell.and_then(|cell| start::joint_kinds(cell.joints.iter().map(|joint| joint.kind)));
        // They would send any other arm somewhere.
        let poses = if self.model.has_reference_poses() { reference_poses() } else { Vec::new() };
        let cell = self.model.taught_on(meta.target);
        let taught = poses.into_iter().map(|pose| TaughtPose { cell: cell.clone(), ..pose }).collect();
        Box::new(Beginning { meta, taught })
    }

    /// Says what a session begins with while there is none on the disk.
    pub(crate) fn prepare_session(&mut self) {
        if self.model.session.folder.is_none() {
            self.ask_archive(ArchiveTask::Prepare(self.beginning()));
        }
    }

    fn ask_archive(&mut self, task: ArchiveTask) {
        let asked = self.desk.archive(task);
        if asked.is_err() {
            self.say(Severity::Error, text!("The disk does not keep up: nothing was changed. Try again in a moment"));
        }
    }

    /// Changes the document. It is shown when it is on the disk.
    pub(crate) fn edit(&mut self, edit: Edit) {
        self.ask_archive(ArchiveTask::Edit(Box::new(edit)));
    }

    pub(crate) fn undo(&mut self) {
        if self.model.session.undo.is_some() {
            self.ask_archive(ArchiveTask::Undo);
        }
    }

    pub(crate) fn redo(&mut self) {
        if self.model.session.redo.is_some() {
            self.ask_archive(ArchiveTask::Redo);
        }
    }

    pub(crate) fn set_excluded(&mut self, ids: Vec<CaptureId>, excluded: bool) {
        self.edit(Edit::SetExcluded { ids, excluded });
    }

    pub(crate) fn set_purpose(&mut self, ids: Vec<CaptureId>, purpose: CapturePurpose) {
        let role = match purpose {
            CapturePurpose::Calibrate => Role::Calibration,
            CapturePurpose::Verify => Role::Verification,
        };
        self.edit(Edit::SetRole { ids, role });
    }

    pub(crate) fn delete(&mut self, ids: Vec<CaptureId>) {
        if !ids.is_empty() {
            self.edit(Edit::DeleteCaptures(ids));
        }
    }

    pub(crate) fn set_target(&mut self, target: TargetSpec) {
        self.forget_guided();
        self.edit(Edit::SetTarget(target));
    }

    pub(crate) fn set_mode(&mut self, mode: Mode) {
        self.forget_guided();
        self.edit(Edit::SetMode(mode));
    }

    pub(crate) fn set_camera(&mut self, camera: Option<CameraInput>) {
        self.edit(Edit::SetCamera(camera));
    }

    pub(crate) fn set_export_names(&mut self, names: ExportNames) {
        match serde_json::to_value(&names) {
            Ok(value) => self.edit(Edit::SetExportNames(value)),
            Err(error) => self.say(Severity::Error, text!("The names cannot be kept: {why}", why = error.to_string())),
        }
        self.model.export.names = names;
        self.preview_exports();
    }

    pub(crate) fn new_session(&mut self, folder: Option<PathBuf>) {
        self.model.opening = true;
        self.ask_archive(ArchiveTask::New { folder, beginning: self.beginning() });
    }

    /// Goes on with a session; a data set is copied into one.
    pub(crate) fn open(&mut self, folder: PathBuf) {
        self.model.opening = true;
        let bounds = self.bounds_of(&folder);
        self.ask_archive(ArchiveTask::Open { folder, bounds });
    }

    /// A copy of the sample in a session of its own.
    pub(crate) fn open_sample(&mut self) {
        self.model.opening = true;
        self.ask_archive(ArchiveTask::Sample);
    }

    /// Goes on with the session in a folder, or begins one there.
    pub(crate) fn open_or_begin(&mut self, folder: PathBuf) {
        self.model.opening = true;
        self.ask_archive(ArchiveTask::OpenOrNew { folder, beginning: self.beginning() });
    }

    pub(crate) fn save_as(&mut self, folder: PathBuf) {
        self.model.opening = true;
        self.ask_archive(ArchiveTask::SaveAs(folder));
    }

    pub(crate) fn list_folder(&mut self, folder: PathBuf) {
        let asked = self.desk.files(FileTask::List(folder));
        self.expect(text!("The folder was not read"), asked);
    }

    /// Shows a folder in the program of the system for that.
    pub(crate) fn open_folder(&mut self, folder: PathBuf) {
        let asked = self.desk.files(FileTask::OpenFolder(folder));
        self.expect(text!("The folder was not opened"), asked);
    }

    /// The document is now like this, on the disk.
    pub(crate) fn document_changed(&mut self, state: SessionState) {
        let before = std::mem::replace(&mut self.model.session, state);
        let (old, new) = (&before.document, Arc::clone(&self.model.session.document));
        let target_changed = old.meta.target != new.meta.target || before.folder.is_none();
        let another = before.folder != self.model.session.folder && before.folder.is_some();
        if old.meta.target != new.meta.target || another {
            self.model.observed.clear();
        }
        if before.folder.is_some() && (old.meta.target != new.meta.target || old.meta.mode != new.meta.mode) {
            // Also by undo: what was chosen is of another board, or of another end of the arm.
            self.forget_guided();
        }
        if old.captures != new.captures || old.meta != new.meta {
            self.model.export.is_present = false;
        }
        if another {
            self.forget_solve();
            self.model.export.written = None;
            self.model.picked = None;
            // Its poses are those of the other session.
            self.model.sequence = None;
            self.model.sequence_runs = false;
            self.model.asked = None;
            self.model.by_hand = None;
        }
        if let Some(names) = &new.export_names
            && let Ok(names) = serde_json::from_value(names.clone())
        {
            self.model.export.names = names;
        }
        self.remember_session();
        let document = Arc::clone(&self.model.session.document);
        self.model.selection.retain(|id| document.capture(*id).is_some());
        if self.model.review.as_ref().is_some_and(|review| document.capture(review.id).is_none()) {
            self.model.review = None;
        }
        if target_changed || another {
            self.send_target();
        }
        self.observe_missing();
        self.solve_if_changed();
    }

    /// Puts the session on the disk, however it came to be, first among the recent ones.
    fn remember_session(&mut self) {
        let Some(folder) = self.model.session.folder.clone() else { return };
        let captures = self.model.document().captures.len();
        self.model.recent.retain(|recent| recent.folder != folder);
        self.model.recent.insert(0, RecentSession { folder, captures });
    }

    pub(crate) fn session_opened(&mut self, exported: bool) {
        self.model.opening = false;
        self.model.scene_is_fitted = false;
        self.model.export.is_present = exported;
        self.model.selection.clear();
        self.model.review = None;
        if matches!(self.model.dialog, Some(Dialog::Open | Dialog::Import | Dialog::SaveAs | Dialog::New)) {
            self.set_dialog(None);
        }
        if let Some(folder) = self.model.session.folder.clone() {
            self.say(Severity::Info, text!("Session {folder} is open", folder = folder.display()));
        }
    }

    pub(crate) fn session_failed(&mut self, why: Text) {
        self.model.opening = false;
        self.say(Severity::Error, why);
    }

    /// Has the captures looked at that nobody has looked at for the present target.
    fn observe_missing(&mut self) {
        let Some(folder) = self.model.session.folder.clone() else { return };
        let document = Arc::clone(&self.model.session.document);
        let captures: Vec<_> =
            document.captures.iter().filter(|it| !self.model.observed.contains_key(&it.id)).cloned().collect();
        if !captures.is_empty() {
            self.desk.observe(ObserveJob { folder, target: document.meta.target, captures });
        }
    }

    pub(crate) fn observed(&mut self, id: CaptureId, target: TargetSpec, observed: Option<Arc<Observed>>) {
        if target == self.model.document().meta.target {
            self.model.observed.insert(id, observed);
            self.solve_if_changed();
        }
    }

    pub(crate) fn select(&mut self, ids: Vec<CaptureId>) {
        let shown = ids.last().copied();
        self.model.selection = ids;
        let Some(id) = shown else {
            self.model.review = None;
            return;
        };
        if self.model.review.as_ref().is_some_and(|review| review.id == id) {
            return;
        }
        self.model.review = Some(Review { id, images: None });
        let capture = self.model.document().capture(id).cloned();
        let (Some(folder), Some(capture)) = (self.model.session.folder.clone(), capture) else { return };
        let asked = self.desk.files(FileTask::Review {
            folder,
            capture: Box::new(capture),
            colours: self.model.view.depth_colours,
        });
        self.expect(text!("The capture is not shown"), asked);
    }

    pub(crate) fn back_to_live(&mut self) {
        self.model.review = None;
    }

    pub(crate) fn reviewed(&mut self, id: CaptureId, images: Option<Arc<FrameImages>>) {
        if let Some(review) = self.model.review.as_mut().filter(|review| review.id == id) {
            review.images = images;
        }
    }

    /// Tells the threads that look for the board what it is.
    pub(crate) fn send_target(&mut self) {
        let target = self.model.document().meta.target;
        let asked = self.workers.ask_vision(VisionTask::SetTarget(target));
        self.expect(text!("The target was not changed"), asked);
    }

    /// Tells them what the camera is.
    pub(crate) fn send_intrinsics(&mut self) {
        let Some(intrinsics) = self.model.intrinsics() else { return };
        let asked = self.workers.ask_vision(VisionTask::SetIntrinsics(intrinsics));
        self.expect(text!("The camera was not changed"), asked);
    }
}
