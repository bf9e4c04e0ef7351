//! Recordings of a robot's messages, rosbag2 and MCAP: the topics with joint data, as a table.

mod bag;
mod choose;
mod folder;
mod mcap;
mod message;
mod rows;

use std::collections::HashMap;
use std::io;
use std::path::{Path, PathBuf};

use self::message::{CHANNELS, Decoder, Message};
use super::budget::Budget;
use residyn_core::data::Arrays;
use residyn_core::data::Columns;
use residyn_core::data::LogError;
use residyn_core::limits::MESSAGE_BYTES;

/// The table of a rosbag2 in SQLite.
///
/// # Errors
/// A file that is not a rosbag2, and as [`Recording::table`].
pub(super) fn of_bag(path: &Path, columns: &Columns) -> Result<Arrays, LogError> {
    let mut recording = Recording::of(path);
    bag::read(path, &mut recording)?;
    recording.table(columns)
}

/// The table of an MCAP file.
///
/// # Errors
/// A file that is damaged, and as [`Recording::table`].
pub(super) fn of_mcap(path: &Path, columns: &Columns) -> Result<Arrays, LogError> {
    let mut recording = Recording::of(path);
    mcap::read(path, &mut recording)?;
    recording.table(columns)
}

/// The table of a folder of rosbag2, whose files follow each other.
///
/// # Errors
/// A folder without such files, and the errors of its files.
pub(super) fn of_folder(path: &Path, columns: &Columns) -> Result<Arrays, LogError> {
    let mut recording = Recording::of(path);
    folder::read(path, &mut recording)?;
    recording.table(columns)
}

/// The messages of a recording that hold numbers.
struct Recording {
    path: PathBuf,
    topics: Vec<Topic>,
    /// The indices of the topics by their names.
    topic_by_name: HashMap<String, usize>,
    series: Vec<Series>,
    /// The indices of the series by topic and names.
    series_by_names: HashMap<(usize, Vec<String>), usize>,
    /// Single numbers in what is said about the recording, by name.
    values: Vec<(String, f64)>,
    notes: Vec<String>,
    /// For what is unpacked from the files, and for what is kept of it.
    unpacked: Budget,
    kept: Budget,
}

struct Topic {
    name: String,
    /// Type of the messages, and how they are encoded.
    kind: String,
    decoder: Option<Decoder>,
    messages: usize,
    /// The first message that could not be read, and why.
    fault: Option<String>,
}

/// Messages of one topic with the same numbers: publishers of different joints may share a topic.
struct Series {
    topic: usize,
    names: Vec<String>,
    samples: Vec<Sample>,
}

struct Sample {
    logged_ns: i64,
    /// 0 if the message has none.
    stamp_ns: i64,
    values: Vec<f64>,
}

impl Series {
    /// The column names of a rig, for numbers of joints: `q_elbow` for `elbow/position`.
    fn short_names(&self) -> Vec<String> {
        let short = |name: &String| {
            let of_joint = CHANNELS
                .into_iter()
                .find_map(|(suffix, stem)| Some(format!("{stem}_{}", name.strip_suffix(suffix)?)));
            of_joint.unwrap_or_else(|| name.clone())
        };
        self.names.iter().map(short).collect()
    }

    /// The joints whose angles it has.
    fn joints(&self) -> impl Iterator<Item = &str> {
        let [(angle, _), ..] = CHANNELS;
        self.names
            .iter()
            .filter_map(move |name| name.strip_suffix(angle))
    }
}

impl Recording {
    fn of(path: &Path) -> Self {
        Self {
            path: path.to_owned(),
            topics: Vec::new(),
            topic_by_name: HashMap::new(),
            series: Vec::new(),
            series_by_names: HashMap::new(),
            values: Vec::new(),
            notes: Vec::new(),
            unpacked: Budget::of(0),
            kept: Budget::of(0),
        }
    }

    /// Adds a file of `packed` bytes.
    fn extend(&mut self, packed: u64) {
        self.unpacked.extend(packed);
        self.kept.extend(packed);
    }

    /// Check that everything that is read of it was kept.
    fn check(&self) -> io::Result<()> {
        self.unpacked.check()?;
        self.kept.check()
    }

    /// The index of a topic, which begins here or in an earlier file.
    fn topic(&mut self, name: &str, kind: &str, encoding: &str) -> usize {
        if let Some(known) = self.topic_by_name.get(name) {
            return *known;
        }
        let topic = self.topics.len();
        self.topic_by_name.insert(name.to_owned(), topic);
        self.topics.push(Topic {
            name: name.to_owned(),
            kind: format!("{kind} in {encoding}"),
            decoder: message::decoder(kind, encoding),
            messages: 0,
            fault: None,
        });
        topic
    }

    fn add(&mut self, topic: usize, logged_ns: i64, data: &[u8]) {
        let entry = &mut self.topics[topic];
        entry.messages += 1;
        let Some(decoder) = entry.decoder else {
            return;
        };
        let decoded = match data.len() <= MESSAGE_BYTES {
            true => decoder(data),
            false => Err(format!("is longer than {} MB", MESSAGE_BYTES >> 20)),
        };
        match decoded {
            Ok(message) => self.sort_in(topic, logged_ns, message),
            Err(why) => {
                let message = || format!("message {} of {} {why}", entry.messages, entry.name);
                entry.fault.get_or_insert_with(message);
            }
        }
    }

    /// Keeps a message if there is room for it.
    fn sort_in(&mut self, topic: usize, logged_ns: i64, message: Message) {
        let names = (topic, message.names);
        let is_known = self.series_by_names.contains_key(&names);
        let bytes_of_names = if is_known {
            0
        } else {
            bytes_of_names(&names.1)
        };
        if self
            .kept
            .take(bytes_of_sample(&message.values) + bytes_of_names)
            .is_err()
        {
            return;
        }
        let entry = self.series_by_names.entry(names);
        let series = *entry.or_insert_with_key(|(topic, names)| {
            self.series.push(Series {
                topic: *topic,
                names: names.clone(),
                samples: Vec::new(),
            });
            self.series.len() - 1
        });
        self.series[series].samples.push(Sample {
            logged_ns,
            stamp_ns: message.stamp_ns,
            values: message.values,
        });
    }

    fn fault(&self, fault: String) -> LogError {
        LogError::form(&self.path, fault)
    }
}

/// Memory that a sample takes in its series, and then in the columns of a table \[bytes\].
fn bytes_of_sample(values: &[f64]) -> u64 {
    2 * (size_of::<Sample>() + size_of_val(values)) as u64
}

/// Memory that the names of a series take, there and in the index \[bytes\].
fn bytes_of_names(names: &[String]) -> u64 {
    let bytes = |name: &String| size_of::<String>() + name.len();
    2 * names.iter().map(bytes).sum::<usize>() as u64
}
