//! The formats that are read, each in its own file and all of them in [`ALL`].

mod blocks;
mod board_words;
mod cameras;
pub(super) mod corners;
mod easy_handeye;
mod industrial_calibration;
mod intrinsics;
pub(super) mod joints;
mod moveit;
mod named;
mod names;
pub(super) mod nothing;
mod npz;
mod parts;
mod pose_files;
mod program;
pub(super) mod reader;
mod rosbag;
mod single;
mod table;
mod text_camera;
pub(super) mod tree;
mod visp;

use std::path::{Path, PathBuf};

use crate::formats::nothing::Likely;
use crate::formats::reader::Reader;
use crate::recording::Recording;
use crate::value::Value;
use handeye_wording::Text;

/// All formats. A file is offered to them in this order: the most specific ones come first.
pub(crate) const ALL: [&dyn Format; 14] = [
    &corners::Corners,
    &visp::Visp,
    &pose_files::PoseFiles,
    &easy_handeye::EasyHandeye,
    &industrial_calibration::IndustrialCalibration,
    &program::Programs,
    &table::Tables,
    &blocks::Blocks,
    &tree::Documents,
    &npz::NumPy,
    &rosbag::Bags,
    &moveit::MoveIt,
    &cameras::Cameras,
    &board_words::BoardWords,
];

/// A format of files with poses, joint values, corners, cameras or targets.
pub(crate) trait Format: Sync {
    /// Name for the window, the command line and the document.
    fn name(&self) -> Text;

    /// Endings of its files where no other format has them, in lower case without the first dot.
    fn endings(&self) -> &'static [(&'static str, Encoding)] {
        &[]
    }

    /// Whether it has poses or joint values: once a file's poses were read, no other format reads them again.
    fn is_of_poses(&self) -> bool {
        true
    }

    /// Whether a file of its endings is read together with a named file, which may need it as a camera or a target.
    fn is_companion(&self, _file: &Path, _named: &Path) -> bool {
        !self.is_of_poses()
    }

    /// Whether a file may be of this format, by its ending or its contents.
    fn sniff(&self, file: &File) -> bool {
        self.has_ending(file)
    }

    /// Whether the name of a file has an ending of this format only.
    fn has_ending(&self, file: &File) -> bool {
        let own = of_ending(&file.path).is_some_and(|(format, _)| format.endings() == self.endings());
        own && !self.endings().is_empty()
    }

    /// Reads files of one naming together; whether they are a series together, which no other format reads.
    fn read_together(&self, _files: &[File], _reader: &mut Reader<'_>) -> bool {
        false
    }

    /// Reads a file; whether it has poses or joint values, which no other format looks for then.
    fn read(&self, _file: &File, _reader: &mut Reader<'_>) -> bool {
        false
    }

    /// Adds what all files together show about series.
    fn finish(&self, _recording: &mut Recording) {}

    /// What a file of its endings has where no series was found.
    fn instead(&self, _file: &File, _reader: &Reader<'_>) -> Option<(Likely, Text)> {
        None
    }
}

/// How a file is read before its format is known.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Encoding {
    Json,
    Yaml,
    Xml,
    Text,
    /// Read by its format only.
    Own,
    /// Read by its format only, which may have several files of a folder; after all others.
    Bag,
}

/// A file of a recording.
#[derive(Debug, Clone)]
pub(crate) struct File {
    /// Below the folder of the recording.
    pub path: PathBuf,
    /// The number in its name that differs from file to file.
    pub number: Option<u64>,
    pub content: Content,
}

#[derive(Debug, Clone)]
pub(crate) enum Content {
    /// A value from JSON, YAML or XML, whatever the ending of the file is.
    Document(Value),
    Text(String),
    /// Its format reads it.
    Unread,
}

impl File {
    pub fn name(&self) -> String {
        self.path.display().to_string()
    }

    pub fn value(&self) -> Option<&Value> {
        if let Content::Document(value) = &self.content { Some(value) } else { None }
    }

    pub fn text(&self) -> Option<&str> {
        if let Content::Text(text) = &self.content { Some(text) } else { None }
    }
}

/// The format whose files end as a name does, and how they are read.
pub(crate) fn of_ending(path: &Path) -> Option<(&'static dyn Format, Encoding)> {
    let name = path.file_name()?.to_string_lossy().to_lowercase();
    let has = |ending: &str| match name.strip_suffix(ending) {
        Some(_) if ending.is_empty() => path.extension().is_none_or(std::ffi::OsStr::is_empty),
        Some(rest) => rest.len() > 1 && rest.ends_with('.'),
        None => false,
    };
    let endings = ALL.iter().flat_map(|format| format.endings().iter().map(|(ending, how)| (*format, *ending, *how)));
    endings.into_iter().find(|(_, ending, _)| has(ending)).map(|(format, _, encoding)| (format, encoding))
}

/// The formats that [`open`](crate::open) reads: their names, and the endings of their files where these identify them.
pub fn formats() -> Vec<(Text, String)> {
    let endings = |format: &dyn Format| {
        let named = format.endings().iter().filter(|(ending, _)| !ending.is_empty());
        named.map(|(ending, _)| format!(".{ending}")).collect::<Vec<_>>().join(" ")
    };
    ALL.iter().map(|format| (format.name(), endings(*format))).collect()
}

/// Formats with poses whose files are identified by their endings.
pub(crate) fn with_poses() -> Text {
    let named = ALL.iter().filter(|format| format.is_of_poses() && !format.endings().is_empty());
    Text::list(named.map(|format| format.name()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_document_has_a_row_for_every_format_that_is_read() {
        let page = include_str!("../../../../docs/reference/import.md");
        for (name, endings) in formats() {
            let row = page.lines().find(|line| line.starts_with(&format!("| {name} |")));
            let row = row.unwrap_or_else(|| panic!("no row for {name}"));
            for ending in endings.split_whitespace() {
                assert!(row.contains(ending.trim_start_matches('.')), "{ending} of {name}");
            }
        }
    }

    #[test]
    fn a_name_ends_as_one_format_has_it() {
        let encoding = |name: &str| of_ending(Path::new(name)).map(|(_, encoding)| encoding);
        assert_eq!(encoding("a/POSES.CSV"), Some(Encoding::Text));
        assert_eq!(encoding("a.b/poses"), Some(Encoding::Text));
        assert_eq!(encoding("a/bag_0.mcap.zstd"), Some(Encoding::Bag));
        assert_eq!(encoding("a/b.zstd"), None);
        assert_eq!(encoding("a/image.png"), None);
        let mut names: Vec<&str> = ALL.iter().flat_map(|format| format.endings()).map(|(ending, _)| *ending).collect();
        let count = names.len();
        names.sort_unstable();
        names.dedup();
        assert_eq!(names.len(), count);
    }
}
