//! Values of parameters that differ between logs: those that the tables `[logs."pattern"]` of a model file give, and those
//! that fits find.

use super::dynamics::PerLogValue;
use crate::data::Log;

/// What a model file says of the logs whose file names match a pattern.
#[derive(Debug, Clone, PartialEq)]
pub struct Configuration {
    /// A file name, in which `*` stands for any characters and `?` for one.
    pub pattern: String,
    /// Declared parameters, by index, and their values in these logs.
    pub given: Vec<(usize, f64)>,
}

impl Configuration {
    /// Whether it speaks of the log with this file name.
    pub fn is_of(&self, log_name: &str) -> bool {
        matches(&self.pattern, log_name)
    }

    fn value(&self, parameter: usize) -> Option<f64> {
        let mut given = self.given.iter();
        given
            .find(|(k, _)| *k == parameter)
            .map(|(_, value)| *value)
    }
}

/// The value of a parameter in one log.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct InLog {
    /// Index into the model's parameters.
    pub parameter: usize,
    pub value: f64,
    /// Whether the model file gives it for this log: no fit changes it.
    pub is_given: bool,
}

/// Everything that makes the values in one log others than those of the model.
#[derive(Clone, Copy)]
pub(super) struct Differing<'a> {
    pub configurations: &'a [Configuration],
    pub own: &'a [PerLogValue],
}

impl Differing<'_> {
    /// Which of the tables speak of a log: logs of which the same tables speak are one group.
    pub fn group(self, log_name: &str) -> Vec<bool> {
        let tables = self.configurations.iter();
        tables.map(|table| table.is_of(log_name)).collect()
    }

    /// Whether a value of a whole group, of one log or of those that a pattern names holds in this log.
    pub fn holds(self, own: &PerLogValue, of_group: bool, log: &Log) -> bool {
        log.is_called(&own.log)
            || matches(&own.log, &log.name())
            || of_group && self.group(&own.log_name()) == self.group(&log.name())
    }

    /// The value of a parameter in a log, if it is not the one of all logs. A log's own values are found by its path,
    /// else by its file name, else by a pattern or its group; of the tables that give one, the last one wins.
    pub fn value(self, parameter: usize, of_group: bool, log: &Log) -> Option<InLog> {
        let own = || self.own.iter().filter(|own| own.parameter == parameter);
        let fitted = own()
            .find(|own| log.path.as_os_str() == own.log.as_str())
            .or_else(|| own().find(|own| log.is_called(&own.log)))
            .or_else(|| own().find(|own| self.holds(own, of_group, log)));
        let given = || {
            let name = log.name();
            let mut tables = self.configurations.iter().rev();
            tables.find_map(|table| table.value(parameter).filter(|_| table.is_of(&name)))
        };
        let (value, is_given) = match fitted {
            Some(own) => (own.value, false),
            None => (given()?, true),
        };
        Some(InLog {
            parameter,
            value,
            is_given,
        })
    }
}

/// Whether a name matches a pattern, in which `*` stands for any characters and `?` for one.
fn matches(pattern: &str, name: &str) -> bool {
    let name: Vec<char> = name.chars().collect();
    // Which beginnings of the name, by length, the pattern up to here matches.
    let mut reached = vec![false; name.len() + 1];
    reached[0] = true;
    for symbol in pattern.chars() {
        let step = |length: usize| match symbol {
            '*' => reached[..=length].contains(&true),
            _ => length > 0 && reached[length - 1] && (symbol == '?' || symbol == name[length - 1]),
        };
        reached = (0..=name.len()).map(step).collect();
    }
    reached[name.len()]
}

#[cfg(test)]
mod tests {
    use super::matches;

    #[test]
    fn a_star_stands_for_any_characters_and_a_question_mark_for_one() {
        let cases = [
            ("kp40*.csv", "kp40_slow.csv", true),
            ("kp40*.csv", "kp40.csv", true),
            ("kp40*.csv", "kp4.csv", false),
            ("kp40*.csv", "my_kp40.csv", false),
            ("run?.csv", "run1.csv", true),
            ("run?.csv", "run12.csv", false),
            ("*a*b*", "xxaxxbxx", true),
            ("*a*b*", "xxbxxaxx", false),
            ("", "", true),
        ];
        for (pattern, name, wanted) in cases {
            assert_eq!(matches(pattern, name), wanted, "{pattern} {name}");
        }
    }
}
