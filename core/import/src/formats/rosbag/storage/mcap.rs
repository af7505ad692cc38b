//! Bags in MCAP, of ROS 2 or of ROS 1.
//!
//! Chunks are unpacked here and not by the crate that reads the rest: it waits forever for the end of a chunk that states more
//! bytes than it has.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::Read as _;
use std::path::Path;

use ::zstd::stream::read::Decoder as ZstdDecoder;
use mcap::read::ChunkReader;
use mcap::records::{ChunkHeader, Record};
use mcap::sans_io::linear_reader::{LinearReadEvent, LinearReader, LinearReaderOptions};

use super::{Channel, Each, Flow, MOST_RECORD_BYTES, bounded};
use crate::formats::rosbag::wire::Encoding;
use handeye_files::budget::Budget;
use handeye_wording::Text;
use handeye_wording::foreign;

pub(super) fn visit(file: &Path, budget: &Budget<'_>, each: &mut Each<'_>) -> Result<(), Text> {
    let mut file = File::open(file).map_err(|e| foreign(&e))?;
    let options = LinearReaderOptions::default().with_record_length_limit(MOST_RECORD_BYTES).with_emit_chunks(true);
    let mut reader = LinearReader::new_with_options(options);
    let mut bag = Bag { schemas: BTreeMap::new(), channels: BTreeMap::new(), each };
    let mut has_begun = false;
    while let Some(event) = reader.next_event() {
        if budget.is_spent() {
            break;
        }
        match event {
            Ok(LinearReadEvent::ReadRequest(wanted)) => {
                let read = file.read(reader.insert(wanted)).map_err(|e| foreign(&e))?;
                reader.notify_read(read);
            }
            Ok(LinearReadEvent::Record { opcode, data }) => {
                has_begun = true;
                let flow = match mcap::parse_record(opcode, data) {
                    // A chunk that is broken costs its own messages.
                    Ok(Record::Chunk { header, data }) => bag.chunk(&header, &data, budget),
                    Ok(record) => bag.record(record),
                    Err(_broken) => Flow::Continue(()),
                };
                if flow.is_break() {
                    break;
                }
            }
            Err(error) if !has_begun => return Err(foreign(&error)),
            Err(_) => break,
        }
    }
    Ok(())
}

struct Bag<'a> {
    schemas: BTreeMap<u16, String>,
    channels: BTreeMap<u16, Channel>,
    each: &'a mut Each<'a>,
}

impl Bag<'_> {
    fn chunk(&mut self, header: &ChunkHeader, data: &[u8], budget: &Budget<'_>) -> Flow {
        let most = usize::try_from(header.uncompressed_size).unwrap_or(usize::MAX).min(MOST_RECORD_BYTES);
        let plain = match header.compression.as_str() {
            "" => Some(data.to_vec()),
            "lz4" => lz4::Decoder::new(data).ok().and_then(|decoder| bounded(decoder, most)),
            "zstd" => ZstdDecoder::with_buffer(data).ok().and_then(|decoder| bounded(decoder, most)),
            _ => None,
        };
        let Some(plain) = plain else { return Flow::Continue(()) };
        let length = plain.len() as u64;
        let header = ChunkHeader {
            compression: String::new(),
            compressed_size: length,
            uncompressed_size: length,
            ..header.clone()
        };
        let Ok(records) = ChunkReader::new(header, &plain) else { return Flow::Continue(()) };
        for record in records {
            let Ok(record) = record else { break };
            if budget.is_spent() {
                return Flow::Break(());
            }
            self.record(record)?;
        }
        Flow::Continue(())
    }

    fn record(&mut self, record: Record<'_>) -> Flow {
        match record {
            Record::Schema { header, .. } => {
                self.schemas.insert(header.id, header.name);
            }
            Record::Channel(channel) => {
                let encoding = match channel.message_encoding.as_str() {
                    "cdr" => Encoding::Cdr,
                    "ros1" => Encoding::Ros1,
                    _ => return Flow::Continue(()),
                };
                let kind = self.schemas.get(&channel.schema_id).cloned().unwrap_or_default();
                self.channels.insert(channel.id, Channel::new(channel.topic, kind, encoding));
            }
            Record::Message { header, data } => {
                if let Some(channel) = self.channels.get(&header.channel_id) {
                    return (self.each)(channel.message(&data, header.log_time as i64));
                }
            }
            _ => {}
        }
        Flow::Continue(())
    }
}
