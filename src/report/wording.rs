//! Numbers, lists and names as reports write them.

use std::fmt::{self, Display, Formatter};

use super::schema::ParameterEntry;
use crate::closeloop::{Finding, SplitMethod};
use crate::model::{OwnValue, Parameter};

/// The models that a report compares, by one name each in tables, plots and on the terminal.
pub(super) const AS_WRITTEN: &str = "declared model as written";
pub(super) const FITTED: &str = "declared model, fitted";
pub(super) const WITH_FRICTION: &str = "with usual friction";
pub(super) const WITH_EFFECTS: &str = "with effects";
pub(super) const ZEROED: &str = "with effects, zeroed";
pub(super) const WITH_NETWORK: &str = "with effects and network";

/// `a`, `a and b`, `a, b and c`
pub(super) fn listed(names: &[String]) -> String {
    match names {
        [] => String::new(),
        [one] => one.clone(),
        [most @ .., last] => format!("{} and {last}", most.join(", ")),
    }
}

/// The text with a capital first letter.
pub(super) fn capitalised(text: &str) -> String {
    let mut letters = text.chars();
    letters.next().map_or_else(String::new, |first| {
        first.to_uppercase().collect::<String>() + letters.as_str()
    })
}

/// The relative reduction of a quantity in percent, in words where the quantity rises instead.
pub(super) fn reduction(part: f64, quantity: &str) -> String {
    let percent = 100.0 * part;
    if percent > -0.05 {
        format!("{:.1} %", percent.max(0.0))
    } else if percent > -100.0 {
        format!("none ({quantity} rises by {:.1} %)", -percent)
    } else {
        format!("none ({quantity} more than doubles)")
    }
}

/// One text for each value of an effect.
pub(super) fn values(parameters: &[ParameterEntry]) -> Vec<String> {
    parameters.iter().map(value).collect()
}

/// `coulomb_friction on joint 1: F_c1 = 0.1598 N m (0.1593 to 0.1603)`
impl Display for Finding {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let values: Vec<String> = self.rows().iter().map(own_value).collect();
        write!(f, "{}: {}", self.effect.label(), values.join(", "))
    }
}

/// A value of a finding, with the log where it holds in one alone.
fn own_value((parameter, own): &(Parameter, Option<&OwnValue>)) -> String {
    let amount = amount_of(parameter.value, parameter.ci95, &parameter.unit);
    let log = own.map_or_else(String::new, |own| format!(" in {}", own.log_name()));
    format!("{} = {amount}{log}", parameter.name)
}

/// `F_c1 = 0.1598 N m (0.1593 to 0.1603)`
pub(super) fn value(parameter: &ParameterEntry) -> String {
    format!("{} = {}", parameter.name, amount(parameter))
}

/// `0.1598 N m (0.1593 to 0.1603)`; a value that holds in one log alone names it, and one at a bound of its range says so.
pub(super) fn amount(parameter: &ParameterEntry) -> String {
    let mut amount = amount_of(parameter.value, parameter.ci95, &parameter.unit);
    if let Some(log) = &parameter.log {
        amount += &format!(" in {log}");
    }
    if parameter.at_bound {
        amount += ", at the bound of its range";
    }
    amount
}

/// The same of a number with its interval and unit.
pub(super) fn amount_of(value: f64, ci95: Option<[f64; 2]>, unit: &str) -> String {
    let (value, ends) = digits_of(value, ci95);
    let is_told = |end: usize| ci95.is_some_and(|ends| ends[end].is_finite());
    let interval = match (ends, is_told(0), is_told(1)) {
        (None, ..) => "not fitted".to_owned(),
        (Some([low, high]), true, true) => format!("{low} to {high}"),
        (Some([low, _]), true, false) => format!("{low} or more"),
        (Some([_, high]), false, true) => format!("{high} or less"),
        (Some(_), false, false) => "any value, as far as these logs tell".to_owned(),
    };
    format!("{} ({interval})", with_unit(value, unit))
}

/// A number with its unit; a pure number has the unit `1`.
pub(super) fn with_unit(number: String, unit: &str) -> String {
    match unit {
        "" | "1" => number,
        unit => format!("{number} {unit}"),
    }
}

/// A parameter's value and the ends of its interval, rounded to a twentieth of the interval's width.
pub(crate) fn digits(parameter: &Parameter) -> (String, Option<[String; 2]>) {
    digits_of(parameter.value, parameter.ci95)
}

/// The same of a number with its interval.
pub(super) fn digits_of(value: f64, ci95: Option<[f64; 2]>) -> (String, Option<[String; 2]>) {
    let resolution = match ci95 {
        Some([low, high]) if (high - low).is_finite() => 0.05 * (high - low),
        _ => 1e-4 * value.abs(),
    };
    let number = |x: f64| rounded(x, resolution);
    (number(value), ci95.map(|ends| ends.map(number)))
}

/// A number with as many decimals as the resolution needs; very large and very small ones with an exponent.
fn rounded(x: f64, resolution: f64) -> String {
    if x == 0.0 {
        return "0".to_owned();
    }
    if !(1e-9..1e9).contains(&x.abs()) {
        return format!("{x:.2e}");
    }
    let resolution = resolution.max(1e-9 * x.abs()).max(1e-12);
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // between 0 and 12
    let digits = (-resolution.log10()).ceil().clamp(0.0, 12.0) as usize;
    format!("{x:.digits$}")
}

/// How the test logs were set apart.
pub(super) fn split(method: &SplitMethod) -> String {
    match method {
        SplitMethod::Given => "as given".to_owned(),
        SplitMethod::LastLogs { count } => {
            format!("the last {count} logs were kept for the test")
        }
        SplitMethod::EndOfEachLog { share, gap_s } => {
            format!(
                "the last {:.0} % of each log, after a gap of {gap_s} s, were kept for the test",
                100.0 * share
            )
        }
    }
}

/// A p-value.
pub(super) fn probability(p: f64) -> String {
    if p < 1e-12 {
        "< 1e-12".to_owned()
    } else if p < 1e-3 {
        format!("{p:.0e}")
    } else {
        format!("{p:.3}")
    }
}

/// `p = 0.031`, `p < 1e-12`
pub(super) fn p_value(p: f64) -> String {
    let number = probability(p);
    match number.starts_with('<') {
        true => format!("p {number}"),
        false => format!("p = {number}"),
    }
}

/// A number with two to three significant digits.
pub(super) fn small(x: f64) -> String {
    rounded(x, 0.01 * x.abs())
}
