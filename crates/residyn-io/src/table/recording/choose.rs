//! Chooses the rig's topic in a recording.

use std::collections::{BTreeSet, HashMap};

use super::{Recording, Series, Topic};
use residyn_core::data::Columns;
use residyn_core::data::LogError;
use residyn_core::expr::{listed, shortened};

impl Recording {
    /// The joint states of the topic that is named under `[columns]`, or of the one that has the joints.
    ///
    /// # Errors
    /// No such topic, or several.
    pub(super) fn choose(&self, columns: &Columns) -> Result<&Series, LogError> {
        let is_named = |series: &&Series| match &columns.topic {
            Some(topic) => self.topics[series.topic].name == *topic,
            None => true,
        };
        let states = self
            .series
            .iter()
            .filter(|series| series.joints().next().is_some());
        let states: Vec<&Series> = states.filter(is_named).collect();
        let has_joints = |series: &&&Series| columns.has_angles_in(&series.short_names());
        let fitting: Vec<&Series> = states.iter().filter(has_joints).copied().collect();
        let (those, fault) = match fitting.is_empty() {
            // For a single topic, the missing column is reported.
            true => (states, "no topic has all joints of the model"),
            false => (fitting, "several topics have the joints"),
        };
        let most = those.iter().max_by_key(|series| series.samples.len());
        let most = most.ok_or_else(|| self.without_states(columns))?;
        if those.iter().all(|series| series.topic == most.topic) {
            return Ok(most);
        }
        let name = &self.topics[most.topic].name;
        Err(self.fault(format!(
            "{fault}; say which under [columns] in the model file: topic = {name:?}. It has {}",
            self.message()
        )))
    }

    fn without_states(&self, columns: &Columns) -> LogError {
        let of_topic = columns.topic.as_ref().map(|topic| format!(" {topic:?}"));
        let fault = self.topics.iter().find_map(|topic| topic.fault.as_ref());
        let fault = fault.map_or_else(String::new, |fault| format!(" ({fault})"));
        self.fault(format!(
            "there is no topic{} with joint states, sensor_msgs/msg/JointState in CDR or JSON{fault}; record one, or choose \
             another by topic = \"NAME\" under [columns] in the model file. It has {}",
            of_topic.unwrap_or_default(),
            self.message()
        ))
    }

    /// The topics, their types, numbers of messages, and joints; if there are many, the first.
    fn message(&self) -> String {
        let mut joints: HashMap<usize, BTreeSet<&str>> = HashMap::new();
        for series in &self.series {
            joints
                .entry(series.topic)
                .or_default()
                .extend(series.joints());
        }
        let message = |(index, topic): (usize, &Topic)| {
            let joints = match joints.get(&index) {
                Some(joints) if !joints.is_empty() => {
                    format!(": {}", listed(joints.iter().copied()))
                }
                _ => String::new(),
            };
            let [name, kind] = [&topic.name, &topic.kind].map(|text| shortened(text));
            let messages = topic.messages;
            format!("{name} ({kind}, {messages} messages{joints})")
        };
        let topics = self.topics.iter().enumerate().take(MOST_TOLD);
        let topics: Vec<String> = topics.map(message).collect();
        let more = match self.topics.len().saturating_sub(MOST_TOLD) {
            0 => String::new(),
            more => format!(" and {more} more"),
        };
        match topics.is_empty() {
            true => "no topics".to_owned(),
            false => topics.join("; ") + &more,
        }
    }
}

/// Most topics that a message lists.
const MOST_TOLD: usize = 20;
