//! A data set becomes a session: its images and poses are copied, and it stays as it is.

use std::path::Path;

use handeye_core::project::dataset::{Dataset, DatasetError};
use handeye_core::project::session::{Capture, Document, Role, SessionError, Store};

use super::{Archive, free_folder, timestamp_rfc3339};
use crate::command::Event;
use crate::model::Severity;
use crate::session::start;
use crate::text;
use crate::text::Text;

/// Why a data set did not become a session.
#[derive(Debug, thiserror::Error)]
enum ImportError {
    #[error(transparent)]
    Dataset(#[from] DatasetError),
    #[error(transparent)]
    Session(#[from] SessionError),
    #[error("row {row} ({name}) has no {what}: solve this data set with `handeye calibrate` instead")]
    Lacks { row: usize, name: String, what: &'static str },
}

impl Archive {
    pub(super) fn import(&mut self, dataset: &Path) {
        let imported = self.copy(dataset).map_err(|error| {
            let why: Text = text!("The data set was not opened: {error}", error = error);
            why
        });
        match imported {
            Ok((store, outside)) => {
                let folder = store.folder().display().to_string();
                self.store = Some(store);
                self.report_document();
                self.outlet.report(Event::SessionOpened { exported: false });
                let text = text!("The data set was copied to the session {folder}", folder = folder);
                self.outlet.notice(Severity::Info, text);
                if outside > 0 {
                    let text = text!("{count} files of the data set lie outside of its folder", count = outside);
                    self.outlet.notice(Severity::Warning, text);
                }
            }
            Err(why) => self.outlet.report(Event::SessionFailed { why }),
        }
    }

    /// The session, and how many files of the data set lie outside of its folder.
    fn copy(&self, folder: &Path) -> Result<(Store, usize), ImportError> {
        let dataset = Dataset::read(folder)?;
        let name = folder.file_name().unwrap_or_default().to_string_lossy().into_owned();
        let target_folder = free_folder(&self.sessions, &name);
        let mut meta = start::meta(None, timestamp_rfc3339());
        meta.target = dataset.target;
        meta.camera = dataset.camera;
        meta.arm = dataset.arm.as_ref().map(|arm| arm.model.clone());
        if let Some(mode) = dataset.mode {
            meta.mode = mode;
        }
        // Everything is read before anything is written, so that a bad row leaves nothing behind.
        let mut captures = Vec::with_capacity(dataset.entries.len());
        for (index, entry) in dataset.entries.iter().enumerate() {
            let lacks = |what| ImportError::Lacks { row: index + 1, name: entry.name.clone(), what };
            let base_from_tip = entry.base_from_tip.ok_or_else(|| lacks("robot pose"))?;
            if entry.image_path.is_none() {
                return Err(lacks("image"));
            }
            captures.push((entry, base_from_tip));
        }
        let mut store = Store::create_with(&target_folder, Document::new(meta))?;
        for (entry, base_from_tip) in captures {
            let image = dataset.load_rgb(entry)?;
            store.add_capture(&Capture {
                image: &image,
                depth_m: None,
                base_from_tip,
                joints_rad: entry.joints_rad.as_deref(),
                sim_time_s: None,
                role: Role::Calibration,
                frames: 1,
                corner_noise_px: None,
                settled_s: None,
                pose_name: Some(&entry.name),
            })?;
        }
        Ok((store, dataset.outside.len()))
    }
}
