//! An event term: a draw of numbers of one joint.

use super::block::Block;
use super::quantity::{Number, Quantity};
use super::{number, quoted};

/// A draw of numbers of one joint.
pub(super) struct Event {
    /// For its key.
    pub about: &'static str,
    pub function: &'static str,
    pub operation: Operation,
    /// Names of the function's ranges.
    pub ranges: &'static [(&'static str, Quantity)],
}

/// What a drawn number does with the simulator's.
#[derive(Clone, Copy)]
pub(super) enum Operation {
    Replaces,
    Multiplies,
}

impl Operation {
    fn name(self) -> &'static str {
        match self {
            Self::Replaces => "abs",
            Self::Multiplies => "scale",
        }
    }

    /// What an end of an interval is written as a share of.
    fn unit(self, value: f64) -> f64 {
        match self {
            Self::Replaces => 1.0,
            Self::Multiplies => value,
        }
    }
}

impl Event {
    /// Whether it draws a fitted number of this joint; no factor turns zero into another number.
    pub fn is_for(&self, block: &Block) -> bool {
        let numbers = || self.quantities().filter_map(|own| block.number(own));
        let has_unit = |own: Number| self.operation.unit(own.value) > 0.0;
        numbers().any(|own| own.range.is_some()) && numbers().all(has_unit)
    }

    pub fn quantities(&self) -> impl Iterator<Item = Quantity> {
        self.ranges.iter().map(|(_, own)| *own)
    }

    /// A line of Python.
    pub fn text(&self, block: &Block) -> String {
        let range = |(name, own): &(&str, Quantity)| {
            let Number { value, range } = block.number(*own)?;
            let unit = self.operation.unit(value);
            let [low, high] = range.unwrap_or([value; 2]).map(|end| number(end / unit));
            Some(format!("{name}=({low}, {high})"))
        };
        let ranges: Vec<String> = self.ranges.iter().filter_map(range).collect();
        format!(
            "    {}: event({}, {}, {}, {}),\n",
            quoted(&format!("{} of {}", self.about, block.name)),
            self.function,
            quoted(self.operation.name()),
            block.pattern(),
            ranges.join(", ")
        )
    }
}
