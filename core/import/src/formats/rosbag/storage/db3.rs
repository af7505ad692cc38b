//! Bags in SQLite, of ROS 2.

use std::collections::BTreeMap;
use std::path::Path;

use rusqlite::config::DbConfig;
use rusqlite::{Connection, OpenFlags};

use super::{Channel, Each, MOST_RECORD_BYTES};
use crate::formats::rosbag::wire::Encoding;
use handeye_wording::Text;
use handeye_wording::foreign;

pub(super) fn visit(file: &Path, each: &mut Each<'_>) -> Result<(), Text> {
    let mut open = || -> rusqlite::Result<()> {
        // A recorder that is still running holds its journal: no other file is created.
        let bag =
            Connection::open_with_flags(file, OpenFlags::SQLITE_OPEN_READ_ONLY | OpenFlags::SQLITE_OPEN_NO_MUTEX)?;
        bag.set_limit(rusqlite::limits::Limit::SQLITE_LIMIT_LENGTH, MOST_RECORD_BYTES as i32)?;
        // A view is a program, which need not end. Rows of tables are read one by one.
        bag.set_db_config(DbConfig::SQLITE_DBCONFIG_ENABLE_VIEW, false)?;
        bag.set_db_config(DbConfig::SQLITE_DBCONFIG_TRUSTED_SCHEMA, false)?;
        let mut topics = bag.prepare("SELECT id, name, type, serialization_format FROM topics")?;
        let mut rows = topics.query([])?;
        let mut channels: BTreeMap<i64, Channel> = BTreeMap::new();
        while let Some(row) = rows.next()? {
            if row.get_ref(3)?.as_str().is_ok_and(|format| format == "cdr") {
                channels.insert(row.get(0)?, Channel::new(row.get(1)?, row.get(2)?, Encoding::Cdr));
            }
        }
        let mut messages = bag.prepare("SELECT topic_id, timestamp, data FROM messages ORDER BY rowid")?;
        let mut rows = messages.query([])?;
        // A page that cannot be read ends it.
        while let Ok(Some(row)) = rows.next() {
            let (Ok(id), Ok(log_ns)) = (row.get::<_, i64>(0), row.get(1)) else { continue };
            let Some(channel) = channels.get(&id) else { continue };
            let Ok(data) = row.get_ref(2)?.as_blob() else { continue };
            if each(channel.message(data, log_ns)).is_break() {
                break;
            }
        }
        Ok(())
    };
    open().map_err(|e| foreign(&e))
}
