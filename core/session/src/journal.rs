//! `journal.jsonl`: everything that was ever done to a session, one line per entry, only ever appended to; before the first capture it
//! may begin again, with a higher number, see [`Store::begin_again`](super::Store::begin_again).
//!
//! ```text
//! {"seq":1,"entry":{"begin":{…}},"sha256":"0123456789abcdef"}
//! {"seq":2,"entry":{"edit":{"delete_captures":[3]}},"sha256":"…"}
//! {"seq":3,"entry":"undo","sha256":"…"}
//! ```
//!
//! `sha256` is the first 16 hexadecimal digits of the SHA-256 of the line up to `,"sha256"`. An entry counts when its
//! line is on the disk with its line end; a last line that is not whole is an entry that never happened.

use std::fs::File;
use std::io::Write as _;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};
use sha2::{Digest as _, Sha256};

use super::capture_id::CaptureId;
use super::document::Document;
use super::edit::Edit;
use super::error::{SessionError, SessionProblem};
use super::history::History;
use handeye_files::atomic_file;
use handeye_files::own_folder::{self, JOURNAL};
use handeye_wording::one_line;

/// Value of `format` in the first entry.
const FORMAT: &str = "handeye-journal";
/// The layout: a reader refuses another one.
const MAJOR_VERSION: u32 = 1;
const MINOR_VERSION: u32 = 0;
/// Stands before the checksum in a line.
const CHECKSUM_KEY: &[u8] = b",\"sha256\":\"";
const CHECKSUM_DIGITS: usize = 16;

/// One entry.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(super) enum Entry {
    Begin(Box<Begin>),
    Edit(Edit),
    Undo,
    Redo,
}

/// The first entry: the session as it is before everything else.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct Begin {
    format: String,
    version: String,
    /// The largest number of a capture so far, also of captures that are gone.
    last_capture: CaptureId,
    document: Document,
}

#[derive(Serialize, Deserialize)]
struct Line<E> {
    seq: u64,
    entry: E,
}

/// The first line, read before it is known whether the rest can be parsed.
#[derive(Deserialize)]
struct FirstEntry {
    begin: Header,
}

#[derive(Deserialize)]
struct Header {
    format: String,
    version: String,
}

