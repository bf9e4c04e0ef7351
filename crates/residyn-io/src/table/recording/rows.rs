//! The table of the rig's topic, with the values of other topics at the times of its messages.

use super::{Recording, Sample, Series, Topic};
use residyn_core::data::Arrays;
use residyn_core::data::Columns;
use residyn_core::data::LogError;

impl Recording {
    /// The columns `time`, `q_JOINT`, `qd_JOINT` and `tau_JOINT` of the rig's topic, and `/TOPIC/JOINT/position`,
    /// `/TOPIC/1` and the like of others, whose numbers are held from one message to the next. Topics that no column
    /// asks for are there by name only.
    ///
    /// # Errors
    /// As [`Recording::choose`], and messages of the topics asked for that cannot be decoded, and more of them than can
    /// be kept.
    pub(super) fn table(&self, columns: &Columns) -> Result<Arrays, LogError> {
        self.check().map_err(|why| self.fault(why.to_string()))?;
        let chosen = self.choose(columns)?;
        let (asked, unasked) = self.others(chosen, columns);
        let used: Vec<&Series> = [&[chosen], asked.as_slice()].concat();
        self.check_messages(&used)?;
        let clock = Clock::of(&used);
        let all = clock.rows(chosen);
        let begins = |series: &&Series| Some(clock.rows(series).first()?.ns);
        // Before its first message, nothing is known about a topic.
        let known = used.iter().filter_map(begins).max();
        let rows = &all[all.partition_point(|row| Some(row.ns) < known)..];

        let mut table = Arrays::of(self.kept.packed());
        table.values.clone_from(&self.values);
        table.notes.extend(self.notes.iter().cloned());
        table.notes.push(self.time_message(chosen, clock));
        table
            .notes
            .extend(self.left_out_message(chosen, all.len() - rows.len()));
        let since = |row: &Row<'_>| seconds(row.ns, all[0].ns);
        table.add("time", rows.iter().map(since).collect());
        add(&mut table, chosen.short_names(), rows);
        for other in asked {
            let held = held(&clock.rows(other), rows);
            add(&mut table, self.full_names(other), &held);
            table.notes.push(self.held_message(other, rows, &held));
        }
        for name in unasked.into_iter().flat_map(|other| self.full_names(other)) {
            table.add(name, Vec::new());
        }
        Ok(table)
    }

    /// The series other than the rig's: those that a column asks for, and the rest.
    fn others(&self, chosen: &Series, columns: &Columns) -> (Vec<&Series>, Vec<&Series>) {
        let series = self.series.iter();
        let others = series.filter(|other| !std::ptr::eq(*other, chosen));
        others.partition(|other| {
            let mut names = self.full_names(other).into_iter();
            names.any(|name| columns.names(&name))
        })
    }

    /// Check that every message of these topics can be decoded.
    fn check_messages(&self, used: &[&Series]) -> Result<(), LogError> {
        let mut faults = used
            .iter()
            .filter_map(|series| self.topics[series.topic].fault.as_ref());
        faults.next().map_or(Ok(()), |fault| {
            Err(self.fault(format!(
                "{fault}; record it again, or cut the recording there"
            )))
        })
    }

    fn full_names(&self, series: &Series) -> Vec<String> {
        let topic = &self.topics[series.topic].name;
        let names = series.names.iter();
        names.map(|name| format!("{topic}/{name}")).collect()
    }

    fn time_message(&self, chosen: &Series, clock: Clock) -> String {
        let name = &self.topics[chosen.topic].name;
        let times = match clock {
            Clock::Stamps => "by the stamps in their headers",
            Clock::Logged => "by when they were recorded, since not all messages have a stamp",
        };
        format!("read from {name}, {times}")
    }

    /// Messages of the topic that are not rows of the log.
    fn left_out_message(&self, chosen: &Series, early: usize) -> Vec<String> {
        let Topic { name, messages, .. } = &self.topics[chosen.topic];
        let others = messages.saturating_sub(chosen.samples.len());
        let message = [
            (others, "hold other joints"),
            (early, "are earlier than the first of the other topics"),
        ];
        let message = message.into_iter().filter(|(count, _)| *count > 0);
        message
            .map(|(count, why)| {
                format!("{count} of {messages} messages of {name} {why} and are left out")
            })
            .collect()
    }

    fn held_message(&self, other: &Series, rows: &[Row<'_>], held: &[Row<'_>]) -> String {
        let name = &self.topics[other.topic].name;
        let for_s = rows
            .iter()
            .zip(held)
            .map(|(row, held)| seconds(row.ns, held.ns));
        let longest = for_s.fold(0.0, f64::max);
        format!("{name} is held from one message to the next, for {longest} s at most")
    }
}

/// Adds a column for each number of these rows.
fn add(table: &mut Arrays, names: Vec<String>, rows: &[Row<'_>]) {
    for (index, name) in names.into_iter().enumerate() {
        table.add(name, rows.iter().map(|row| row.values[index]).collect());
    }
}

/// Where the times of messages come from: one clock for all topics that are used.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Clock {
    Stamps,
    Logged,
}

/// A message at its time.
#[derive(Clone, Copy)]
struct Row<'a> {
    ns: i64,
    values: &'a [f64],
}

impl Clock {
    fn of(used: &[&Series]) -> Self {
        let mut samples = used.iter().flat_map(|series| &series.samples);
        match samples.all(|sample| sample.stamp_ns != 0) {
            true => Self::Stamps,
            false => Self::Logged,
        }
    }

    /// The messages in order.
    fn rows(self, series: &Series) -> Vec<Row<'_>> {
        let ns = |sample: &Sample| match self {
            Self::Stamps => sample.stamp_ns,
            Self::Logged => sample.logged_ns,
        };
        let samples = series.samples.iter();
        let rows = samples.map(|sample| Row {
            ns: ns(sample),
            values: &sample.values,
        });
        let mut rows: Vec<Row<'_>> = rows.collect();
        rows.sort_by_key(|row| row.ns);
        rows
    }
}

/// The last messages of a topic at these times, none of which is before its first.
fn held<'a>(messages: &[Row<'a>], rows: &[Row<'_>]) -> Vec<Row<'a>> {
    let last = |row: &Row<'_>| messages.partition_point(|message| message.ns <= row.ns);
    rows.iter().map(|row| messages[last(row) - 1]).collect()
}

#[allow(clippy::cast_precision_loss)] // a recording is far shorter than 2^53 ns, 104 days
fn seconds(ns: i64, since: i64) -> f64 {
    ns.saturating_sub(since) as f64 / 1e9
}
