//! What is in the folder, and what of it is whole.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Component, Path, PathBuf};
use std::time::SystemTime;

use handeye_dataset::{PoseFormat, PoseOfImage};
use handeye_geometry::natural_order;
use image::RgbImage;

use super::side_file;
use super::table::GrowingTable;
use crate::drivers::Fault;
use crate::message::ImageEncoding;

/// Files of the formats that are read.
const ENDINGS: [&str; 6] = ["png", "jpg", "jpeg", "bmp", "tif", "tiff"];
/// A file that has not changed for so long may be whole.
const SETTLE_S: f64 = 0.4;
/// What is still missing after so long is said.
const COMPLAIN_S: f64 = 3.0;
/// A file that is sent as it is, at most; the protocol takes no more.
const MOST_BYTES: usize = 64 << 20;

/// An image, whole, with its pose where poses are wanted.
#[derive(Debug, Clone)]
pub(super) struct Capture {
    pub name: String,
    pub size: (u32, u32),
    pub encoding: ImageEncoding,
    pub bytes: Vec<u8>,
    pub pose: Option<PoseOfImage>,
    pub modified: SystemTime,
}

/// An image file that is not yet a capture.
#[derive(Debug)]
struct Waiting {
    stamp: (u64, SystemTime),
    since_s: f64,
    /// Whether it was decoded as it is now.
    is_checked: bool,
    is_whole: bool,
}

/// The folder as it was last looked at.
#[derive(Debug)]
pub(super) struct Watch {
    folder: PathBuf,
    poses: Option<(PoseFormat, GrowingTable)>,
    waiting: BTreeMap<String, Waiting>,
    taken: BTreeSet<String>,
    rows_since: BTreeMap<String, f64>,
    /// What was said, so that it is said once.
    said: BTreeSet<String>,
    /// What the user is to know: lines for the log.
    pub remarks: Vec<String>,
}

impl Watch {
    /// Without a format, images alone.
    pub fn new(folder: PathBuf, format: Option<PoseFormat>) -> Self {
        let poses = format.map(|format| {
            let table = GrowingTable::new(folder.join(format.table()));
            (format, table)
        });
        Self {
            folder,
            poses,
            waiting: BTreeMap::new(),
            taken: BTreeSet::new(),
            rows_since: BTreeMap::new(),
            said: BTreeSet::new(),
            remarks: Vec::new(),
        }
    }

    /// What has become whole since the last look, in the natural order of the names.
    ///
    /// # Errors
    /// [`Fault`] when the folder cannot be read.
    pub fn look(&mut self, now_s: f64) -> Result<Vec<Capture>, Fault> {
        if let Some((format, table)) = &mut self.poses
            && let Err(why) = table.look(format, now_s)
        {
            self.remark(why);
        }
        let names = self.new_images(now_s)?;
        let mut captures = Vec::new();
        for name in names {
            if let Some(capture) = self.capture(&name, now_s) {
                self.waiting.remove(&name);
                self.taken.insert(name);
                captures.push(capture);
            }
        }
        self.complain_of_rows(now_s);
        Ok(captures)
    }

    /// Whether an image is not whole or has no pose yet.
    pub fn is_waiting(&self) -> bool {
        !self.waiting.is_empty()
    }

    /// Names of images that were not taken and have not changed for a while.
    fn new_images(&mut self, now_s: f64) -> Result<Vec<String>, Fault> {
        let fault = |error: std::io::Error| Fault(format!("{}: {error}", self.folder.display()));
        let mut names = Vec::new();
        for entry in std::fs::read_dir(&self.folder).map_err(fault)? {
            let path = entry.map_err(fault)?.path();
            let ending = path.extension().map(std::ffi::OsStr::to_ascii_lowercase);
            let is_image = ending.is_some_and(|ending| ENDINGS.iter().any(|known| ending == *known));
            let name = path.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
            if !is_image || self.taken.contains(&name) {
                continue;
            }
            // Gone again: whoever wrote it gave it another name.
            let Ok(metadata) = path.metadata() else { continue };
            let stamp = (metadata.len(), metadata.modified().unwrap_or(SystemTime::UNIX_EPOCH));
            let fresh = Waiting { stamp, since_s: now_s, is_checked: false, is_whole: false };
            match self.waiting.get_mut(&name) {
                Some(waiting) if waiting.stamp == stamp => {
                    if now_s - waiting.since_s >= SETTLE_S {
                        names.push(name);
                    }
                }
                Some(waiting) => *waiting = fresh,
                None => drop(self.waiting.insert(name, fresh)),
            }
        }
        self.waiting.retain(|name, _| self.folder.join(name).is_file());
        names.sort_by(|a, b| natural_order::compare(a, b));
        Ok(names)
    }

