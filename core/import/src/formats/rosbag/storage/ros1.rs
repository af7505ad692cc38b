//! Bags of ROS 1, version 2.0: <http://wiki.ros.org/Bags/Format/2.0>. Read from front to back without the index at their end,
//! so that one whose recorder was killed is read too.
//!
//! The crate `rosbag` was not used: it maps the file into memory and allocates as much as a chunk states.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{self, BufReader, Read};
use std::path::Path;

use bzip2::read::BzDecoder;

use super::{Channel, Each, MOST_RECORD_BYTES};
use crate::formats::rosbag::wire::Encoding;
use handeye_wording::Text;
use handeye_wording::foreign;
use handeye_wording::text;

const MAGIC: &[u8; 13] = b"#ROSBAG V2.0\n";
/// Longest header of a record: names of a topic and a type.
const MOST_HEADER_BYTES: u32 = 1 << 20;
/// Most topics that are distinguished.
const MOST_CHANNELS: usize = 10_000;

const MESSAGE: u8 = 2;
const CHUNK: u8 = 5;
const CONNECTION: u8 = 7;

pub(super) fn visit(file: &Path, each: &mut Each<'_>) -> Result<(), Text> {
    let mut input = BufReader::new(File::open(file).map_err(|e| foreign(&e))?);
    let mut magic = [0; MAGIC.len()];
    let read = input.read_exact(&mut magic);
    if read.is_err() || magic != *MAGIC {
        return Err(if magic.starts_with(b"#ROSBAG V") {
            text!("is a bag of ROS 1 of a version before 2.0: `rosbag filter OLD NEW True` writes one of version 2.0")
        } else {
            text!("is no bag of ROS 1")
        });
    }
    let mut bag = Bag { channels: BTreeMap::new(), each, is_over: false };
    // After a record that cannot be read the next one cannot be found.
    let _end = bag.records(&mut input, false);
    Ok(())
}

struct Bag<'a> {
    channels: BTreeMap<u32, Channel>,
    each: &'a mut Each<'a>,
    /// No more messages are wanted.
    is_over: bool,
}

impl Bag<'_> {
    /// Reads records up to the end, or to an invalid one.
    fn records(&mut self, input: &mut dyn Read, in_chunk: bool) -> io::Result<()> {
        let (mut header, mut data) = (Vec::new(), Vec::new());
        while !self.is_over {
            let length = u32_of(input)?;
            if length > MOST_HEADER_BYTES {
                return Err(io::ErrorKind::InvalidData.into());
            }
            fill(input, length, &mut header)?;
            let fields = Fields(&header);
            let length = u32_of(input)?;
            match fields.get("op").and_then(|op| op.first().copied()) {
                Some(CHUNK) if !in_chunk => {
                    let mut body = input.take(u64::from(length));
                    // A chunk that is broken costs its own messages.
                    let _broken = self.chunk(&fields, &mut body);
                    io::copy(&mut body, &mut io::sink())?;
                }
                Some(CONNECTION) if length <= MOST_HEADER_BYTES => {
                    fill(input, length, &mut data)?;
                    self.connection(&fields, &Fields(&data));
                }
                Some(MESSAGE) => {
                    if length as usize > MOST_RECORD_BYTES {
                        return Err(io::ErrorKind::InvalidData.into());
                    }
                    fill(input, length, &mut data)?;
                    self.message(&fields, &data);
                }
                _ => skip(input, length)?,
            }
        }
        Ok(())
    }

    fn chunk(&mut self, fields: &Fields, body: &mut dyn Read) -> io::Result<()> {
        let size = fields.u32("size").map_or(0, u64::from);
        match fields.get("compression") {
            Some(b"none") => self.records(body, true),
            // No more is unpacked than the chunk states, and one record of it at a time is kept.
            Some(b"bz2") => self.records(&mut BufReader::new(BzDecoder::new(body).take(size)), true),
            Some(b"lz4") => self.records(&mut BufReader::new(lz4::Decoder::new(body)?.take(size)), true),
            _ => Err(io::ErrorKind::InvalidData.into()),
        }
    }

    fn connection(&mut self, fields: &Fields, data: &Fields) {
        let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
        let (Some(id), Some(topic), Some(kind)) = (fields.u32("conn"), fields.get("topic"), data.get("type")) else {
            return;
        };
        if self.channels.len() < MOST_CHANNELS {
            self.channels.insert(id, Channel::new(text(topic), text(kind), Encoding::Ros1));
        }
    }

    fn message(&mut self, fields: &Fields, data: &[u8]) {
        let Some(channel) = fields.u32("conn").and_then(|id| self.channels.get(&id)) else { return };
        let Some(&[a, b, c, d, e, f, g, h]) = fields.get("time") else { return };
        let [sec, nanosec] = [[a, b, c, d], [e, f, g, h]].map(|part| i64::from(u32::from_le_bytes(part)));
        self.is_over = (self.each)(channel.message(data, sec * 1_000_000_000 + nanosec)).is_break();
    }
}

/// `name=value` after one another, each with its length before it.
struct Fields<'a>(&'a [u8]);

impl<'a> Fields<'a> {
    fn get(&self, name: &str) -> Option<&'a [u8]> {
        let mut rest = self.0;
        while let Some((length, after)) = rest.split_first_chunk::<4>() {
            let (field, after) = after.split_at_checked(u32::from_le_bytes(*length) as usize)?;
            let at = field.iter().position(|byte| *byte == b'=')?;
            if field[..at] == *name.as_bytes() {
                return Some(&field[at + 1..]);
            }
            rest = after;
        }
        None
    }

    fn u32(&self, name: &str) -> Option<u32> {
        Some(u32::from_le_bytes(self.get(name)?.try_into().ok()?))
    }
}

fn u32_of(input: &mut dyn Read) -> io::Result<u32> {
    let mut bytes = [0; 4];
    input.read_exact(&mut bytes)?;
    Ok(u32::from_le_bytes(bytes))
}

/// Reads `length` bytes; memory is allocated as they arrive, not by the stated length.
fn fill(input: &mut dyn Read, length: u32, into: &mut Vec<u8>) -> io::Result<()> {
    into.clear();
    let read = input.take(u64::from(length)).read_to_end(into)?;
    if read < length as usize { Err(io::ErrorKind::UnexpectedEof.into()) } else { Ok(()) }
}

fn skip(input: &mut dyn Read, length: u32) -> io::Result<()> {
    let skipped = io::copy(&mut input.take(u64::from(length)), &mut io::sink())?;
    if skipped < u64::from(length) { Err(io::ErrorKind::UnexpectedEof.into()) } else { Ok(()) }
}
