//! Memory slots of intermediate values, reused as soon as possible so that they stay in the first-level cache.

use super::steps::{Kind, Step};

const NOWHERE: u32 = u32::MAX;

/// Assignment of values to places; a place is free again after the last step that reads it.
pub(super) struct Places {
    /// Indexed by value.
    pub of: Vec<u32>,
    pub count: u32,
    free: Vec<u32>,
}

impl Places {
    /// For `values` values, of which the first `kept` have permanent places.
    pub fn new(values: usize, kept: usize) -> Self {
        let mut places = Self {
            of: vec![NOWHERE; values],
            count: 0,
            free: Vec::new(),
        };
        (0..kept).for_each(|value| places.keep(value));
        places
    }

    /// Give a value a permanent place.
    pub fn keep(&mut self, value: usize) {
        if self.of[value] == NOWHERE {
            self.of[value] = self.count;
            self.count += 1;
        }
    }

    /// Rewrite steps from values to places; every result gets a permanent place.
    pub fn settle(&mut self, steps: &mut [Step]) {
        for step in steps {
            for value in step.writes() {
                self.keep(value as usize);
            }
            *step = step.between(
                |value| self.of[value as usize],
                |value| self.of[value as usize],
            );
        }
    }

    /// As [`Places::settle`] for steps whose results, unless permanent, are needed only until their last reader.
    pub fn pass(&mut self, steps: &mut [Step]) {
        let mut last = vec![usize::MAX; self.of.len()];
        for (index, step) in steps.iter().enumerate() {
            step.reads().for_each(|value| last[value as usize] = index);
        }
        let is_kept: Vec<bool> = self.of.iter().map(|place| *place != NOWHERE).collect();
        for (index, step) in steps.iter_mut().enumerate() {
            let read = step.between(|value| self.of[value as usize], |value| value);
            for value in step.reads().map(|value| value as usize) {
                if last[value] == index && !is_kept[value] && self.of[value] != NOWHERE {
                    self.free.push(self.of[value]);
                    // Two operands may be the same value.
                    self.of[value] = NOWHERE;
                }
            }
            for value in step.writes().map(|value| value as usize) {
                match self.free.pop() {
                    Some(place) if !is_kept[value] => self.of[value] = place,
                    Some(place) => self.free.push(place),
                    None => self.keep(value),
                }
            }
            *step = read.between(|place| place, |value| self.of[value as usize]);
        }
    }
}

impl Step {
    /// The same step with its operands and results renamed.
    pub fn between(self, read: impl Fn(u32) -> u32, write: impl Fn(u32) -> u32) -> Self {
        let count = self.reads().count();
        Self {
            to: write(self.to),
            a: read(self.a),
            b: match self.kind {
                Kind::SinCos => write(self.b),
                _ if count > 1 => read(self.b),
                _ => 0,
            },
            c: if count > 2 { read(self.c) } else { 0 },
            ..self
        }
    }
}
