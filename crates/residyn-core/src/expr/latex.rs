//! Expressions in LaTeX.

use super::notation::{Notation, POWER, PRODUCT, Part};

pub(super) struct Latex;

/// The name of an input, an output or an intermediate in LaTeX's mathematics.
pub fn latex_name(name: &str) -> String {
    Latex.name(name)
}

const GREEK: &[&str] = &[
    "alpha", "beta", "gamma", "delta", "epsilon", "zeta", "eta", "theta", "kappa", "lambda", "mu",
    "nu", "xi", "rho", "sigma", "tau", "phi", "chi", "psi", "omega",
];

impl Latex {
    fn symbol(word: &str) -> String {
        match word {
            _ if GREEK.contains(&word) => format!("\\{word}"),
            _ if word.chars().count() > 1 => format!("\\mathrm{{{word}}}"),
            _ => word.to_owned(),
        }
    }

    /// `qdd12` is the second derivative of `q` with index 12.
    fn split(name: &str) -> (String, String) {
        let (stem, subscript) = match name.split_once('_') {
            Some((stem, subscript)) => (stem, subscript.replace('_', ",")),
            None => {
                let stem = name.trim_end_matches(|c: char| c.is_ascii_digit());
                (stem, name[stem.len()..].to_owned())
            }
        };
        let symbol = match stem {
            "qd" => "\\dot{q}".to_owned(),
            "qdd" => "\\ddot{q}".to_owned(),
            _ => Self::symbol(stem),
        };
        (symbol, subscript)
    }
}

impl Notation for Latex {
    fn number(&self, value: f64) -> String {
        match format!("{value:e}").split_once('e') {
            Some((mantissa, exponent)) if value != 0.0 && !(1e-4..1e6).contains(&value.abs()) => {
                format!("{mantissa} \\cdot 10^{{{exponent}}}")
            }
            _ => format!("{value}"),
        }
    }

    fn name(&self, name: &str) -> String {
        let (symbol, subscript) = Self::split(name);
        if subscript.is_empty() {
            symbol
        } else if subscript.chars().all(|c| c.is_ascii_digit() || c == ',') || subscript.len() == 1
        {
            format!("{symbol}_{{{subscript}}}")
        } else {
            format!("{symbol}_{{\\mathrm{{{subscript}}}}}")
        }
    }

    fn call(&self, function: &str, arguments: &[String]) -> String {
        let name = match function {
            "atan2" | "sign" => format!("\\operatorname{{{function}}}"),
            _ => format!("\\{function}"),
        };
        format!("{name}\\left({}\\right)", arguments.join(", "))
    }

    fn parenthesis(&self, inner: &str) -> String {
        format!("\\left({inner}\\right)")
    }

    fn product(&self, a: String, b: &str) -> String {
        let between = if b.starts_with(|c: char| c.is_ascii_digit()) {
            "\\cdot "
        } else {
            "\\,"
        };
        a + " " + between + b
    }

    fn quotient(&self, a: Part, b: Part) -> Part {
        Part::of(PRODUCT, format!("\\frac{{{}}}{{{}}}", a.text, b.text))
    }

    fn power(&self, a: Part, b: Part) -> Part {
        let a = a.binding(self, POWER + 1);
        Part::of(POWER, format!("{{{a}}}^{{{}}}", b.text))
    }

    fn absolute(&self, a: &str) -> String {
        format!("\\left|{a}\\right|")
    }

    fn root(&self, a: &str) -> String {
        format!("\\sqrt{{{a}}}")
    }

    fn choice(&self, condition: &Part, a: &str, b: &str) -> String {
        let condition = condition.condition();
        format!("\\begin{{cases}} {a} & {condition} \\\\ {b} & \\text{{otherwise}} \\end{{cases}}")
    }
}
