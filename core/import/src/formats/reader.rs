//! Reads the files of a recording: opens each according to its name and its beginning, and offers it to every format.

use std::path::{Path, PathBuf};

use super::tree::LEAST_POSES;
use super::{ALL, Content, Encoding, File, Format, of_ending};
use crate::folder;
use crate::recording::{FoundMode, Recording, Stream};
use crate::value::{self, Value};
use crate::xml;
use handeye_files::budget::Budget;
use handeye_wording::Text;
use handeye_wording::text;

/// Most text files that are read.
const MOST_DOCUMENTS: usize = 5000;
/// Lines of a table, a program or a report: ten times as many poses as are taken by hand or by a robot in a day, or the rows of
/// half an hour at 100 Hz.
const MOST_LINES: usize = 200_000;

pub(crate) struct Reader<'a> {
    pub root: &'a Path,
    pub recording: Recording,
    pub budget: &'a Budget<'a>,
    documents: usize,
}

impl<'a> Reader<'a> {
    /// Where the budget is spent, files that follow are not read.
    pub fn new(root: &'a Path, recording: Recording, budget: &'a Budget<'a>) -> Self {
        Self { root, recording, budget, documents: 0 }
    }

    /// Warns that a file is left out.
    pub fn not_used(&mut self, file: &Path, why: Text) {
        self.warn(file, text!("is not used: {why}", why = why));
    }

    fn warn(&mut self, file: &Path, why: Text) {
        const MOST: usize = 50;
        if self.recording.warnings.len() < MOST {
            self.recording.warnings.push(text!("{name}: {why}", name = file.display(), why = why));
        }
    }

    pub fn text(&mut self, file: &Path) -> Option<String> {
        self.documents += 1;
        if self.documents > MOST_DOCUMENTS || self.budget.is_spent() {
            return None;
        }
        match folder::text(&self.root.join(file)) {
            Ok(text) if is_too_long(file, &text) => {
                self.warn(
                    file,
                    text!("is not used: it has more than {most} lines, which no table of poses has", most = MOST_LINES),
                );
                None
            }
            Ok(text) => Some(text),
            Err(error) => {
                self.recording.warnings.push(error.into());
                None
            }
        }
    }

    /// Reads files of one naming.
    pub fn group(&mut self, members: &[(PathBuf, Option<u64>)]) {
        let files = members.iter().filter_map(|(file, number)| self.open(file, *number)).collect();
        // Some call everything that they write a text.
        let (documents, others): (Vec<File>, Vec<File>) =
            Vec::into_iter(files).partition(|file| file.value().is_some());
        self.together(&documents);
        self.together(&others);
    }

    /// The file as it is offered to formats; `None` of one that no format has, or that cannot be read.
    fn open(&mut self, path: &Path, number: Option<u64>) -> Option<File> {
        let (_, encoding) = of_ending(path)?;
        let content = if matches!(encoding, Encoding::Own | Encoding::Bag) {
            Content::Unread
        } else {
            let text = self.text(path)?;
            content(encoding, text).map_err(|why| self.not_used(path, why)).ok()??
        };
        Some(File { path: path.to_path_buf(), number, content })
    }

    /// Offers files of one naming to all formats, together and then each by itself.
    pub fn together(&mut self, files: &[File]) {
        let is_of = |format: &&&dyn Format| files.iter().any(|file| format.sniff(file));
        if ALL.iter().filter(is_of).any(|format| format.read_together(files, self)) {
            return;
        }
        for file in files.iter().take_while(|_| !self.budget.is_spent()) {
            let mut has_poses = false;
            for format in ALL {
                if !(has_poses && format.is_of_poses()) && format.sniff(file) {
                    has_poses |= format.read(file, self);
                }
            }
        }
    }

    /// Reads the files next to a named file: for cameras and targets, but not for series.
    pub fn companions(&mut self, files: &[PathBuf]) {
        let Recording { tracks, joints, rows, .. } = &self.recording;
        let (tracks, joints, rows) = (tracks.len(), joints.len(), rows.len());
        for file in files {
            self.group(&[(file.clone(), None)]);
        }
        self.recording.tracks.truncate(tracks);
        self.recording.joints.truncate(joints);
        self.recording.rows.truncate(rows);
    }

    /// The images in the folders below that a named file lists: for a named file, the folder around it is not searched.
    pub fn named_images(&mut self) {
        let names = self.recording.tracks.iter().flat_map(|track| &track.samples).filter_map(|it| it.image.as_deref());
        let files = folder::images_below(self.root, names, &self.recording.bounds, self.budget);
        let known = |stream: &Stream| self.recording.streams.iter().any(|it| it.name == stream.name);
        let mut streams = folder::streams(self.root, &files, self.budget, &mut Vec::new());
        streams.retain(|stream| !known(stream));
        self.recording.streams.extend(streams);
    }

    /// Takes the place of the camera. Two files that disagree leave it open.
    pub fn mode(&mut self, mode: FoundMode) {
        match &self.recording.mode {
            Some(known) if known.value != mode.value => {
                let warning =
                    text!("{first} and {second} contradict each other", first = known.why(), second = mode.why());
                self.recording.warnings.push(warning);
                self.recording.mode = None;
            }
            _ => self.recording.mode = Some(mode),
        }
    }
}

/// Whether a text is a table, a program or a report of more lines than are read.
fn is_too_long(file: &Path, text: &str) -> bool {
    let is_document = |encoding| matches!(encoding, Encoding::Json | Encoding::Yaml | Encoding::Xml);
    !of_ending(file).is_some_and(|(_, encoding)| is_document(encoding))
        && text.bytes().filter(|b| *b == b'\n').nth(MOST_LINES).is_some()
}

/// A text as it is offered to formats; `None` of XML that describes something else.
///
/// # Errors
/// A sentence, where a document cannot be read.
pub(super) fn content(encoding: Encoding, text: String) -> Result<Option<Content>, Text> {
    let document = match encoding {
        Encoding::Json => Some(value::json(&text)?),
        Encoding::Yaml => Some(messages(value::yaml(&text)?)),
        Encoding::Xml => match xml::opencv(&text).or_else(|| xml::document(&text)) {
            Some(value) => Some(value),
            None => return Ok(None),
        },
        Encoding::Text | Encoding::Own | Encoding::Bag => document(&text),
    };
    Ok(Some(document.map_or(Content::Text(text), Content::Document)))
}

/// The documents of a file of YAML as one value.
fn messages(mut documents: Vec<Value>) -> Value {
    match documents.len() {
        // A document to a message, as `ros2 topic echo` writes them.
        LEAST_POSES.. => Value::List(documents),
        1.. => documents.swap_remove(0),
        0 => Value::Other,
    }
}

/// The value of a text that begins as a document does, whatever its file is called.
fn document(text: &str) -> Option<Value> {
    let text = text.trim_start();
    if text.starts_with("%YAML") {
        return value::yaml(text).ok().map(messages);
    }
    if text.starts_with('<') {
        return xml::opencv(text);
    }
    // Other texts that begin with a brace, for example frames of KRL, are not JSON; lists of numbers are tables.
    let inner = text.strip_prefix('[').unwrap_or(text).trim_start();
    if inner.starts_with('{') { value::json(text).ok() } else { None }
}

#[cfg(test)]
#[path = "reader_tests.rs"]
mod tests;
