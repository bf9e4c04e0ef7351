//! Parts of a formula that are not finite, whatever values its names have.

use super::FormulaError;
use super::op::{Binary, Function, Unary};
use super::parse::{Formula, Infix, Kind, Term};
use super::scope::Fault;

impl Formula {
    /// Refuse such parts.
    pub(super) fn check_constants(&self) -> Result<(), FormulaError> {
        let fault = |(span, message)| FormulaError::new(&self.text, span, message);
        constant(&self.root).map(|_| ()).map_err(fault)
    }
}

/// The value of a term; `None` if a name determines it.
fn constant(term: &Term) -> Result<Option<f64>, Fault> {
    let fault = |message: String| Err((term.span.clone(), message));
    let value = match &term.kind {
        Kind::Number(value) => Some(*value),
        Kind::Name(_) => None,
        Kind::Negate(a) => constant(a)?.map(|a| -a),
        Kind::Infix(infix, a, b) => match (*infix, constant(a)?, constant(b)?) {
            (Infix::Plain(Binary::Div), _, Some(0.0)) => {
                return fault("this divides by zero".to_owned());
            }
            (Infix::Plain(Binary::Mul | Binary::Div), Some(0.0), _)
            | (Infix::Plain(Binary::Mul), _, Some(0.0)) => Some(0.0),
            (infix, a, b) => a.zip(b).map(|(a, b)| infix.apply(a, b)),
        },
        Kind::Call(function, arguments) => {
            let values = arguments.iter().map(constant);
            let values: Option<Vec<f64>> = values.collect::<Result<_, _>>()?;
            values.map(|values| function.apply(&values))
        }
    };
    match value {
        Some(value) if !value.is_finite() => fault(format!("this is {value}, not a finite number")),
        _ => Ok(value),
    }
}

impl Infix {
    fn apply(self, a: f64, b: f64) -> f64 {
        match self {
            Self::Plain(op) => op.apply(a, b),
            Self::Greater => Binary::Less.apply(b, a),
            Self::AtMost => 1.0 - Binary::Less.apply(b, a),
            Self::AtLeast => 1.0 - Binary::Less.apply(a, b),
        }
    }
}

impl Function {
    fn apply(self, arguments: &[f64]) -> f64 {
        match (self, arguments) {
            (Self::Unary(op), [a]) => op.apply(*a),
            (Self::Binary(op), [a, b]) => op.apply(*a, *b),
            (Self::Clamp, [x, low, high]) => Binary::Min.apply(Binary::Max.apply(*x, *low), *high),
            (Self::Where, [condition, then, _]) if *condition > 0.0 => *then,
            (Self::Where, [_, _, otherwise]) => *otherwise,
            (Self::Sign, [x]) => Unary::Sign.apply(*x),
            _ => unreachable!("the parser counts arguments"),
        }
    }
}
