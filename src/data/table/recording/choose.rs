//! Which topic of a recording is the rig's.

use super::{Recording, Series, Topic};
use crate::data::columns::Columns;
use crate::data::error::LogError;

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
            // Of a single topic, the missing column is told.
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
            self.told()
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
            self.told()
        ))
    }

    /// All topics, their types, numbers of messages, and joints.
    fn told(&self) -> String {
        let told = |(index, topic): (usize, &Topic)| {
            let of_topic = self.series.iter().filter(|series| series.topic == index);
            let mut joints: Vec<&str> = of_topic.flat_map(Series::joints).collect();
            joints.sort_unstable();
            joints.dedup();
            let joints = match joints.is_empty() {
                true => String::new(),
                false => format!(": {}", joints.join(", ")),
            };
            let (name, kind, messages) = (&topic.name, &topic.kind, topic.messages);
            format!("{name} ({kind}, {messages} messages{joints})")
        };
        let topics: Vec<String> = self.topics.iter().enumerate().map(told).collect();
        match topics.is_empty() {
            true => "no topics".to_owned(),
            false => topics.join("; "),
        }
    }
}
