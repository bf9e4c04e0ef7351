//! Numbers rounded to the digits that are known.

use crate::model::Parameter;

/// A parameter's value and the ends of its interval, rounded to a twentieth of the interval's width; whole numbers without an
/// interval as they are.
pub fn digits(parameter: &Parameter) -> (String, Option<[String; 2]>) {
    digits_of(parameter.value, parameter.ci95)
}

/// As above, for a number with its interval.
pub fn digits_of(value: f64, ci95: Option<[f64; 2]>) -> (String, Option<[String; 2]>) {
    let resolution = match ci95 {
        Some([low, high]) if (high - low).is_finite() => 0.05 * (high - low),
        // A number that was set or counted.
        None if value.fract() == 0.0 => 1.0,
        _ => 1e-4 * value.abs(),
    };
    let number = |x: f64| rounded(x, resolution);
    (number(value), ci95.map(|ends| ends.map(number)))
}

/// A number with as many decimals as the resolution needs; very large and very small ones with an exponent.
pub fn rounded(x: f64, resolution: f64) -> String {
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

/// `0.1598 N m (0.1593 to 0.1603)`: a number with its interval and unit.
pub fn amount_of(value: f64, ci95: Option<[f64; 2]>, unit: &str) -> String {
    let (value, ends) = digits_of(value, ci95);
    let is_bounded = |end: usize| ci95.is_some_and(|ends| ends[end].is_finite());
    let interval = match (ends, is_bounded(0), is_bounded(1)) {
        (None, ..) => "not fitted".to_owned(),
        (Some([low, high]), true, true) => format!("{low} to {high}"),
        (Some([low, _]), true, false) => format!("{low} or more"),
        (Some([_, high]), false, true) => format!("{high} or less"),
        (Some(_), false, false) => "any value: these logs do not bound it".to_owned(),
    };
    format!("{} ({interval})", with_unit(value, unit))
}

/// A number with its unit; a pure number has the unit `1`.
pub fn with_unit(number: String, unit: &str) -> String {
    match unit {
        "" | "1" => number,
        unit => format!("{number} {unit}"),
    }
}
