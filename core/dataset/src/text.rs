//! Text files of a data set, and tables with rows that are counted as an editor counts them.

use std::fs;
use std::io::Read;
use std::path::{Component, Path, PathBuf};

use super::error::{DatasetError, DatasetProblem, shown};
use handeye_wording::one_line;

/// Most bytes of a text file: corners of ten thousand views of a large board.
const MAX_TEXT_BYTES: u64 = 1 << 28;

/// A text file as read, without its byte order mark.
pub(super) struct TextFile {
    /// For messages and for opening it.
    pub path: PathBuf,
    /// Its path in the data set.
    pub name: PathBuf,
    pub text: String,
    #[cfg(feature = "digest")]
    pub sha256: [u8; 32],
}

impl TextFile {
    /// Reads the file `name` of the data set in `folder`.
    pub fn read(folder: &Path, name: &Path) -> Result<Self, DatasetError> {
        let path = &folder.join(name);
        let fail = |problem| DatasetError::new(path, None, problem);
        let unreadable = |e: std::io::Error| fail(DatasetProblem::Unreadable(one_line(&e)));
        let metadata = fs::metadata(path).map_err(unreadable)?;
        if !metadata.is_file() {
            return Err(fail(DatasetProblem::Unreadable("it is not a file".into())));
        }
        if metadata.len() > MAX_TEXT_BYTES {
            return Err(fail(DatasetProblem::FileTooLarge { bytes: metadata.len(), limit: MAX_TEXT_BYTES }));
        }
        let bytes = fs::read(path).map_err(unreadable)?;
        Self::of_bytes(path, name, bytes)
    }

    /// Reads what comes from somewhere else than a file, to its end; `path` is what messages call it.
    pub fn of_reader(path: &Path, reader: impl Read) -> Result<Self, DatasetError> {
        let fail = |problem| DatasetError::new(path, None, problem);
        let mut bytes = Vec::new();
        let read = reader.take(MAX_TEXT_BYTES + 1).read_to_end(&mut bytes);
        read.map_err(|e| fail(DatasetProblem::Unreadable(one_line(&e))))?;
        let length = bytes.len() as u64;
        if length > MAX_TEXT_BYTES {
            return Err(fail(DatasetProblem::FileTooLarge { bytes: length, limit: MAX_TEXT_BYTES }));
        }
        Self::of_bytes(path, path, bytes)
    }

    fn of_bytes(path: &Path, name: &Path, bytes: Vec<u8>) -> Result<Self, DatasetError> {
        #[cfg(feature = "digest")]
        let sha256 = <sha2::Sha256 as sha2::Digest>::digest(&bytes).into();
        let text = String::from_utf8(bytes).map_err(|e| {
            let row = line_of(e.as_bytes(), e.utf8_error().valid_up_to());
            DatasetError::new(path, Some(row), DatasetProblem::NotUtf8)
        })?;
        let text = text.strip_prefix('\u{feff}').map(str::to_owned).unwrap_or(text);
        Ok(Self {
            path: path.to_path_buf(),
            name: name.to_path_buf(),
            text,
            #[cfg(feature = "digest")]
            sha256,
        })
    }

    /// An error about what is at a byte of it.
    pub fn error_at(&self, offset: usize, problem: DatasetProblem) -> DatasetError {
        DatasetError::new(&self.path, Some(line_of(self.text.as_bytes(), offset)), problem)
    }
}

/// The line of a byte, counted from 1.
pub(super) fn line_of(bytes: &[u8], offset: usize) -> usize {
    1 + bytes.iter().take(offset).filter(|&&b| b == b'\n').count()
}

/// `folder/name` tidied so that two spellings of one file compare equal; `None` when the name is empty or absolute.
pub(super) fn resolve(folder: &Path, name: &str) -> Option<PathBuf> {
    let name = Path::new(name);
    if name.as_os_str().is_empty() || !name.is_relative() {
        return None;
    }
    let mut tidy = PathBuf::new();
    for component in folder.components().chain(name.components()) {
        match component {
            Component::CurDir => {}
            Component::ParentDir if matches!(tidy.components().next_back(), Some(Component::Normal(_))) => {
                tidy.pop();
            }
            other => tidy.push(other),
        }
    }
    Some(tidy)
}

/// A row of a table and where it is.
pub(super) struct Row {
    /// Line of its first cell, from 1.
    pub line: usize,
    pub cells: Vec<String>,
}

impl Row {
    /// Contents of a cell. Every row has as many cells as the header, which is checked on parsing.
    pub fn text(&self, column: usize) -> &str {
        &self.cells[column]
    }
}

/// A comma-separated table with a header; blank lines are nothing.
pub(super) struct Table<'a> {
    path: &'a Path,
    folder: &'a Path,
    columns: Vec<&'static str>,
    pub rows: Vec<Row>,
}

