//! A folder as one archive, for a page to download.

use std::io::{self, Write as _};
use std::path::{Path, PathBuf};

use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, ZipWriter};

/// Most that is put into an archive \[bytes\].
const MOST: u64 = 4 << 30;

/// Writes all files of a folder into an archive, which is a temporary file without a name.
///
/// # Errors
/// When something cannot be read or written, or is too large.
pub fn of(folder: &Path) -> io::Result<std::fs::File> {
    let mut archive = ZipWriter::new(tempfile::tempfile()?);
    let top = folder.file_name().map_or_else(|| PathBuf::from("handeye"), PathBuf::from);
    let mut left = MOST;
    add(&mut archive, folder, &top, &mut left)?;
    let mut file = archive.finish().map_err(io::Error::other)?;
    file.flush()?;
    io::Seek::rewind(&mut file)?;
    Ok(file)
}

fn add(archive: &mut ZipWriter<std::fs::File>, folder: &Path, name: &Path, left: &mut u64) -> io::Result<()> {
    let mut entries: Vec<_> = std::fs::read_dir(folder)?.collect::<Result<_, _>>()?;
    entries.sort_by_key(std::fs::DirEntry::file_name);
    for entry in entries {
        let name = name.join(entry.file_name());
        // A link may lead anywhere.
        let kind = entry.file_type()?;
        if kind.is_dir() {
            add(archive, &entry.path(), &name, left)?;
        } else if kind.is_file() {
            let mut file = std::fs::File::open(entry.path())?;
            *left = left
                .checked_sub(file.metadata()?.len())
                .ok_or_else(|| io::Error::other("the folder holds more than 4 GiB"))?;
            let is_packed = entry.path().extension().is_some_and(|kind| kind == "png" || kind == "jpg");
            let method = if is_packed { CompressionMethod::Stored } else { CompressionMethod::Deflated };
            let options = SimpleFileOptions::default().compression_method(method).large_file(true);
            archive.start_file(name.to_string_lossy(), options).map_err(io::Error::other)?;
            io::copy(&mut file, archive)?;
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_archive_has_every_file_and_follows_no_link() {
        let folder = tempfile::tempdir().expect("a folder");
        let exports = folder.path().join("exports");
        std::fs::create_dir_all(exports.join("ros")).expect("made");
        std::fs::write(exports.join("ros/camera.yaml"), "fx: 1").expect("written");
        std::fs::write(exports.join("result.json"), "{}").expect("written");
        std::os::unix::fs::symlink("/etc/passwd", exports.join("secret")).expect("linked");
        let mut archive = zip::ZipArchive::new(of(&exports).expect("an archive")).expect("readable");
        let names: Vec<_> = archive.file_names().map(str::to_owned).collect();
        assert_eq!(names.len(), 2, "{names:?}");
        let text = io::read_to_string(archive.by_name("exports/ros/camera.yaml").expect("there")).expect("text");
        assert_eq!(text, "fx: 1");
    }
}
