//! rosbag2 in SQLite: the tables `topics` and `messages`. The names of the topics' columns are those since its first version.

use std::io;
use std::path::Path;

use rusqlite::{Connection, OpenFlags};

use super::super::unpack::Unpacking;
use super::Recording;
use crate::data::error::LogError;

/// How a message begins that rosbag2 has compressed on its own.
const ZSTD: &[u8] = b"\x28\xb5\x2f\xfd";

pub(super) fn read(path: &Path, recording: &mut Recording) -> Result<(), LogError> {
    add(path, recording).map_err(|why| LogError::Form {
        path: path.to_owned(),
        fault: format!(
            "is no whole rosbag2: {why}; record it again, or save what is left: `sqlite3 run.db3 .recover | sqlite3 mended.db3`"
        ),
    })
}

fn add(path: &Path, recording: &mut Recording) -> rusqlite::Result<()> {
    let bag = Connection::open_with_flags(path, OpenFlags::SQLITE_OPEN_READ_ONLY)?;
    let mut topics = bag.prepare("SELECT id, name, type, serialization_format FROM topics")?;
    let mut topics = topics.query([])?;
    while let Some(row) = topics.next()? {
        let [name, kind, encoding] = [row.get::<_, String>(1)?, row.get(2)?, row.get(3)?];
        let topic = recording.topic(&name, &kind, &encoding);
        add_messages(&bag, row.get(0)?, topic, recording)?;
    }
    Ok(())
}

fn add_messages(
    bag: &Connection,
    id: i64,
    topic: usize,
    recording: &mut Recording,
) -> rusqlite::Result<()> {
    if recording.topics[topic].decoder.is_none() {
        let count = "SELECT count(*) FROM messages WHERE topic_id = ?1";
        let count: i64 = bag.query_row(count, [id], |row| row.get(0))?;
        recording.topics[topic].messages += usize::try_from(count).unwrap_or(0);
        return Ok(());
    }
    let mut messages = bag.prepare("SELECT timestamp, data FROM messages WHERE topic_id = ?1")?;
    let mut messages = messages.query([id])?;
    while let Some(row) = messages.next()? {
        let data = row.get_ref(1)?.as_blob()?;
        match data.starts_with(ZSTD) {
            true => recording.add(topic, row.get(0)?, &unpacked(data).unwrap_or_default()),
            false => recording.add(topic, row.get(0)?, data),
        }
    }
    Ok(())
}

fn unpacked(message: &[u8]) -> io::Result<Vec<u8>> {
    Unpacking::of(message.len() as u64).read(zstd::Decoder::new(message)?)
}
