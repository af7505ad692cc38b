//! The messages of a bag, one after the other, from either of its kinds of file. What a file says of its own lengths is
//! bounded before anything is allocated.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::Read;
use std::path::Path;

use mcap::records::Record;
use mcap::sans_io::linear_reader::{LinearReadEvent, LinearReader, LinearReaderOptions};
use rusqlite::{Connection, OpenFlags};

/// Longest record that is read: an image of eighty megapixels in colour.
const MOST_RECORD_BYTES: usize = 1 << 28;

/// A message as it was recorded.
pub(super) struct Message<'a> {
    pub topic: &'a str,
    /// Its type, such as `sensor_msgs/msg/Image`.
    pub kind: &'a str,
    /// CDR.
    pub data: &'a [u8],
    /// When it was recorded.
    pub log_ns: i64,
}

/// Calls with every message of a file, by the ending of its name. A file that breaks off has what came before.
///
/// # Errors
/// A sentence, where it is no bag.
pub(super) fn visit(file: &Path, each: &mut dyn FnMut(Message)) -> Result<(), String> {
    if file.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("db3")) {
        return visit_db3(file, each);
    }
    visit_mcap(File::open(file).map_err(|e| e.to_string())?, each)
}

/// A channel of a file: its topic and its type.
struct Channel {
    topic: String,
    kind: String,
}

fn visit_mcap(mut file: impl Read, each: &mut dyn FnMut(Message)) -> Result<(), String> {
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
                    Ok(Record::Channel(channel)) if channel.message_encoding == "cdr" => {
                        let kind = schemas.get(&channel.schema_id).cloned().unwrap_or_default();
                        channels.insert(channel.id, Channel { topic: channel.topic, kind });
                    }
                    Ok(Record::Message { header, data }) => {
                        if let Some(Channel { topic, kind }) = channels.get(&header.channel_id) {
                            each(Message { topic, kind, data: &data, log_ns: header.log_time as i64 });
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

fn visit_db3(file: &Path, each: &mut dyn FnMut(Message)) -> Result<(), String> {
    let mut open = || -> rusqlite::Result<()> {
        // Whoever records still holds its journal: nothing beside the file is made.
        let bag =
            Connection::open_with_flags(file, OpenFlags::SQLITE_OPEN_READ_ONLY | OpenFlags::SQLITE_OPEN_NO_MUTEX)?;
        bag.set_limit(rusqlite::limits::Limit::SQLITE_LIMIT_LENGTH, MOST_RECORD_BYTES as i32)?;
        let mut topics = bag.prepare("SELECT id, name, type, serialization_format FROM topics")?;
        let mut rows = topics.query([])?;
        let mut channels: BTreeMap<i64, Channel> = BTreeMap::new();
        while let Some(row) = rows.next()? {
            if row.get_ref(3)?.as_str().is_ok_and(|format| format == "cdr") {
                channels.insert(row.get(0)?, Channel { topic: row.get(1)?, kind: row.get(2)? });
            }
        }
        let mut messages = bag.prepare("SELECT topic_id, timestamp, data FROM messages ORDER BY id")?;
        let mut rows = messages.query([])?;
        // A page that cannot be read ends it.
        while let Ok(Some(row)) = rows.next() {
            let (Ok(id), Ok(log_ns)) = (row.get::<_, i64>(0), row.get(1)) else { continue };
            let Some(Channel { topic, kind }) = channels.get(&id) else { continue };
            if let Ok(data) = row.get_ref(2)?.as_blob() {
                each(Message { topic, kind, data, log_ns });
            }
        }
        Ok(())
    };
    open().map_err(|e| e.to_string())
}
