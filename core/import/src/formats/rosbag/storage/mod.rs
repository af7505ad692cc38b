//! The messages of a bag, one after the other, from every kind of its files. Lengths that a file states are bounded before
//! anything is allocated, and so is the output of decompression.

mod db3;
mod mcap;
mod ros1;
mod zstd;

use std::io::Read;
use std::ops::ControlFlow;
use std::path::Path;

use super::wire::{Encoding, Reader};
use handeye_files::budget::Budget;
use handeye_wording::Text;

pub(super) use self::zstd::plain_parts;

/// Longest record that is read: an image of eighty megapixels in colour.
const MOST_RECORD_BYTES: usize = 1 << 28;

/// A message as it was recorded.
pub(super) struct Message<'a> {
    pub topic: &'a str,
    /// Its type as ROS 2 calls it, such as `sensor_msgs/msg/Image`.
    pub kind: &'a str,
    pub encoding: Encoding,
    pub data: &'a [u8],
    /// When it was recorded.
    pub log_ns: i64,
}

impl<'a> Message<'a> {
    /// Reads its fields; `None` for an invalid encoding.
    pub fn reader(&self) -> Option<Reader<'a>> {
        Reader::new(self.encoding, self.data)
    }
}

/// Calls `each` with every message of a file, by the ending of its name, and ends when it returns a break. A truncated file
/// has the messages before its end.
///
/// # Errors
/// A sentence, where it is not a bag or the budget is spent.
pub(super) fn visit(file: &Path, budget: &Budget<'_>, each: &mut dyn FnMut(Message)) -> Result<(), Text> {
    let ends = |with: &str| file.extension().is_some_and(|ending| ending.eq_ignore_ascii_case(with));
    let mut each = |message: Message| {
        zstd::with_plain_data(message, each);
        if budget.is_spent() { Flow::Break(()) } else { Flow::Continue(()) }
    };
    if ends("bag") {
        ros1::visit(file, &mut each)?;
    } else if ends("db3") {
        db3::visit(file, &mut each)?;
    } else {
        mcap::visit(file, budget, &mut each)?;
    }
    Ok(budget.check()?)
}

/// Whether to go on with further messages.
type Flow = ControlFlow<()>;

/// The callback for the messages of any kind of file.
type Each<'a> = dyn FnMut(Message) -> Flow + 'a;

/// Reads at most `most` bytes; `None` for more, or on a read error.
fn bounded(input: impl Read, most: usize) -> Option<Vec<u8>> {
    let mut data = Vec::new();
    let read = input.take(most as u64 + 1).read_to_end(&mut data).ok()?;
    (read <= most).then_some(data)
}

/// A channel of a file: its topic, its type and how its messages are encoded.
struct Channel {
    topic: String,
    kind: String,
    encoding: Encoding,
}

impl Channel {
    fn new(topic: String, kind: String, encoding: Encoding) -> Self {
        let kind = match (encoding, kind.as_str()) {
            // The type that tf2 has replaced, with the same fields.
            (Encoding::Ros1, "tf/tfMessage") => "tf2_msgs/msg/TFMessage".to_owned(),
            (Encoding::Ros1, kind) if !kind.contains("/msg/") => kind.replacen('/', "/msg/", 1),
            _ => kind,
        };
        Self { topic, kind, encoding }
    }

    fn message<'a>(&'a self, data: &'a [u8], log_ns: i64) -> Message<'a> {
        Message { topic: &self.topic, kind: &self.kind, encoding: self.encoding, data, log_ns }
    }
}
