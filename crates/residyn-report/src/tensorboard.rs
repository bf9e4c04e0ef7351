//! Event files, as TensorBoard and similar tools read them: records of protocol buffers with checksums.

use std::fs::File;
use std::io::Write;
use std::path::{Path, PathBuf};

use prost::Message;

use residyn_io::files::OutputError;

/// What the first event of a file says.
const FILE_VERSION: &str = "brain.Event:2";
/// Added to a rotated checksum, so that checksums of data that hold checksums stay sound.
const CHECKSUM_MASK: u32 = 0xa282_ead8;

/// The fields in use of TensorFlow's `Event`.
#[derive(Clone, PartialEq, Message)]
struct Event {
    #[prost(double, tag = "1")]
    wall_time: f64,
    #[prost(int64, tag = "2")]
    step: i64,
    #[prost(string, optional, tag = "3")]
    file_version: Option<String>,
    #[prost(message, optional, tag = "5")]
    summary: Option<Summary>,
}

#[derive(Clone, PartialEq, Message)]
struct Summary {
    #[prost(message, repeated, tag = "1")]
    values: Vec<Value>,
}

#[derive(Clone, PartialEq, Message)]
struct Value {
    #[prost(string, tag = "1")]
    tag: String,
    /// Optional in name only: zero has to be written too.
    #[prost(float, optional, tag = "2")]
    simple_value: Option<f32>,
}

/// An event file that is being written.
#[derive(Debug)]
pub struct EventFile {
    path: PathBuf,
    file: File,
}

impl EventFile {
    /// A new event file in a folder, which is created if it is missing; one folder is one run. The file is named
    /// after the wall time at its beginning in s since 1970.
    ///
    /// # Errors
    /// An unwritable folder, or one that holds an event file of the same second.
    pub fn create(folder: &Path, wall_time_s: f64) -> Result<Self, OutputError> {
        let name = format!("events.out.tfevents.{:010}.residyn", wall_time_s.floor());
        let path = folder.join(name);
        let created = std::fs::create_dir_all(folder).and_then(|()| File::create_new(&path));
        let file = created.map_err(|source| OutputError {
            path: path.clone(),
            source,
        })?;
        let mut events = Self { path, file };
        events.append(&Event {
            wall_time: wall_time_s,
            file_version: Some(FILE_VERSION.to_owned()),
            ..Event::default()
        })?;
        Ok(events)
    }

    /// Adds a value of a quantity, named by its tag, at a step and a wall time in s since 1970. The format keeps
    /// values in single precision. Readers see it at once.
    ///
    /// # Errors
    /// A full disk.
    pub fn scalar(
        &mut self,
        tag: &str,
        step: i64,
        wall_time_s: f64,
        value: f64,
    ) -> Result<(), OutputError> {
        let value = Value {
            tag: tag.to_owned(),
            simple_value: Some(value as f32),
        };
        self.append(&Event {
            wall_time: wall_time_s,
            step,
            summary: Some(Summary {
                values: vec![value],
            }),
            ..Event::default()
        })
    }

    fn append(&mut self, event: &Event) -> Result<(), OutputError> {
        // In one piece: a reader of a growing file should not find half a record.
        let written = self.file.write_all(&record(&event.encode_to_vec()));
        written.map_err(|source| OutputError {
            path: self.path.clone(),
            source,
        })
    }
}

/// Data in its frame: length, checksum of the length, data, checksum of the data; little-endian.
fn record(data: &[u8]) -> Vec<u8> {
    let length = (data.len() as u64).to_le_bytes();
    [
        &length[..],
        &masked_checksum(&length),
        data,
        &masked_checksum(data),
    ]
    .concat()
}

fn masked_checksum(data: &[u8]) -> [u8; 4] {
    let checksum = crc32c::crc32c(data).rotate_right(15);
    checksum.wrapping_add(CHECKSUM_MASK).to_le_bytes()
}

#[cfg(test)]
mod tests {
    use prost::Message;

    use super::{Event, EventFile, masked_checksum};

    /// The events of a file, with its checksums checked.
    fn events(bytes: &[u8]) -> Vec<Event> {
        let mut events = Vec::new();
        let mut rest = bytes;
        while !rest.is_empty() {
            let (length, after) = rest.split_at(8);
            let (checksum, after) = after.split_at(4);
            assert_eq!(checksum, masked_checksum(length));
            let size = u64::from_le_bytes(length.try_into().unwrap());
            let (data, after) = after.split_at(usize::try_from(size).unwrap());
            let (checksum, after) = after.split_at(4);
            assert_eq!(checksum, masked_checksum(data));
            events.push(Event::decode(data).unwrap());
            rest = after;
        }
        events
    }

    fn written(folder: &std::path::Path) -> Vec<u8> {
        let entry = std::fs::read_dir(folder).unwrap().next().unwrap();
        std::fs::read(entry.unwrap().path()).unwrap()
    }

    #[test]
    fn a_file_begins_as_all_event_files_do() {
        let folder = tempfile::tempdir().unwrap();
        EventFile::create(folder.path(), 1.5).unwrap();
        let beginning = b"\x18\0\0\0\0\0\0\0\xa3\x7f\x4b\x22\x09";
        assert!(written(folder.path()).starts_with(beginning));
    }

    #[test]
    fn scalars_come_back_in_order() {
        let folder = tempfile::tempdir().unwrap();
        let mut file = EventFile::create(folder.path(), 1.5).unwrap();
        file.scalar("loss", 3, 2.5, 0.0).unwrap();
        file.scalar("return", -1, 3.5, -120.25).unwrap();
        let events = events(&written(folder.path()));
        assert_eq!(events[0].file_version.as_deref(), Some("brain.Event:2"));
        let scalars: Vec<_> = events[1..]
            .iter()
            .map(|event| {
                let value = &event.summary.as_ref().unwrap().values[0];
                (
                    value.tag.as_str(),
                    event.step,
                    event.wall_time,
                    value.simple_value,
                )
            })
            .collect();
        let expected = [
            ("loss", 3, 2.5, Some(0.0)),
            ("return", -1, 3.5, Some(-120.25)),
        ];
        assert_eq!(scalars, expected);
    }

    #[test]
    fn an_event_file_is_not_overwritten() {
        let folder = tempfile::tempdir().unwrap();
        EventFile::create(folder.path(), 7.0).unwrap();
        let error = EventFile::create(folder.path(), 7.9).unwrap_err();
        assert!(error.to_string().contains("cannot be written"), "{error}");
    }
}
