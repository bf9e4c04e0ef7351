//! Fitted values that differ from the declared ones by one factor: that is a gain of the drive, or the unit of its
//! torque, rather than another value of each.

use crate::data::{Audit, Finding, Quantity, Severity};
use crate::expr::is_of_torque;
use crate::model::{Model, Parameter};

/// Two values may share a factor by chance.
pub(super) const FEWEST: usize = 3;

/// A smaller difference from 1 is within what a drawing is off.
pub(super) const LEAST: f64 = 0.1;

/// Report in the first log's audit that all values which a torque's size enters, declared and fitted, differ by one factor.
pub(super) fn report_drive_gain(declared: &Model, fitted: &Model, audits: &mut [Audit]) {
    if declared.driven_by() != Quantity::Torque {
        return;
    }
    let Some((factor, names)) = common_factor(&declared.parameters, &fitted.parameters) else {
        return;
    };
    let text = format!(
        "{} are all {factor:.3} times their declared values: a gain of the drive of {:.3} looks the same, and is one \
         value instead of {}. Check the unit of the torque, the torque constant and the gear; if the declared values are \
         right, give the torque columns this `factor` under [columns]",
        names.join(", "),
        1.0 / factor,
        names.len()
    );
    if let Some(audit) = audits.first_mut() {
        audit.add(Finding::new(Severity::Warning, text));
    }
}

/// The factor by which all fitted values proportional to the torques differ from the declared ones, as their 95 %
/// intervals have it, and the names of these parameters.
fn common_factor(declared: &[Parameter], fitted: &[Parameter]) -> Option<(f64, Vec<String>)> {
    let free = declared.iter().filter(|parameter| {
        !parameter.fixed && parameter.value != 0.0 && is_of_torque(&parameter.unit)
    });
    let ratio = |declared: &Parameter| {
        let found = fitted.iter().find(|found| found.name == declared.name)?;
        let [low, high] = found.ci95?.map(|end| end / declared.value);
        Some((declared.name.clone(), [low.min(high), low.max(high)]))
    };
    let ratios: Vec<(String, [f64; 2])> = free.map(ratio).collect::<Option<_>>()?;
    let is_off = |[low, high]: &[f64; 2]| *low > 1.0 + LEAST || 0.0 < *low && *high < 1.0 - LEAST;
    if ratios.len() < FEWEST || !ratios.iter().all(|(_, ends)| is_off(ends)) {
        return None;
    }
    let (names, ends): (Vec<String>, Vec<[f64; 2]>) = ratios.into_iter().unzip();
    let low = ends.iter().map(|[low, _]| *low).fold(f64::MIN, f64::max);
    let high = ends.iter().map(|[_, high]| *high).fold(f64::MAX, f64::min);
    (low <= high).then_some((0.5 * (low + high), names))
}

#[cfg(test)]
mod tests {
    use super::common_factor;
    use crate::model::{Library, Parameter};

    /// The masses and inertias of an acrobot, fitted to these shares of their declared values, within 2 %.
    fn found(shares: [f64; 4]) -> Option<(f64, Vec<String>)> {
        let declared = Library::built_in().model("acrobot").unwrap().parameters;
        let mut shares = shares.into_iter();
        let fitted = |declared: &Parameter| {
            let share = match declared.unit.starts_with("kg") {
                true => shares.next().unwrap(),
                false => 1.0,
            };
            let value = share * declared.value;
            Parameter {
                value,
                ci95: Some([0.98 * value, 1.02 * value]),
                ..declared.clone()
            }
        };
        let fitted: Vec<Parameter> = declared.iter().map(fitted).collect();
        common_factor(&declared, &fitted)
    }

    #[test]
    fn values_that_are_off_by_one_factor_are_one_gain() {
        let (factor, names) = found([0.8, 0.79, 0.81, 0.8]).unwrap();
        assert!((factor - 0.8).abs() < 0.01, "{factor}");
        assert_eq!(names, ["m1", "m2", "I1", "I2"]);
        assert_eq!(found([0.8, 0.8, 0.8, 0.9]), None, "one value differs");
        assert_eq!(
            found([0.8, 0.8, 0.8, 1.0]),
            None,
            "one value is as declared"
        );
        assert_eq!(found([1.03, 1.03, 1.03, 1.03]), None, "within a drawing's");
    }
}
