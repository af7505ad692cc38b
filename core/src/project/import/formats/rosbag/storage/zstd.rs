//! What rosbag2 compresses by itself: whole files, `.db3.zstd` and `.mcap.zstd`, or every message alone.

use std::fs::File;
use std::io::{self, Read as _};
use std::path::{Path, PathBuf};

use tempfile::TempDir;
use zstd::stream::read::Decoder;

use super::{MOST_RECORD_BYTES, Message};
use crate::project::import::formats::rosbag::wire::Encoding;

/// What a frame begins with. CDR begins with zero.
const MAGIC: [u8; 4] = [0x28, 0xb5, 0x2f, 0xfd];
/// How much a file may become: so many times its size and a little, since simulated images compress well, and never more
/// than what a long recording of raw images has. A file that goes on for ever fills no disk.
const MOST_TIMES: u64 = 1000;
const LITTLE_BYTES: u64 = 1 << 26;
const MOST_FILE_BYTES: u64 = 1 << 36;

/// Whether a file is compressed as a whole.
fn is_compressed(file: &Path) -> bool {
    file.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("zstd"))
}

/// The files of a bag as they are without compression; those that are unpacked for it lie in the folder that comes with them.
///
/// # Errors
/// A sentence, where one cannot be unpacked.
pub(in super::super) fn plain_parts(parts: &[PathBuf]) -> Result<(Vec<PathBuf>, Option<TempDir>), String> {
    if !parts.iter().any(|part| is_compressed(part)) {
        return Ok((parts.to_vec(), None));
    }
    let scratch = tempfile::tempdir().map_err(|e| e.to_string())?;
    let mut plain = Vec::with_capacity(parts.len());
    for part in parts {
        if is_compressed(part) {
            let name = part.file_stem().ok_or("has no name")?;
            let unpacked = scratch.path().join(name);
            unpack(part, &unpacked)?;
            plain.push(unpacked);
        } else {
            plain.push(part.clone());
        }
    }
    Ok((plain, Some(scratch)))
}

fn unpack(from: &Path, to: &Path) -> Result<(), String> {
    let said = |e: io::Error| e.to_string();
    let file = File::open(from).map_err(said)?;
    let most = file.metadata().map_err(said)?.len().saturating_mul(MOST_TIMES).saturating_add(LITTLE_BYTES);
    let most = most.min(MOST_FILE_BYTES);
    let mut out = File::create_new(to).map_err(said)?;
    let mut input = Decoder::new(file).map_err(said)?.take(most);
    // One that breaks off has what came before: whoever reads it finds out how far that goes.
    let copied = io::copy(&mut input, &mut out);
    match copied {
        Ok(copied) if copied == most => {
            Err(format!("becomes more than {most} bytes: unpack it with `zstd -d` and name the file"))
        }
        Ok(_) => Ok(()),
        Err(error) if out.metadata().is_ok_and(|m| m.len() > 0) => {
            tracing::debug!("{} breaks off: {error}", from.display());
            Ok(())
        }
        Err(error) => Err(format!("cannot be unpacked: {error}")),
    }
}

/// Passes a message on, unpacked where it was compressed alone. One that cannot be unpacked is left out.
pub(super) fn with_plain_data(message: Message, each: &mut dyn FnMut(Message)) {
    if message.encoding != Encoding::Cdr || !message.data.starts_with(&MAGIC) {
        return each(message);
    }
    let mut data = Vec::new();
    let unpacked = Decoder::with_buffer(message.data)
        .and_then(|decoder| decoder.take(MOST_RECORD_BYTES as u64).read_to_end(&mut data));
    if unpacked.is_ok_and(|length| length < MOST_RECORD_BYTES) {
        each(Message { data: &data, ..message });
    }
}
