//! rosbag2 in SQLite: the tables `topics` and `messages`. The columns of `topics` have had these names since its first
//! version.

use std::collections::HashMap;
use std::error::Error;
use std::fs;
use std::path::Path;

use rusqlite::{Connection, OpenFlags};

use super::Recording;
use residyn_core::data::LogError;

/// The first bytes of a message that rosbag2 has compressed separately.
const ZSTD: &[u8] = b"\x28\xb5\x2f\xfd";

pub(super) fn read(path: &Path, recording: &mut Recording) -> Result<(), LogError> {
    add(path, recording).map_err(|why| {
        let fault = format!(
            "is not a complete rosbag2: {why}; record it again, or save what is left: `sqlite3 run.db3 .recover | sqlite3 mended.db3`"
        );
        LogError::form(path, fault)
    })
}

fn add(path: &Path, recording: &mut Recording) -> Result<(), Box<dyn Error>> {
    let bag = Connection::open_with_flags(path, OpenFlags::SQLITE_OPEN_READ_ONLY)?;
    check_tables(&bag)?;
    let topics = add_topics(&bag, recording)?;
    let packed = fs::metadata(path)?.len();
    recording.extend(packed);
    count(&bag, &topics, packed, recording)?;
    let is_read = |(_, topic): &(&i64, &usize)| recording.topics[**topic].decoder.is_some();
    let read: Vec<String> = topics
        .iter()
        .filter(is_read)
        .map(|(id, _)| id.to_string())
        .collect();
    // In one pass, since there is no index by topics.
    let messages = format!(
        "SELECT topic_id, timestamp, data FROM messages WHERE topic_id IN ({})",
        read.join(",")
    );
    let mut messages = bag.prepare(&messages)?;
    let mut messages = messages.query([])?;
    while let Some(row) = messages.next()? {
        let (topic, data) = (topics[&row.get::<_, i64>(0)?], row.get_ref(2)?.as_blob()?);
        match data.starts_with(ZSTD) {
            true => {
                let data = zstd::Decoder::new(data);
                let data = data.and_then(|data| recording.unpacked.read(data));
                recording.add(topic, row.get(1)?, &data.unwrap_or_default());
            }
            false => recording.add(topic, row.get(1)?, data),
        }
    }
    Ok(())
}

/// Fewest bytes that a message takes.
const LEAST: u64 = 4;

/// Counts the messages of the topics that are not read. Pages of a damaged file can refer to each other in circles, and
/// then yield messages without end.
fn count(
    bag: &Connection,
    topics: &HashMap<i64, usize>,
    bytes: u64,
    recording: &mut Recording,
) -> Result<(), Box<dyn Error>> {
    let mut messages = bag.prepare("SELECT topic_id FROM messages")?;
    let mut messages = messages.query([])?;
    let mut left = bytes / LEAST;
    while let Some(row) = messages.next()? {
        left = left
            .checked_sub(1)
            .ok_or("its pages refer to each other in a circle")?;
        let topic = row.get::<_, Option<i64>>(0)?.and_then(|id| topics.get(&id));
        let topic = topic.map(|topic| &mut recording.topics[*topic]);
        if let Some(topic) = topic.filter(|topic| topic.decoder.is_none()) {
            topic.messages += 1;
        }
    }
    Ok(())
}

/// A view in place of a table, or a computed column, can have any number of rows and bytes.
fn check_tables(bag: &Connection) -> Result<(), Box<dyn Error>> {
    for table in ["topics", "messages"] {
        let stored = "SELECT count(*) FROM sqlite_schema WHERE type = 'table' AND name = ?1 AND rootpage > 0";
        let computed = "SELECT count(*) FROM pragma_table_xinfo(?1) WHERE hidden > 0";
        let count = |query| bag.query_row(query, [table], |row| row.get::<_, i64>(0));
        if count(stored)? != 1 || count(computed)? > 0 {
            return Err(format!("`{table}` is not a plain table").into());
        }
    }
    Ok(())
}

/// The topics by their numbers in the bag.
fn add_topics(
    bag: &Connection,
    recording: &mut Recording,
) -> rusqlite::Result<HashMap<i64, usize>> {
    let mut topics = bag.prepare("SELECT id, name, type, serialization_format FROM topics")?;
    let topics = topics.query_map([], |row| {
        let [name, kind, encoding] = [row.get::<_, String>(1)?, row.get(2)?, row.get(3)?];
        Ok((row.get(0)?, recording.topic(&name, &kind, &encoding)))
    })?;
    topics.collect()
}
