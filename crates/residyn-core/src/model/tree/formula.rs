//! Sums of parameters times functions, as formulas of a model file.

use super::series::{Series, Wave};
use crate::data::Joint;

/// A sum over parameters, each with its name and its coefficient.
pub(super) fn sum(terms: &[(&str, &Series)]) -> String {
    let mut text = String::new();
    for (name, series) in terms.iter().filter(|(_, series)| !series.is_zero()) {
        join(&mut text, &product(name, series));
    }
    if text.is_empty() { "0".into() } else { text }
}

/// A product of two factors, the first in parentheses if it is a sum.
pub(super) fn factors(first: &str, second: &str) -> String {
    match first {
        "1" => second.into(),
        _ if is_sum(first) => format!("({first})*{second}"),
        _ => format!("{first}*{second}"),
    }
}

/// Whether there is a sign outside all parentheses, other than a leading one.
fn is_sum(formula: &str) -> bool {
    let mut depth = 0;
    formula.split(' ').any(|word| {
        let outside = depth == 0;
        depth += word.matches('(').count();
        depth -= word.matches(')').count();
        outside && ["+", "-"].contains(&word)
    })
}

/// Add a term with its sign.
pub(super) fn join(text: &mut String, term: &str) {
    match term.strip_prefix('-') {
        _ if text.is_empty() => *text += term,
        Some(positive) => {
            *text += " - ";
            *text += positive;
        }
        None => {
            *text += " + ";
            *text += term;
        }
    }
}

/// A number in its shortest exact form.
pub(super) fn number(value: f64) -> String {
    let text = format!("{value:?}");
    text.strip_suffix(".0").unwrap_or(&text).into()
}

/// A parameter times a function.
fn product(name: &str, series: &Series) -> String {
    let terms: Vec<(&Wave, f64)> = series.terms().collect();
    if let [(wave, factor)] = terms[..] {
        return scaled(
            factor,
            &[&[name.to_owned()], wave_factors(wave).as_slice()].concat(),
        );
    }
    let mut inner = String::new();
    for (wave, factor) in terms {
        join(&mut inner, &scaled(factor, &wave_factors(wave)));
    }
    format!("{name}*({inner})")
}

fn scaled(factor: f64, factors: &[String]) -> String {
    let sign = if factor < 0.0 { "-" } else { "" };
    let size = number(factor.abs());
    let mut parts = factors.to_vec();
    if size != "1" || parts.is_empty() {
        parts.insert(0, size);
    }
    format!("{sign}{}", parts.join("*"))
}

/// `q1^2`, `cos(q2 + q3)`.
fn wave_factors(wave: &Wave) -> Vec<String> {
    let coordinate = |j: usize| Joint::at(j).name("q");
    let power = |(j, power): (usize, &u8)| match power {
        0 => None,
        1 => Some(coordinate(j)),
        _ => Some(format!("{}^{power}", coordinate(j))),
    };
    let mut factors: Vec<String> = wave.powers.iter().enumerate().filter_map(power).collect();
    let mut angle = String::new();
    for (j, times) in wave
        .angle
        .iter()
        .enumerate()
        .filter(|(_, times)| **times != 0)
    {
        join(&mut angle, &scaled(f64::from(*times), &[coordinate(j)]));
    }
    if !angle.is_empty() {
        factors.push(format!(
            "{}({angle})",
            if wave.is_sine { "sin" } else { "cos" }
        ));
    }
    factors
}

#[cfg(test)]
mod tests {
    use super::super::series::Series;
    use super::{factors, number, sum};

    #[test]
    fn sums_print_in_conventional_form() {
        let (c1, c2, s2) = (Series::cos(0), Series::cos(1), Series::sin(1));
        let folded = &(&c1 * &c2) * -0.5;
        let mixed = &(&Series::coordinate(2) * &s2) - &Series::constant(3.0);
        let text = sum(&[
            ("a", &Series::constant(1.0)),
            ("b", &folded),
            ("c", &mixed),
            ("d", &(&c1 * -1.0)),
        ]);
        assert_eq!(
            text,
            "a + b*(-0.25*cos(q1 - q2) - 0.25*cos(q1 + q2)) + c*(-3 + q3*sin(q2)) - d*cos(q1)"
        );
        assert_eq!(sum(&[("a", &Series::default())]), "0");
        assert_eq!(factors("a*(b + c)", "d"), "a*(b + c)*d");
        assert_eq!(factors("a*(b + c) - e", "d"), "(a*(b + c) - e)*d");
        assert_eq!(factors("-a", "d"), "-a*d");
        assert_eq!(
            [0.1, 2.0, 1e-7, 1e20].map(number),
            ["0.1", "2", "1e-7", "1e20"]
        );
    }
}
