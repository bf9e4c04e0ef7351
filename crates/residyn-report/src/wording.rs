//! Numbers, lists and names as reports write them.

use super::schema::ParameterEntry;
use residyn_core::closeloop::SplitMethod;
use residyn_core::digits::{amount_of, rounded};

/// The models that a report compares, with one name each in tables, plots and on the terminal.
pub(super) const AS_WRITTEN: &str = "declared model as written";
pub(super) const FITTED: &str = "declared model, fitted";
pub(super) const WITH_FRICTION: &str = "with baseline friction";
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

/// `0.1598 N m (0.1593 to 0.1603)`; a value that holds in one log alone names the log, and a value at a bound of its
/// range says so.
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

/// `p = 0.031`, `p < 1e-12`
pub(super) fn p_value(p: f64) -> String {
    match p {
        p if p < 1e-12 => "p < 1e-12".to_owned(),
        p if p < 1e-3 => format!("p = {p:.0e}"),
        p => format!("p = {p:.3}"),
    }
}

/// A number with two to three significant digits.
pub(super) fn small(x: f64) -> String {
    rounded(x, 0.01 * x.abs())
}