/// Why a line is not an entry.
enum BadLine {
    /// It is not what was written.
    Damaged(&'static str),
    /// It is what was written, by a program that knows more.
    Unknown(String),
}

/// Contents of a journal.
#[derive(Debug)]
pub(super) struct Replayed {
    pub history: History,
    /// The number of the last entry.
    pub sequence: u64,
    /// Lines that count.
    pub rows: u64,
    /// Bytes that count; what is behind them is an entry that never happened.
    pub length: usize,
}

impl Entry {
    pub fn begin(history: &History) -> Self {
        Self::Begin(Box::new(Begin {
            format: FORMAT.to_owned(),
            version: format!("{MAJOR_VERSION}.{MINOR_VERSION}"),
            last_capture: history.last_capture(),
            document: (**history.document()).clone(),
        }))
    }
}

/// The line of an entry, and the entry as it will be read from it.
fn encode(seq: u64, entry: &Entry) -> Result<(String, Entry), SessionProblem> {
    let json = |e: serde_json::Error| SessionProblem::Json(one_line(&e));
    let body = serde_json::to_string(&Line { seq, entry }).map_err(json)?;
    let body = body.strip_suffix('}').unwrap_or(&body);
    let line = format!("{body},\"sha256\":\"{}\"}}\n", checksum(body.as_bytes()));
    // An entry that cannot be read back is not written.
    let Line { entry: read, .. } = serde_json::from_str::<Line<Entry>>(&line).map_err(json)?;
    if read == *entry {
        Ok((line, read))
    } else {
        Err(SessionProblem::Json("a number in it would not be read as it was written".into()))
    }
}

fn decode(line: &[u8]) -> Result<Line<Entry>, BadLine> {
    check(line)?;
    serde_json::from_slice(line).map_err(|e| BadLine::Unknown(one_line(&e)))
}

fn check(line: &[u8]) -> Result<(), BadLine> {
    let cut = BadLine::Damaged("the line is not whole");
    let Some(inner) = line.strip_suffix(b"\"}") else { return Err(cut) };
    let Some((rest, sum)) = inner.split_last_chunk::<CHECKSUM_DIGITS>() else { return Err(cut) };
    let Some(body) = rest.strip_suffix(CHECKSUM_KEY) else { return Err(cut) };
    if checksum(body).as_bytes() == sum {
        Ok(())
    } else {
        Err(BadLine::Damaged("the checksum is not that of the line"))
    }
}

fn checksum(body: &[u8]) -> String {
    // Two digits for each of the first eight bytes.
    let first =
        Sha256::digest(body).iter().take(CHECKSUM_DIGITS / 2).fold(0, |bits, byte| bits << 8 | u64::from(*byte));
    format!("{first:016x}")
}

/// Replays the changes in a journal.
pub(super) fn replay(bytes: &[u8]) -> Result<Replayed, SessionProblem> {
    let mut lines = Lines { rest: bytes };
    let first = lines.next().unwrap_or(RawLine { bytes: b"", is_ended: false, is_last: true });
    let (mut history, mut sequence) = begin(&first)?;
    let (mut rows, mut length) = (1, first.bytes.len() + 1);
    for raw in lines {
        let row = rows + 1;
        let line = match decode(raw.bytes) {
            // Appended and not finished, or finished in another order than written when the power went.
            _ if !raw.is_ended => break,
            Err(BadLine::Damaged(_)) if raw.is_last => break,
            Err(bad) => return Err(problem(row, bad)),
            Ok(line) => line,
        };
        let damaged = |what: String| SessionProblem::Damaged { row, what };
        if Some(line.seq) != sequence.checked_add(1) {
            return Err(damaged(format!("entry {} follows entry {sequence}: rows are missing or twice", line.seq)));
        }
        match line.entry {
            Entry::Begin(_) => return Err(damaged("the journal begins twice".into())),
            Entry::Edit(edit) => history.apply(edit),
            Entry::Undo => history.undo(),
            Entry::Redo => history.redo(),
        }
        .map_err(|e| damaged(format!("the entry does not fit the entries before it: {e}")))?;
        (rows, sequence, length) = (row, line.seq, length + raw.bytes.len() + 1);
    }
    Ok(Replayed { history, sequence, rows, length })
}

/// The first line. It is written together with its file, so it is never an entry that did not happen.
fn begin(raw: &RawLine<'_>) -> Result<(History, u64), SessionProblem> {
    let row = 1;
    let whole = if raw.is_ended { check(raw.bytes) } else { Err(BadLine::Damaged("the line is not whole")) };
    whole.map_err(|bad| problem(row, bad))?;
    let no_begin = |e: serde_json::Error| SessionProblem::Damaged { row, what: format!("no begin: {}", one_line(&e)) };
    let Header { format, version } =
        serde_json::from_slice::<Line<FirstEntry>>(raw.bytes).map_err(no_begin)?.entry.begin;
    if format != FORMAT {
        return Err(SessionProblem::Format(format.chars().take(40).collect()));
    }
    if version.split('.').next().and_then(|major| major.parse().ok()) != Some(MAJOR_VERSION) {
        return Err(SessionProblem::Version { found: version.chars().take(40).collect(), known: MAJOR_VERSION });
    }
    match decode(raw.bytes).map_err(|bad| problem(row, bad))? {
        Line { seq, entry: Entry::Begin(begin) } => {
            begin.document.check()?;
            Ok((History::new(begin.document).with_numbers_used(begin.last_capture), seq))
        }
        _ => Err(SessionProblem::Damaged { row, what: "the journal does not begin with a session".into() }),
    }
}

fn problem(row: u64, bad: BadLine) -> SessionProblem {
    match bad {
        BadLine::Damaged(what) => SessionProblem::Damaged { row, what: what.to_owned() },
        BadLine::Unknown(what) => SessionProblem::Unknown { row, what },
    }
}

struct RawLine<'a> {
    /// The line without its end.
    bytes: &'a [u8],
    is_ended: bool,
    is_last: bool,
}

struct Lines<'a> {
    rest: &'a [u8],
}

impl<'a> Iterator for Lines<'a> {
    type Item = RawLine<'a>;

    fn next(&mut self) -> Option<RawLine<'a>> {
        if self.rest.is_empty() {
            return None;
        }
        let end = self.rest.iter().position(|&b| b == b'\n');
        let (bytes, rest) = self.rest.split_at(end.unwrap_or(self.rest.len()));
        self.rest = rest.get(1..).unwrap_or_default();
        Some(RawLine { bytes, is_ended: end.is_some(), is_last: self.rest.is_empty() })
    }
}

