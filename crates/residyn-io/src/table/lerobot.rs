//! LeRobot data sets, versions 2 and 3: a folder of many episodes in Parquet, one of which is read as a log.

use std::collections::BTreeMap;
use std::io;
use std::path::{Path, PathBuf};

use serde::Deserialize;
use serde_json::Value;

use super::parquet::{List, lists};
use super::{DATA_SET, is_data_set};
use crate::files::{self, listed, read_saved};
use residyn_core::data::Arrays;
use residyn_core::data::LogError;

/// One episode of a data set, as a path names it.
pub(super) struct Episode {
    /// As the caller gave it.
    path: PathBuf,
    set: PathBuf,
    /// `None` if the path names none: the only episode.
    number: Option<u64>,
}

/// Columns of joints, and the stem of their standard names.
const STATE: (&str, &str) = ("observation.state", "q");
const ACTION: (&str, &str) = ("action", "cmd");
const EPISODE: &str = "episode_index";
const TIME: &str = "timestamp";

/// Suffixes of joint names in a data set whose state is more than positions, and the stems that they stand for.
const SUFFIXES: [(&str, Option<&str>); 4] = [
    (".pos", None),
    (".vel", Some("qd")),
    (".torque", Some("tau")),
    (".effort", Some("tau")),
];

impl Episode {
    /// `SET`, `SET#3`, or the file of an episode in a data set of version 2; `None` for any other path.
    pub fn of(path: &Path) -> Option<Self> {
        let episode = |set: &Path, number: Option<u64>| {
            is_data_set(set).then(|| Self {
                path: path.to_owned(),
                set: set.to_owned(),
                number,
            })
        };
        let name = path.file_name()?.to_str()?;
        let in_file = name
            .strip_prefix("episode_")
            .and_then(|name| name.strip_suffix(".parquet"));
        if let Some(number) = in_file {
            return episode(path.ancestors().nth(3)?, Some(number.parse().ok()?));
        }
        match name.rsplit_once('#') {
            Some((set, number)) if !path.exists() => {
                episode(&path.with_file_name(set), Some(number.parse().ok()?))
            }
            _ => episode(path, None),
        }
    }

    /// The columns `time`, `q_JOINT` of the state and `cmd_JOINT` of the action.
    ///
    /// # Errors
    /// A data set that cannot be read, no such episode, and several if none is named.
    pub fn read(&self) -> Result<Arrays, LogError> {
        let files = self.files().map_err(LogError::open(&self.path))?;
        let (mut frames, info) = (self.frames(&files)?, self.info()?);
        let mut of = |name: &str| {
            let list = frames.remove(name);
            list.map_or(Ok(Vec::new()), |list| list.columns(&self.path))
        };
        let packed: io::Result<u64> = files.iter().map(|file| files::size(file)).sum();
        let mut table = Arrays::of(packed.map_err(LogError::open(&self.path))?);
        for time in of(TIME)? {
            table.add("time", time);
        }
        for (name, stem) in [STATE, ACTION] {
            for (index, column) in of(name)?.into_iter().enumerate() {
                table.add(info.column(name, stem, index), column);
            }
        }
        Ok(table)
    }

    /// The rows of the episode, by column.
    fn frames(&self, files: &[PathBuf]) -> Result<BTreeMap<String, List>, LogError> {
        let is_wanted = |name: &str| [STATE.0, ACTION.0, EPISODE, TIME].contains(&name);
        let mut frames: BTreeMap<String, List> = BTreeMap::new();
        for file in files {
            for list in lists(file, is_wanted)? {
                match frames.get_mut(&list.name) {
                    Some(before) => before.extend(&list),
                    None => {
                        frames.insert(list.name.clone(), list);
                    }
                }
            }
        }
        let episodes = frames.remove(EPISODE);
        let episodes = episodes.as_ref().map_or(&[][..], List::numbers);
        let episode = self.number(episodes)?;
        for list in frames.values_mut() {
            list.retain(|row| episodes.get(row) == Some(&episode));
        }
        Ok(frames)
    }

    /// The number of the episode, among those of all rows.
    #[allow(clippy::cast_precision_loss)] // fewer than 2^53 episodes
    fn number(&self, episodes: &[f64]) -> Result<f64, LogError> {
        let last = episodes.iter().copied().fold(f64::NAN, f64::max);
        let set = self.set.display();
        match self.number.map(|number| number as f64) {
            Some(number) if episodes.contains(&number) => Ok(number),
            Some(number) => Err(self.fault(format!("there is no episode {number}: the last is {set}#{last}"))),
            None if episodes.iter().all(|episode| *episode == last) => Ok(last),
            None => Err(self.fault(format!(
                "holds several episodes, up to {last}, and a log is one episode: name one, such as {set}#{last}"
            ))),
        }
    }

    /// The files of the data set; in version 2 only the file of the episode.
    fn files(&self) -> io::Result<Vec<PathBuf>> {
        let mut files = Vec::new();
        for chunk in listed(&self.set.join("data"))? {
            files.extend(listed(&chunk)?);
        }
        let own = self
            .number
            .map(|number| format!("episode_{number:06}.parquet"));
        let is_own = |file: &PathBuf| own.as_ref().is_some_and(|own| file.ends_with(own));
        if let Some(own) = files.iter().position(is_own) {
            files = vec![files.swap_remove(own)];
        }
        Ok(files)
    }

    fn info(&self) -> Result<Info, LogError> {
        let text = read_saved(&self.set.join(DATA_SET)).map_err(LogError::open(&self.path))?;
        serde_json::from_slice(&text).map_err(|why| {
            self.fault(format!(
                "{DATA_SET} is damaged: {why}; write the data set again"
            ))
        })
    }

    fn fault(&self, fault: String) -> LogError {
        LogError::form(&self.path, fault)
    }
}

#[derive(Debug, Deserialize)]
struct Info {
    features: BTreeMap<String, Feature>,
}

#[derive(Debug, Deserialize)]
struct Feature {
    #[serde(default)]
    names: Value,
}

impl Info {
    /// The name of a column: `q_elbow` for `elbow.pos`, or with a number if the joints have no names.
    fn column(&self, feature: &str, stem: &str, index: usize) -> String {
        let Some(joint) = self.names(feature).get(index).copied() else {
            return format!("{stem}{}", index + 1);
        };
        let own = |(suffix, own)| Some((joint.strip_suffix(suffix)?, own));
        let (joint, own) = SUFFIXES.into_iter().find_map(own).unwrap_or((joint, None));
        format!("{}_{joint}", own.unwrap_or(stem))
    }

    /// The joints of a feature: a list, or a list under a key such as `motors`.
    fn names(&self, feature: &str) -> Vec<&str> {
        let names = self.features.get(feature).map(|feature| &feature.names);
        let keys = names.and_then(Value::as_object);
        let under_key = keys.and_then(|keys| keys.values().next());
        let names = under_key.or(names).and_then(Value::as_array);
        let names = names.into_iter().flatten();
        names.filter_map(Value::as_str).collect()
    }
}
