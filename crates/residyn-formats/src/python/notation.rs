use std::collections::BTreeSet;

use residyn_core::expr::{Notation, Part};

/// Expressions on arrays of numpy.
pub struct Python {
    /// Names that are looked up among the parameters `p`.
    pub parameters: BTreeSet<String>,
}

/// Names that mean something else in the module.
const TAKEN: &str = "\
    and as assert async await break class continue def del elif else except finally for from global \
    if import in is json lambda nonlocal not np or p parameters parts pass raise return state torque \
    try while with yield";

/// A number as Python reads it back exactly.
pub fn literal(value: f64) -> String {
    match value {
        f64::INFINITY => "np.inf".to_owned(),
        f64::NEG_INFINITY => "-np.inf".to_owned(),
        _ => format!("{value:?}"),
    }
}

impl Notation for Python {
    fn number(&self, value: f64) -> String {
        literal(value)
    }

    fn name(&self, name: &str) -> String {
        match name {
            _ if self.parameters.contains(name) => format!("p[\"{name}\"]"),
            "t" => "time".to_owned(),
            "time" => "time_".to_owned(),
            _ if TAKEN.split(' ').any(|taken| taken == name) => format!("{name}_"),
            _ => name.to_owned(),
        }
    }

    fn call(&self, function: &str, arguments: &[String]) -> String {
        let function = match function {
            "atan2" => "arctan2",
            "min" => "minimum",
            "max" => "maximum",
            "pow" => "power",
            same => same,
        };
        format!("np.{function}({})", arguments.join(", "))
    }

    fn choice(&self, condition: &Part, a: &str, b: &str) -> String {
        format!("np.where({}, {a}, {b})", condition.condition())
    }
}
