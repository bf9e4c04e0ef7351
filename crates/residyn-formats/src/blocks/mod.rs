//! The actuators of a model as settings of simulators that learn: Python with one block a joint, and the events that draw
//! each fitted number anew from its interval. Bodies are not in it: these simulators read a robot description.

mod block;
mod event;
pub(super) mod isaaclab;
pub(super) mod mjlab;
mod quantity;

use std::fmt::Write;
use std::path::Path;

use self::block::{Block, Blocks};
use self::event::Event;
use self::quantity::Quantity;
use super::{ExportError, ExportModel, File};
use residyn_core::model::tree::rounded;

/// Why nothing is predicted from the written files.
const NO_CLIENT: &str = "the file holds settings of actuators, not a model";

/// Above the events.
const ABOUT_EVENTS: &str = "# Draws from the intervals of the fitted values, one for each environment: `events=EVENTS` in the environment's configuration.";

/// How a simulator writes actuators and events.
struct Simulator {
    /// What a model is refused as.
    what: &'static str,
    /// First line of the file.
    about: &'static str,
    /// Python that brings in the classes of actuators.
    imports: &'static str,
    /// Python that brings in the classes and functions of events.
    imports_of_events: &'static str,
    /// Python that defines the `event` of a function, an operation, a joint and named ranges.
    event: &'static str,
    /// Brackets around the blocks.
    brackets: [&'static str; 2],
    /// The beginning of a block: its class and its joint.
    opening: fn(&Block) -> String,
    /// The other fields of a block, with their values.
    fields: fn(&Block) -> Vec<(&'static str, String)>,
    /// What can be drawn.
    events: fn(&Block) -> Vec<Event>,
}

impl Simulator {
    /// The one file.
    ///
    /// # Errors
    /// Drives that are no position loops, or of no known form.
    fn files(&self, model: &ExportModel, path: &Path) -> Result<Vec<File>, ExportError> {
        let own = Blocks::of(model).map_err(|reason| model.refused(self.what, reason))?;
        let events: String = own.blocks.iter().map(|block| self.events(block)).collect();
        let text = self.head(model, &own, !events.is_empty()) + &self.actuators(&own.blocks);
        let file = match events.is_empty() {
            true => File::new(path, text, "ACTUATORS, one a joint"),
            false => {
                let text = format!("{text}\n{ABOUT_EVENTS}\nEVENTS = {{\n{events}}}\n");
                File::new(
                    path,
                    text,
                    "ACTUATORS, one a joint, and EVENTS that draw them",
                )
            }
        };
        Ok(vec![file])
    }

    /// What a file does not hold; nothing of a model that has none.
    fn not_carried(&self, model: &ExportModel) -> Vec<String> {
        Blocks::of(model).map_or_else(|_| Vec::new(), |own| self.missing(&own))
    }

    fn missing(&self, own: &Blocks) -> Vec<String> {
        let undrawn = own.blocks.iter().flat_map(|block| self.undrawn(block));
        own.not_carried.iter().cloned().chain(undrawn).collect()
    }

    /// The first lines: what it is, the origin of the numbers, what is missing, imports, and the physics step.
    fn head(&self, model: &ExportModel, own: &Blocks, has_events: bool) -> String {
        let mut text = format!("# {}\n# {}\n#\n", self.about, model.provenance());
        for what in self.missing(own) {
            let _ = writeln!(text, "# not carried: {}", what.replace('\n', " "));
        }
        let [imports, event] = match has_events {
            true => [self.imports_of_events, self.event],
            false => ["", ""],
        };
        let _ = write!(
            text,
            "\n{}\n{imports}\n# The physics step in s: delays are rounded to whole steps.\nSTEP_S = {}\n\n\n\
             def steps(delay_s):\n    return round(delay_s / STEP_S)\n\n\n{event}",
            self.imports,
            number(model.step_s)
        );
        text
    }

    fn actuators(&self, blocks: &[Block]) -> String {
        let [open, close] = self.brackets;
        let block = |block: &Block| {
            let fields = (self.fields)(block).into_iter();
            let fields = fields.map(|(name, value)| format!("        {name}={value},\n"));
            let fields: String = fields.collect();
            format!("    {}\n{fields}    ),\n", (self.opening)(block))
        };
        let blocks: String = blocks.iter().map(block).collect();
        format!("ACTUATORS = {open}\n{blocks}{close}\n")
    }

    /// The events of a joint, a line each; none if no fit found an interval.
    fn events(&self, block: &Block) -> String {
        self.drawn(block).map(|event| event.text(block)).collect()
    }

    /// The events of a joint that draw at least one fitted number.
    fn drawn(&self, block: &Block) -> impl Iterator<Item = Event> {
        let events = (self.events)(block).into_iter();
        events.filter(|event| event.is_for(block))
    }

    /// The intervals of a joint that nothing draws; the fields of a delay are its interval.
    fn undrawn(&self, block: &Block) -> Vec<String> {
        let drawn: Vec<Event> = self.drawn(block).collect();
        let is_drawn = |own| {
            drawn
                .iter()
                .any(|event| event.quantities().any(|its| its == own))
        };
        let others = Quantity::ALL.into_iter();
        let others = others.filter(|own| *own != Quantity::Delay && !is_drawn(*own));
        let line = |own: Quantity| {
            let [low, high] = block.range(own)?.map(number);
            let words = own.words();
            Some(format!(
                "the interval of {words}, {low} to {high}, on joint {}",
                block.label
            ))
        };
        others.filter_map(line).collect()
    }
}

fn quoted(text: &str) -> String {
    serde_json::Value::from(text).to_string()
}

/// To 15 digits, as a Python float.
fn number(value: f64) -> String {
    format!("{:?}", rounded(value))
}
