//! Writing a session, capture by capture.

use std::fs;
use std::io::{self, Cursor};
use std::path::{Path, PathBuf};

use image::{ImageFormat, RgbImage};

use super::depth;
use super::document::{CaptureId, CaptureRecord, Document, Role, SessionMeta};
use super::edit::EditError;
use super::error::{SessionError, SessionProblem};
use super::{DOCUMENT, Session, read_document, session_file};
use crate::depth::DepthImage;
use crate::frames::{Base, Pose, Tip};
use crate::image_file::{self, one_line};
use crate::{atomic_file, dataset};

const IMAGES: &str = "images";
const DEPTH: &str = "depth";

/// What one capture consists of.
#[derive(Debug, Clone, Copy)]
pub struct Capture<'a> {
    /// The image.
    pub image: &'a RgbImage,
    /// Depth in metres, of the size of the image.
    pub depth_m: Option<&'a DepthImage>,
    /// Tip pose as the controller reported it.
    pub base_from_tip: Pose<Base, Tip>,
    /// Joint angles as the controller reported them, radians.
    pub joints_rad: Option<&'a [f64]>,
    /// Simulation time of the image, seconds.
    pub sim_time_s: Option<f64>,
}

/// Adds captures to a session. One writer per folder.
#[derive(Debug)]
pub struct SessionWriter {
    folder: PathBuf,
    document: Document,
    image_size: Option<(u32, u32)>,
}

impl SessionWriter {
    /// Begins a session in a folder that is made where there is none.
    ///
    /// A session that is there already is replaced: its captures are gone. Ask [`Session::is_session`] before, or
    /// [`Self::resume`] it. Files that the old session does not name stay.
    ///
    /// # Errors
    /// [`SessionProblem::NotEmpty`] when the folder holds something that is not a session,
    /// [`SessionProblem::Version`] for a session of another major version; nothing is touched then.
    pub fn create(folder: &Path, meta: SessionMeta) -> Result<Self, SessionError> {
        meta.check().map_err(|e| SessionError::new(folder, e.into()))?;
        let replaced = check_free(folder)?;
        fs::create_dir_all(folder).map_err(|e| unwritable(folder, &e))?;
        let writer = Self { folder: folder.to_path_buf(), document: Document::new(meta), image_size: None };
        // The document first: from here on the folder is a session, whatever happens.
        writer.write_document()?;
        writer.write_table()?;
        writer.write_description()?;
        writer.make_subfolders()?;
        for capture in replaced.iter().flat_map(|document| &document.captures) {
            for name in std::iter::once(&capture.image).chain(&capture.depth) {
                remove(&folder.join(name))?;
            }
        }
        Ok(writer)
    }

    /// Goes on with a session, also with one that was interrupted.
    ///
    /// # Errors
    /// As [`Session::open`], and when the folder cannot be written.
    pub fn resume(folder: &Path) -> Result<Self, SessionError> {
        let session = Session::open(folder)?;
        let mut document = Document::new(session.meta);
        document.captures = session.captures;
        let image_size = match document.captures.first() {
            None => None,
            Some(first) => {
                let path = folder.join(&first.image);
                let unreadable = |e| SessionError::new(&path, SessionProblem::Unreadable(one_line(&e)));
                Some(image_file::image_size(&path).map_err(unreadable)?)
            }
        };
        let writer = Self { folder: folder.to_path_buf(), document, image_size };
        writer.make_subfolders()?;
        writer.write_description()?;
        writer.commit()?;
        Ok(writer)
    }

    /// The folder.
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    /// The captures so far.
    pub fn captures(&self) -> &[CaptureRecord] {
        &self.document.captures
    }

    /// Records a capture. When this returns it is on the disk and survives a power cut.
    ///
    /// # Errors
    /// [`SessionError`] when the capture cannot be part of the session (not finite, another image size) or cannot be
    /// written; the session is then as before.
    pub fn add_capture(&mut self, capture: &Capture<'_>) -> Result<&CaptureRecord, SessionError> {
        let record = self.record(capture)?;
        let png = encode_png(capture.image).map_err(|e| self.fail(&record.image, SessionProblem::Unwritable(e)))?;
        self.write(&record.image, &png)?;
        if let (Some(name), Some(depth_m)) = (&record.depth, capture.depth_m) {
            let tiff = depth::encode(depth_m).map_err(|e| self.fail(name, SessionProblem::Unwritable(e)))?;
            self.write(name, &tiff)?;
        }
        self.document.captures.push(record);
        if let Err(error) = self.commit() {
            self.document.captures.pop();
            return Err(error);
        }
        self.image_size = Some(capture.image.dimensions());
        let last = self.document.captures.len() - 1;
        Ok(&self.document.captures[last])
    }

