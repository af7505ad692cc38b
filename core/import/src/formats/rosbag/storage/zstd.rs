//! Files and messages that rosbag2 compresses itself: whole files, `.db3.zstd` and `.mcap.zstd`, or every message
//! alone.

use std::fs::File;
use std::io::{self, Read as _, Write as _};
use std::path::{Path, PathBuf};

use tempfile::TempDir;
use zstd::stream::read::Decoder;

use super::{MOST_RECORD_BYTES, Message, bounded};
use crate::formats::rosbag::wire::Encoding;
use handeye_files::budget::Budget;
use handeye_wording::Text;
use handeye_wording::foreign;
use handeye_wording::text;

/// The beginning of a frame. CDR begins with zero.
const MAGIC: [u8; 4] = [0x28, 0xb5, 0x2f, 0xfd];
/// Bytes that are unpacked between two checks of the budget.
const PIECE_BYTES: usize = 1 << 20;

/// Whether a file is compressed as a whole.
fn is_compressed(file: &Path) -> bool {
    file.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("zstd"))
}

/// The files of a bag as they are without compression; those that are unpacked for it are in the returned folder.
///
/// # Errors
/// A sentence, where one cannot be unpacked or the budget is spent.
pub(in super::super) fn plain_parts(
    parts: &[PathBuf],
    budget: &Budget<'_>,
) -> Result<(Vec<PathBuf>, Option<TempDir>), Text> {
    if !parts.iter().any(|part| is_compressed(part)) {
        return Ok((parts.to_vec(), None));
    }
    let scratch = tempfile::tempdir().map_err(|e| foreign(&e))?;
    let mut plain = Vec::with_capacity(parts.len());
    for part in parts {
        if is_compressed(part) {
            let name = part.file_stem().ok_or_else(|| text!("has no name"))?;
            let unpacked = scratch.path().join(name);
            unpack(part, &unpacked, budget)?;
            plain.push(unpacked);
        } else {
            plain.push(part.clone());
        }
    }
    Ok((plain, Some(scratch)))
}

fn unpack(from: &Path, to: &Path, budget: &Budget<'_>) -> Result<(), Text> {
    let reported = |e: io::Error| foreign(&e);
    let file = File::open(from).map_err(reported)?;
    let mut out = File::create_new(to).map_err(reported)?;
    let mut input = Decoder::new(file).map_err(reported)?;
    let mut piece = vec![0; PIECE_BYTES];
    let mut is_empty = true;
    loop {
        match input.read(&mut piece) {
            Ok(0) => return Ok(()),
            Ok(count) => {
                budget.unpack(count as u64)?;
                out.write_all(&piece[..count]).map_err(reported)?;
                is_empty = false;
            }
            // A truncated file has the data before its end: its reader determines how far that goes.
            Err(error) if !is_empty => {
                tracing::debug!("{} breaks off: {error}", from.display());
                return Ok(());
            }
            Err(error) => return Err(text!("cannot be unpacked: {why}", why = error)),
        }
    }
}

/// Passes a message on, unpacked where it was compressed alone. One that cannot be unpacked is left out.
pub(super) fn with_plain_data(message: Message, each: &mut dyn FnMut(Message)) {
    if message.encoding != Encoding::Cdr || !message.data.starts_with(&MAGIC) {
        return each(message);
    }
    let unpacked = Decoder::with_buffer(message.data).ok().and_then(|decoder| bounded(decoder, MOST_RECORD_BYTES));
    if let Some(data) = unpacked {
        each(Message { data: &data, ..message });
    }
}
