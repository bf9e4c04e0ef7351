//! Sums of parameters times functions, as formulas of a model file.

use super::series::{Series, Wave};
use crate::data::Joint;

/// A parameter with its coefficient.
pub(super) struct Weighed<'t> {
    pub name: &'t str,
    pub series: Series,
    /// The power of length in the coefficient's unit, to which coordinates of sliding joints contribute.
    pub lengths: i32,
}

/// A sum over parameters.
pub(super) fn sum(terms: &[Weighed<'_>]) -> String {
    let mut text = String::new();
    for term in terms.iter().filter(|term| !term.series.is_zero()) {
        join(&mut text, &product(term));
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

/// A parameter times a function. A number that stands for a length is written even if it is one, as it has a unit.
fn product(term: &Weighed<'_>) -> String {
    let name = term.name;
    let is_length = |wave: &Wave| term.lengths != wave.lengths();
    let terms: Vec<(&Wave, f64)> = term.series.terms().collect();
    if let [(wave, factor)] = terms[..] {
        let factors = [&[name.to_owned()], wave_factors(wave).as_slice()].concat();
        return scaled(factor, factors, is_length(wave));
    }
    let mut inner = String::new();
    for (wave, factor) in terms {
        join(
            &mut inner,
            &scaled(factor, wave_factors(wave), is_length(wave)),
        );
    }
    format!("{name}*({inner})")
}

fn scaled(factor: f64, mut factors: Vec<String>, has_unit: bool) -> String {
    let sign = if factor < 0.0 { "-" } else { "" };
    let size = number(factor.abs());
    if size != "1" || has_unit || factors.is_empty() {
        factors.insert(0, size);
    }
    format!("{sign}{}", factors.join("*"))
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
        join(
            &mut angle,
            &scaled(f64::from(*times), vec![coordinate(j)], false),
        );
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
    use super::{Weighed, factors, number, sum};

    #[test]
    fn sums_print_in_conventional_form() {
        let (c1, c2, s2) = (Series::cos(0), Series::cos(1), Series::sin(1));
        let folded = &(&c1 * &c2) * -0.5;
        let mixed = &(&Series::coordinate(2) * &s2) - &Series::constant(3.0);
        let weighed = |name, series, lengths| Weighed {
            name,
            series,
            lengths,
        };
        let text = sum(&[
            weighed("a", Series::constant(1.0), 0),
            weighed("b", folded, 0),
            weighed("c", mixed, 1),
            weighed("d", &c1 * -1.0, 0),
            weighed("e", c2, 1),
        ]);
        assert_eq!(
            text,
            "a + b*(-0.25*cos(q1 - q2) - 0.25*cos(q1 + q2)) + c*(-3 + q3*sin(q2)) - d*cos(q1) + 1*e*cos(q2)"
        );
        assert_eq!(sum(&[weighed("a", Series::default(), 0)]), "0");
        assert_eq!(factors("a*(b + c)", "d"), "a*(b + c)*d");
        assert_eq!(factors("a*(b + c) - e", "d"), "(a*(b + c) - e)*d");
        assert_eq!(factors("-a", "d"), "-a*d");
        assert_eq!(
            [0.1, 2.0, 1e-7, 1e20].map(number),
            ["0.1", "2", "1e-7", "1e20"]
        );
    }
}