impl<'a> Table<'a> {
    /// Reads a table whose header is one of `headers`, in this order. `why` states what an empty table should hold.
    pub fn parse(file: &'a TextFile, headers: &[Vec<&'static str>], why: &'static str) -> Result<Self, DatasetError> {
        let path = file.path.as_path();
        let mut records = records(file)?;
        if records.is_empty() {
            return Err(DatasetError::new(path, None, DatasetProblem::Empty(why)));
        }
        let header = records.remove(0);
        let columns =
            match_header(&header.cells, headers).map_err(|p| DatasetError::new(path, Some(header.line), p))?;
        for row in &records {
            let (got, need) = (row.cells.len(), columns.len());
            if got != need {
                return Err(DatasetError::new(path, Some(row.line), DatasetProblem::ColumnCount { got, need }));
            }
        }
        if records.is_empty() {
            return Err(DatasetError::new(path, Some(header.line), DatasetProblem::NoRows(why)));
        }
        let folder = file.name.parent().unwrap_or(Path::new(""));
        Ok(Self { path, folder, columns, rows: records })
    }

    pub fn fail(&self, row: &Row, problem: DatasetProblem) -> DatasetError {
        DatasetError::new(self.path, Some(row.line), problem)
    }

    /// The path in the data set of an image that is named relative to the table.
    pub fn image_path(&self, row: &Row, column: usize) -> Result<PathBuf, DatasetError> {
        let name = row.text(column);
        resolve(self.folder, name).ok_or_else(|| self.fail(row, DatasetProblem::BadImageName(shown(name))))
    }

    /// A finite number.
    pub fn number(&self, row: &Row, column: usize) -> Result<f64, DatasetError> {
        let cell = row.text(column);
        let name = self.columns[column];
        let value: f64 = cell
            .parse()
            .map_err(|_error| self.fail(row, DatasetProblem::NotANumber { column: name, cell: shown(cell) }))?;
        if value.is_finite() {
            Ok(value)
        } else {
            Err(self.fail(row, DatasetProblem::NotFinite { column: name, cell: shown(cell) }))
        }
    }

    /// Numbers of neighbouring columns, from `first` on.
    pub fn numbers<const N: usize>(&self, row: &Row, first: usize) -> Result<[f64; N], DatasetError> {
        let mut values = [0.0; N];
        for (i, value) in values.iter_mut().enumerate() {
            *value = self.number(row, first + i)?;
        }
        Ok(values)
    }

    /// A whole number from 0.
    pub fn index(&self, row: &Row, column: usize) -> Result<usize, DatasetError> {
        let cell = row.text(column);
        cell.parse().map_err(|_error| {
            let value = shown(cell);
            self.fail(
                row,
                DatasetProblem::BadValue { key: self.columns[column], value, want: "a whole number counted from 0" },
            )
        })
    }

    pub fn column_count(&self) -> usize {
        self.columns.len()
    }

    pub fn column_name(&self, column: usize) -> &'static str {
        self.columns[column]
    }
}

pub(super) fn records(file: &TextFile) -> Result<Vec<Row>, DatasetError> {
    let bytes = file.text.as_bytes();
    let mut reader =
        csv::ReaderBuilder::new().has_headers(false).flexible(true).trim(csv::Trim::All).from_reader(bytes);
    let mut rows = Vec::new();
    let (mut counted, mut line) = (0, 1);
    let mut record = csv::StringRecord::new();
    loop {
        // The reader's own line numbers are those before line ends and blank lines that it skips.
        let mut start = reader.position().byte() as usize;
        while bytes.get(start).is_some_and(|&b| b == b'\n' || b == b'\r') {
            start += 1;
        }
        let more = reader.read_record(&mut record).map_err(|e| {
            DatasetError::new(&file.path, Some(line_of(bytes, start)), DatasetProblem::Csv(one_line(&e)))
        })?;
        if !more {
            return Ok(rows);
        }
        line += line_of(&bytes[counted..], start - counted) - 1;
        counted = start;
        rows.push(Row { line, cells: record.iter().map(str::to_owned).collect() });
    }
}

fn match_header(got: &[String], headers: &[Vec<&'static str>]) -> Result<Vec<&'static str>, DatasetProblem> {
    if let Some(header) = headers.iter().find(|header| header.iter().eq(got.iter())) {
        return Ok(header.clone());
    }
    let expected = headers.iter().map(|h| h.join(",")).collect::<Vec<_>>().join(" or ");
    // The nearest of the allowed headers shows best what is wrong.
    let misses = |header: &&Vec<&'static str>| header.iter().filter(|&&name| got.iter().all(|g| g != name)).count();
    let Some(nearest) = headers.iter().min_by_key(misses) else {
        return Err(DatasetProblem::ColumnOrder { expected });
    };
    if let Some(name) = got.iter().find(|g| !nearest.contains(&g.as_str())) {
        return Err(DatasetProblem::UnknownColumn { name: shown(name), expected });
    }
    if let Some(name) = nearest.iter().find(|&&name| got.iter().all(|g| g != name)) {
        return Err(DatasetProblem::MissingColumn { name: (*name).to_owned(), expected });
    }
    Err(DatasetProblem::ColumnOrder { expected })
}