    /// The capture of an image, if it is whole and has its pose.
    fn capture(&mut self, name: &str, now_s: f64) -> Option<Capture> {
        let path = self.folder.join(name);
        let (since_s, modified, is_checked, is_whole) = {
            let waiting = self.waiting.get(name)?;
            (waiting.since_s, waiting.stamp.1, waiting.is_checked, waiting.is_whole)
        };
        if is_checked && !is_whole {
            return None;
        }
        let late = now_s - since_s >= COMPLAIN_S;
        let pose = match self.pose_of(&path) {
            Ok(pose) => pose,
            Err(why) => {
                if late {
                    self.remark(why);
                }
                return None;
            }
        };
        let read = read_image(&path);
        if let Err(why) = &read
            && !late
            && why.is_incomplete
        {
            return None;
        }
        if let Some(waiting) = self.waiting.get_mut(name) {
            (waiting.is_checked, waiting.is_whole) = (true, read.is_ok());
        }
        match read {
            Ok((size, encoding, bytes)) => {
                Some(Capture { name: name.to_owned(), size, encoding, bytes, pose, modified })
            }
            Err(why) => {
                self.remark(format!("{}: {}", path.display(), why.text));
                None
            }
        }
    }

    /// The pose of an image; `Ok(None)` where none is wanted.
    fn pose_of(&self, image: &Path) -> Result<Option<PoseOfImage>, String> {
        let Some((format, table)) = &self.poses else { return Ok(None) };
        let folder = table.path().parent().unwrap_or(Path::new(""));
        let of_image = |row: &&PoseOfImage| tidy(&folder.join(&row.name)) == tidy(image);
        if let Some(row) = table.rows().iter().find(of_image) {
            return Ok(Some(row.clone()));
        }
        match side_file::beside(image) {
            Some(path) => side_file::read(&path, format).map(Some),
            None => Err(format!(
                "{} has no pose: neither a row in {} nor a .json, .csv or .txt of its name beside it",
                image.display(),
                table.path().display()
            )),
        }
    }

    fn complain_of_rows(&mut self, now_s: f64) {
        let Some((_, table)) = &self.poses else { return };
        let folder = table.path().parent().unwrap_or(Path::new("")).to_path_buf();
        let names: Vec<(String, usize)> = table.rows().iter().map(|row| (row.name.clone(), row.line)).collect();
        let table = table.path().display().to_string();
        for (name, line) in names {
            let since_s = *self.rows_since.entry(name.clone()).or_insert(now_s);
            if now_s - since_s >= COMPLAIN_S && !folder.join(&name).is_file() {
                self.remark(format!("{table}, row {line}: there is no image {name}"));
            }
        }
    }

    fn remark(&mut self, text: String) {
        const MOST: usize = 10_000;
        if self.said.len() < MOST && self.said.insert(text.clone()) {
            self.remarks.push(text);
        }
    }
}

struct NotRead {
    text: String,
    /// It may become whole.
    is_incomplete: bool,
}

/// Size and bytes of an image that is whole. PNG and JPEG stay as they are.
#[expect(clippy::type_complexity, reason = "size, encoding and bytes")]
fn read_image(path: &Path) -> Result<((u32, u32), ImageEncoding, Vec<u8>), NotRead> {
    let fail = |text: String| NotRead { text, is_incomplete: true };
    let image: RgbImage = handeye_images::load_rgb(path).map_err(|error| fail(error.to_string()))?;
    let bytes = std::fs::read(path).map_err(|error| fail(error.to_string()))?;
    let size = image.dimensions();
    let (encoding, bytes) = match bytes.as_slice() {
        [0x89, b'P', b'N', b'G', ..] => (ImageEncoding::Png, bytes),
        [0xff, 0xd8, ..] => (ImageEncoding::Jpeg, bytes),
        _ => (ImageEncoding::Rgb8, image.into_raw()),
    };
    if bytes.len() > MOST_BYTES {
        let text = format!("{} bytes are too many: save it as PNG or JPEG", bytes.len());
        return Err(NotRead { text, is_incomplete: false });
    }
    Ok((size, encoding, bytes))
}

/// Without `.` components, so that two spellings of one path are equal.
fn tidy(path: &Path) -> PathBuf {
    path.components().filter(|component| *component != Component::CurDir).collect()
}