/// The journal of a session that is open for writing.
#[derive(Debug)]
pub(super) struct Journal {
    path: PathBuf,
    file: File,
    length: u64,
    sequence: u64,
    /// The file may hold bytes that do not count and could not be removed.
    is_broken: bool,
}

/// An entry that is ready to be written.
pub(super) struct Prepared {
    line: String,
    /// The entry as it will be read.
    pub entry: Entry,
}

impl Journal {
    /// Begins the journal of a folder that has none.
    pub fn create(folder: &Path, history: &History, sequence: u64) -> Result<Self, SessionError> {
        let path = folder.join(JOURNAL);
        let (line, _) = encode(sequence, &Entry::begin(history)).map_err(|p| SessionError::new(&path, p))?;
        atomic_file::write(&path, line.as_bytes()).map_err(|e| SessionError::unwritable(&path, &e))?;
        Self::at_end(path, line.len() as u64, sequence)
    }

    /// Continues a journal whose first `length` bytes are valid. The rest is kept in a file next to it and cut off.
    pub fn open(folder: &Path, length: u64, sequence: u64) -> Result<Self, SessionError> {
        let path = folder.join(JOURNAL);
        let bytes = own_folder::read(&path).map_err(|e| SessionError::unreadable(&path, &e))?;
        let torn = usize::try_from(length).ok().and_then(|length| bytes.get(length..)).unwrap_or_default();
        let journal = Self::at_end(path, length, sequence)?;
        if !torn.is_empty() {
            keep_torn(folder, torn)?;
            journal.cut().map_err(|e| SessionError::unwritable(&journal.path, &e))?;
        }
        Ok(journal)
    }

    fn at_end(path: PathBuf, length: u64, sequence: u64) -> Result<Self, SessionError> {
        let opened = own_folder::check_file(&path).and_then(|()| File::options().append(true).open(&path));
        let file = opened.map_err(|e| SessionError::unwritable(&path, &e))?;
        Ok(Self { path, file, length, sequence, is_broken: false })
    }

    /// The number of the last entry.
    pub fn sequence(&self) -> u64 {
        self.sequence
    }

    /// The bytes that count.
    pub fn bytes(&self) -> Result<Vec<u8>, SessionError> {
        let mut bytes = std::fs::read(&self.path).map_err(|e| SessionError::unreadable(&self.path, &e))?;
        bytes.truncate(usize::try_from(self.length).unwrap_or(usize::MAX));
        Ok(bytes)
    }

    /// Takes no more entries.
    pub fn give_up(&mut self) {
        self.is_broken = true;
    }

    pub fn prepare(&self, entry: &Entry) -> Result<Prepared, SessionError> {
        let fail = |problem| SessionError::new(&self.path, problem);
        if self.is_broken {
            return Err(fail(SessionProblem::Broken));
        }
        let (line, entry) = encode(self.sequence + 1, entry).map_err(fail)?;
        Ok(Prepared { line, entry })
    }

    /// Writes an entry. When this returns it counts, also after a power cut; on an error it does not.
    pub fn append(&mut self, prepared: &Prepared) -> Result<(), SessionError> {
        let written = self.file.write_all(prepared.line.as_bytes()).and_then(|()| self.file.sync_data());
        if let Err(error) = written {
            self.is_broken = self.cut().is_err();
            return Err(SessionError::unwritable(&self.path, &error));
        }
        self.length += prepared.line.len() as u64;
        self.sequence += 1;
        Ok(())
    }

    fn cut(&self) -> std::io::Result<()> {
        self.file.set_len(self.length)?;
        self.file.sync_all()
    }
}

/// Keeps bytes that are cut off, as they may be of use to the user.
fn keep_torn(folder: &Path, torn: &[u8]) -> Result<(), SessionError> {
    let path = (1..u32::MAX).map(|n| folder.join(format!("journal.torn-{n}"))).find(|path| !path.exists());
    let path = path.unwrap_or_else(|| folder.join("journal.torn"));
    atomic_file::write(&path, torn).map_err(|e| SessionError::unwritable(&path, &e))
}

#[cfg(test)]
#[path = "journal_tests.rs"]
mod tests;