    /// A capture's entry in the document, under the next free number.
    fn record(&self, capture: &Capture<'_>) -> Result<CaptureRecord, SessionError> {
        let number = self.document.captures.iter().map(|c| c.id.0).max().map_or(1, |last| last.saturating_add(1));
        let image = format!("{IMAGES}/{number:04}.png");
        let refuse =
            |what: &str| Err(self.fail(&image, EditError::Bad { at: "the capture".into(), what: what.into() }.into()));
        let size = capture.image.dimensions();
        if size.0 == 0 || size.1 == 0 {
            return refuse("has an image without pixels");
        }
        if self.image_size.is_some_and(|first| first != size) {
            return refuse("has an image of another size than the captures before: begin a new session");
        }
        if capture.depth_m.is_some_and(|d| (d.width, d.height) != size) {
            return refuse("has a depth image of another size than its image");
        }
        let record = CaptureRecord {
            id: CaptureId(number),
            role: Role::Calibration,
            excluded: false,
            frames: 1,
            corner_noise_px: None,
            settled_s: None,
            pose_name: None,
            depth: capture.depth_m.map(|_| format!("{DEPTH}/{number:04}.tiff")),
            base_from_tip: capture.base_from_tip,
            joints_rad: capture.joints_rad.map(<[f64]>::to_vec),
            sim_time_s: capture.sim_time_s,
            image,
        };
        record.check().map_err(|e| self.fail(&record.image, e.into()))?;
        Ok(record)
    }

    /// Makes the captures of the document the captures of the session: the pose table first, the document last,
    /// since a capture counts when the document names it.
    fn commit(&self) -> Result<(), SessionError> {
        self.write_table()?;
        self.write_document()
    }

    fn write_table(&self) -> Result<(), SessionError> {
        let views = self.document.captures.iter().map(|c| (c.image.as_str(), &c.base_from_tip));
        self.write(dataset::write::POSE_TABLE, dataset::write::pose_table(views).as_bytes())
    }

    fn write_document(&self) -> Result<(), SessionError> {
        let text =
            session_file::to_json(&self.document, 0, CaptureId(0)).map_err(|problem| self.fail(DOCUMENT, problem))?;
        self.write(DOCUMENT, text.as_bytes())
    }

    fn write_description(&self) -> Result<(), SessionError> {
        let meta = &self.document.meta;
        let text = dataset::write::description(meta.mode, &meta.target, meta.camera.as_ref());
        self.write(dataset::DESCRIPTION, text.as_bytes())
    }

    fn make_subfolders(&self) -> Result<(), SessionError> {
        for name in [IMAGES, DEPTH] {
            let path = self.folder.join(name);
            fs::create_dir_all(&path).map_err(|e| unwritable(&path, &e))?;
        }
        atomic_file::sync_folder(&self.folder).map_err(|e| unwritable(&self.folder, &e))
    }

    fn write(&self, name: &str, bytes: &[u8]) -> Result<(), SessionError> {
        let path = self.folder.join(name);
        atomic_file::write(&path, bytes).map_err(|e| unwritable(&path, &e))
    }

    fn fail(&self, name: &str, problem: SessionProblem) -> SessionError {
        SessionError::new(&self.folder.join(name), problem)
    }
}

/// The session that is to be replaced, if there is one; an error when there is something else.
fn check_free(folder: &Path) -> Result<Option<Document>, SessionError> {
    if Session::is_session(folder) {
        return read_document(folder).map(Some);
    }
    let entries = match fs::read_dir(folder) {
        Ok(entries) => entries,
        Err(e) if e.kind() == io::ErrorKind::NotFound => return Ok(None),
        Err(e) => return Err(unwritable(folder, &e)),
    };
    for entry in entries {
        let name = entry.map_err(|e| unwritable(folder, &e))?.file_name();
        // A session that was killed at its very first write has left this and nothing else.
        let is_ours = name.to_str().is_some_and(|name| name == format!(".{DOCUMENT}.partial"));
        if !is_ours {
            return Err(SessionError::new(folder, SessionProblem::NotEmpty));
        }
    }
    Ok(None)
}

fn remove(path: &Path) -> Result<(), SessionError> {
    match fs::remove_file(path) {
        Err(e) if e.kind() != io::ErrorKind::NotFound => Err(unwritable(path, &e)),
        _ => Ok(()),
    }
}

fn encode_png(image: &RgbImage) -> Result<Vec<u8>, String> {
    let mut bytes = Cursor::new(Vec::new());
    image.write_to(&mut bytes, ImageFormat::Png).map_err(|e| one_line(&e))?;
    Ok(bytes.into_inner())
}

fn unwritable(path: &Path, error: &io::Error) -> SessionError {
    SessionError::new(path, SessionProblem::Unwritable(one_line(error)))
}
