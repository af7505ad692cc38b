//! Bags in MCAP, of ROS 2 or of ROS 1.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::Read as _;
use std::path::Path;

use mcap::records::Record;
use mcap::sans_io::linear_reader::{LinearReadEvent, LinearReader, LinearReaderOptions};

use super::{Channel, MOST_RECORD_BYTES, Message};
use crate::project::import::formats::rosbag::wire::Encoding;

pub(super) fn visit(file: &Path, each: &mut dyn FnMut(Message)) -> Result<(), String> {
    let mut file = File::open(file).map_err(|e| e.to_string())?;
    let options =
        LinearReaderOptions::default().with_record_length_limit(MOST_RECORD_BYTES).with_validate_chunk_crcs(true);
    let mut reader = LinearReader::new_with_options(options);
    let mut schemas: BTreeMap<u16, String> = BTreeMap::new();
    let mut channels: BTreeMap<u16, Channel> = BTreeMap::new();
    let mut has_begun = false;
    while let Some(event) = reader.next_event() {
        match event {
            Ok(LinearReadEvent::ReadRequest(wanted)) => {
                let read = file.read(reader.insert(wanted)).map_err(|e| e.to_string())?;
                reader.notify_read(read);
            }
            Ok(LinearReadEvent::Record { opcode, data }) => {
                has_begun = true;
                match mcap::parse_record(opcode, data) {
                    Ok(Record::Schema { header, .. }) => {
                        schemas.insert(header.id, header.name);
                    }
                    Ok(Record::Channel(channel)) => {
                        let encoding = match channel.message_encoding.as_str() {
                            "cdr" => Encoding::Cdr,
                            "ros1" => Encoding::Ros1,
                            _ => continue,
                        };
                        let kind = schemas.get(&channel.schema_id).cloned().unwrap_or_default();
                        channels.insert(channel.id, Channel::new(channel.topic, kind, encoding));
                    }
                    Ok(Record::Message { header, data }) => {
                        if let Some(channel) = channels.get(&header.channel_id) {
                            each(channel.message(&data, header.log_time as i64));
                        }
                    }
                    _ => {}
                }
            }
            Err(error) if !has_begun => return Err(error.to_string()),
            Err(_) => break,
        }
    }
    Ok(())
}
