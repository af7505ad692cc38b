//! A folder as one archive, for a page to download: written piece by piece, without a file of its own.

use std::io::{self, Write};
use std::path::{Path, PathBuf};

use axum::body::Bytes;
use tokio::sync::mpsc;
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, ZipWriter};

/// Most that is put into an archive \[bytes\].
const MOST: u64 = 4 << 30;

/// Bytes at a time.
const PIECE: usize = 256 * 1024;

/// Pieces that wait for the receiver.
const WAITING: usize = 4;

/// What goes into an archive.
#[derive(Debug)]
pub struct Contents {
    files: Vec<Listed>,
}

#[derive(Debug)]
struct Listed {
    path: PathBuf,
    /// In the archive.
    name: PathBuf,
    bytes: u64,
}

impl Contents {
    /// All files of a folder. Links are left out, because they may lead anywhere.
    ///
    /// # Errors
    /// When something cannot be read, or is too large.
    pub fn of(folder: &Path) -> io::Result<Self> {
        let top = folder.file_name().map_or_else(|| PathBuf::from("handeye"), PathBuf::from);
        let mut files = Vec::new();
        list(folder, &top, &mut files)?;
        let bytes: u64 = files.iter().map(|file| file.bytes).sum();
        if bytes > MOST {
            return Err(io::Error::other("the folder holds more than 4 GiB"));
        }
        Ok(Self { files })
    }

    /// Writes the archive to the receiver of the pieces, and ends when that is gone.
    ///
    /// # Errors
    /// When something cannot be read or written.
    pub fn write(&self, to: impl Write) -> io::Result<()> {
        let mut archive = ZipWriter::new_stream(io::BufWriter::with_capacity(PIECE, to));
        for Listed { path, name, bytes } in &self.files {
            let file = std::fs::File::open(path)?;
            let is_packed = path.extension().is_some_and(|kind| kind == "png" || kind == "jpg");
            let method = if is_packed { CompressionMethod::Stored } else { CompressionMethod::Deflated };
            let options = SimpleFileOptions::default().compression_method(method).large_file(true);
            archive.start_file(name.to_string_lossy(), options).map_err(io::Error::other)?;
            // A file that still grows is included with the size it had when it was listed.
            io::copy(&mut io::Read::take(file, *bytes), &mut archive)?;
        }
        archive.finish().map_err(io::Error::other)?.flush()
    }
}

fn list(folder: &Path, name: &Path, files: &mut Vec<Listed>) -> io::Result<()> {
    let mut entries: Vec<_> = std::fs::read_dir(folder)?.collect::<Result<_, _>>()?;
    entries.sort_by_key(std::fs::DirEntry::file_name);
    for entry in entries {
        let name = name.join(entry.file_name());
        let kind = entry.file_type()?;
        if kind.is_dir() {
            list(&entry.path(), &name, files)?;
        } else if kind.is_file() {
            files.push(Listed { path: entry.path(), name, bytes: entry.metadata()?.len() });
        }
    }
    Ok(())
}

/// The writing end of an archive: sends it piece by piece to a receiver.
pub struct Pieces {
    to: mpsc::Sender<io::Result<Bytes>>,
    is_gone: bool,
}

impl Pieces {
    /// What is written here arrives at the second.
    pub fn new() -> (Self, mpsc::Receiver<io::Result<Bytes>>) {
        let (to, from) = mpsc::channel(WAITING);
        (Self { to, is_gone: false }, from)
    }

    /// Reports that the rest does not come.
    pub fn fail(&self, error: io::Error) {
        // The receiver may be gone.
        let _sent = self.to.blocking_send(Err(error)).is_ok();
    }
}

impl Write for Pieces {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        // Reported once: an archive that is abandoned still writes its end.
        if !self.is_gone && self.to.blocking_send(Ok(Bytes::copy_from_slice(bytes))).is_err() {
            self.is_gone = true;
            return Err(io::ErrorKind::BrokenPipe.into());
        }
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
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
        std::fs::write(exports.join("image.png"), vec![7; 3 * PIECE]).expect("written");
        let (mut pieces, mut from) = Pieces::new();
        let contents = Contents::of(&exports).expect("listed");
        let writing = std::thread::spawn(move || contents.write(&mut pieces));
        let mut bytes = Vec::new();
        while let Some(piece) = from.blocking_recv() {
            let piece = piece.expect("readable");
            assert!(piece.len() <= PIECE, "{} bytes wait at once", piece.len());
            bytes.extend_from_slice(&piece);
        }
        writing.join().expect("no panic").expect("written");
        let mut archive = zip::ZipArchive::new(io::Cursor::new(bytes)).expect("readable");
        let names: Vec<_> = archive.file_names().map(str::to_owned).collect();
        assert_eq!(names.len(), 3, "{names:?}");
        let text = io::read_to_string(archive.by_name("exports/ros/camera.yaml").expect("there")).expect("text");
        assert_eq!(text, "fx: 1");
    }

    #[test]
    fn an_archive_that_nobody_takes_any_more_ends() {
        let folder = tempfile::tempdir().expect("a folder");
        for number in 0..10 {
            std::fs::write(folder.path().join(format!("{number}.png")), vec![7; 2 * PIECE]).expect("written");
        }
        let (mut pieces, mut from) = Pieces::new();
        let contents = Contents::of(folder.path()).expect("listed");
        let writing = std::thread::spawn(move || contents.write(&mut pieces));
        assert!(from.blocking_recv().is_some());
        drop(from);
        let error = writing.join().expect("no panic").expect_err("nobody takes it");
        assert_eq!(error.kind(), io::ErrorKind::BrokenPipe, "{error}");
    }
}
