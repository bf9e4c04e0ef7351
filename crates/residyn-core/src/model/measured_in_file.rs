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
    /// SI, as text; empty if the file gives none.
    pub unit: String,
}

/// The quantities, each with the place of its unit in the file \[bytes\]: those of the table, in its order, then those that
/// formulas mention, by name and place, and that nothing else of the file is called. The units of these are unknown.
pub(super) fn measured<'n>(
    document: &Document,
    Named(table): Named<Located<String>>,
    mentioned: impl Iterator<Item = (&'n str, usize)>,
    others: &[&str],
) -> Result<Vec<(MeasuredQuantity, usize)>, FileError> {
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
    let mut all: Vec<_> = table.into_iter().map(quantity).collect::<Result<_, _>>()?;
    for (name, at) in mentioned {
        let is_known = others.contains(&name) || all.iter().any(|(own, _)| own.name == name);
        if is_measured(name) && !is_known {
            let quantity = MeasuredQuantity {
                name: name.to_owned(),
                unit: String::new(),
            };
            all.push((quantity, at));
        }
    }
    Ok(all)
}
