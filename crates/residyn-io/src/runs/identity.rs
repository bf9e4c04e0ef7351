use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};
use serde_json::{Value, json};

use super::difference::first_difference;

/// What determines a run's numbers: runs with the same identity give the same numbers.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Identity {
    /// What is done: the name of a command or of an experiment.
    pub command: String,
    pub seed: u64,
    /// The whole configuration, as resolved.
    pub config: Value,
    /// Hashes of the contents of what the run reads, by the names that messages use ("the model file").
    #[serde(default)]
    pub inputs: BTreeMap<String, String>,
}

impl Identity {
    /// How this run differs from a `saved` one, in words; `None` if they are the same.
    pub fn difference(&self, saved: &Self) -> Option<String> {
        let input = || {
            let mut names = saved.inputs.keys().chain(self.inputs.keys());
            let changed = names.find(|name| saved.inputs.get(*name) != self.inputs.get(*name));
            changed.map(|name| format!("{name} has changed since"))
        };
        // Inputs come last, since another seed or configuration changes simulated data.
        first_difference("command", &json!(saved.command), &json!(self.command))
            .or_else(|| first_difference("seed", &json!(saved.seed), &json!(self.seed)))
            .or_else(|| first_difference("", &saved.config, &self.config))
            .or_else(input)
    }
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::Identity;

    #[test]
    fn the_seed_the_configuration_and_the_inputs_are_told_apart() {
        let identity = |seed, epochs: u32, hash: &str| Identity {
            command: "train".to_owned(),
            seed,
            config: json!({"epochs": epochs}),
            inputs: [("the model file".to_owned(), hash.to_owned())].into(),
        };
        let saved = identity(0, 40, "a");
        let message = |mine: Identity| mine.difference(&saved);
        assert_eq!(message(saved.clone()), None);
        assert_eq!(
            message(identity(7, 50, "b")).unwrap(),
            "its `seed` is 0, here it is 7"
        );
        assert_eq!(
            message(identity(0, 50, "b")).unwrap(),
            "its `epochs` is 40, here it is 50"
        );
        assert_eq!(
            message(identity(0, 40, "b")).unwrap(),
            "the model file has changed since"
        );
    }
}
