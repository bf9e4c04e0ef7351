//! What is said of several logs in the same words, once.

/// A sentence and the logs that it is about.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Together {
    pub text: String,
    /// Names of the logs, in their order.
    pub logs: Vec<String>,
}

/// Sentences, each with the name of its log: equal ones become one, in the place of the first.
pub fn together(said: impl IntoIterator<Item = (String, String)>) -> Vec<Together> {
    let mut once: Vec<Together> = Vec::new();
    for (log, text) in said {
        match once.iter_mut().find(|known| known.text == text) {
            Some(known) if known.logs.last() == Some(&log) => {}
            Some(known) => known.logs.push(log),
            None => once.push(Together {
                text,
                logs: vec![log],
            }),
        }
    }
    once
}

impl Together {
    /// The log, or how many of `all` logs: `run1.csv`, `in 60 of 60 logs`.
    pub fn about(&self, all: usize) -> String {
        match &self.logs[..] {
            [log] => log.clone(),
            logs => format!("in {} of {all} logs", logs.len()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::together;

    #[test]
    fn a_sentence_about_many_logs_is_said_once() {
        let names = |k: usize| format!("run{k}.csv");
        let same = (0..60).map(|k| (names(k), "velocities come from the angles".to_owned()));
        let own = (3..5).map(|k| (names(k), format!("{k} gaps")));
        let said = together(same.chain(own));
        let about: Vec<String> = said.iter().map(|one| one.about(60)).collect();
        assert_eq!(about, ["in 60 of 60 logs", "run3.csv", "run4.csv"]);
        let twice = [0, 0].map(|k| (names(k), "jumps".to_owned()));
        assert_eq!(together(twice)[0].about(60), "run0.csv");
    }
}
