//! The file of the boxes.

use std::io;
use std::path::{Path, PathBuf};

use handeye_plan::surroundings::{KeepOutFile, SurroundingsError};

use super::state::KeepOut;
use crate::text::Text;
use handeye_wording::text;

/// What a file contains at the start; nothing if it does not exist. One that cannot be used is left as it is.
pub(crate) fn opened(file: Option<PathBuf>) -> (KeepOut, Option<Text>) {
    let Some(file) = file else { return (KeepOut::default(), None) };
    match KeepOutFile::read(&file) {
        Ok(content) => {
            let mut keep_out = KeepOut { file: Some(file), ..KeepOut::default() };
            keep_out.set(content);
            let fault = keep_out.fault.clone();
            (keep_out, fault)
        }
        Err(SurroundingsError::Unreadable { source, .. }) if source.kind() == io::ErrorKind::NotFound => {
            (KeepOut { file: Some(file), ..KeepOut::default() }, None)
        }
        Err(error) => {
            let reported = text!(
                "The arm does not keep out of the boxes of this file. The file stays as it is, and the present boxes are not kept for the next start: {error}",
                error = error
            );
            (KeepOut { unsaved: Some(reported.clone()), ..KeepOut::default() }, Some(reported))
        }
    }
}

/// Writes them, as a whole or not at all.
pub(crate) fn write(file: &Path, text: &str) -> io::Result<()> {
    if let Some(folder) = file.parent().filter(|folder| !folder.as_os_str().is_empty()) {
        std::fs::create_dir_all(folder)?;
    }
    let head = "# What the robot's arm keeps out of; docs/reference/surroundings.md lists the keys. Lengths are metres in the base.\n";
    handeye_files::atomic_file::write(file, format!("{head}{text}").as_bytes())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::keep_out::state::with_drawn;

    #[test]
    fn what_was_written_is_there_at_the_next_start_and_a_file_with_a_fault_is_left_alone() {
        let folder = tempfile::tempdir().expect("a folder");
        let file = folder.path().join("deep").join("keep_out.toml");
        let (none, reported) = opened(Some(file.clone()));
        assert_eq!((none.content.boxes.len(), none.file.as_deref(), reported), (0, Some(file.as_path()), None));
        let content = with_drawn(&none.content, [0.1, 0.1], [0.4, 0.3]).expect("a rectangle");
        write(&file, &content.to_toml()).expect("written");
        let (again, reported) = opened(Some(file.clone()));
        assert_eq!((&again.content, again.around.obstacles.len(), reported), (&content, 1, None));

        // One invalid entry is shown, and does not affect the others.
        let mut faulty = again.content.clone();
        faulty.boxes.push(faulty.boxes[0].clone());
        faulty.boxes[1].size_m[0] = -1.0;
        write(&file, &faulty.to_toml()).expect("written");
        let (with_fault, reported) = opened(Some(file.clone()));
        assert_eq!((with_fault.content, with_fault.around.obstacles.len()), (faulty, 1));
        assert!(reported.is_some() && with_fault.file.is_some());

        std::fs::write(&file, "[[box]]\nname = \"post\"\n").expect("written");
        let (broken, reported) = opened(Some(file.clone()));
        assert!(broken.file.is_none() && broken.unsaved.is_some(), "nothing is written over it");
        assert!(
            reported
                .is_some_and(|reported| reported.in_language(crate::text::Language::English).contains("keep_out.toml"))
        );
    }
}
