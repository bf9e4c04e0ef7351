//! The table `[measured]` of a model file: the further measured columns that formulas may use, each with its unit.

use super::reader::{Document, FileError, Located};
use super::values::Named;
use crate::data::{MEASURED_PREFIX, is_measured};
use crate::expr::parse;

/// Something that the rig measures beside its joints: a supply voltage, a temperature, a current.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct MeasuredQuantity {
    /// In formulas, and in the header of a log: `u_volts`.
    pub name: String,
    /// SI, as text; empty for a pure number.
    pub unit: String,
}

/// The quantities, in the order of the file, and where their units stand in it \[bytes\].
pub(super) fn measured(
    document: &Document,
    Named(table): Named<Located<String>>,
) -> Result<(Vec<MeasuredQuantity>, Vec<usize>), FileError> {
    let quantity = |(name, unit): (String, Located<String>)| {
        let is_usable = parse(&name).is_ok_and(|formula| formula.is_name(&name));
        if is_measured(&name) && is_usable {
            let Located { value: unit, at } = unit;
            return Ok((MeasuredQuantity { name, unit }, at));
        }
        let message = format!(
            "`{name}` cannot be a measured column: its name begins with {MEASURED_PREFIX} and has letters, digits and _ \
             alone, such as u_volts; a log that calls it something else is mapped under [columns]"
        );
        Err(document.error(unit.at, message))
    };
    let quantities: Result<Vec<_>, _> = table.into_iter().map(quantity).collect();
    quantities.map(|quantities| quantities.into_iter().unzip())
}
