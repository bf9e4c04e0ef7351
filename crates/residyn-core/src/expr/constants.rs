//! Parts of a formula that are not finite, whatever values its names have.

use super::op::{Binary, Node};
use super::parse::{Formula, Infix, Kind, Term};
use super::scope::{Fault, infix_node};
use super::{FormulaError, Graph, Scope, SignForm};

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
    let constant_of = match &term.kind {
        Kind::Number(value) => Some(*value),
        Kind::Name(_) => None,
        Kind::Negate(a) => constant(a)?.map(|a| -a),
        Kind::Infix(infix, a, b) => match (*infix, constant(a)?, constant(b)?) {
            (Infix::Plain(Binary::Div), _, Some(0.0)) => {
                return fault("this divides by zero".to_owned());
            }
            (Infix::Plain(Binary::Mul | Binary::Div), Some(0.0), _)
            | (Infix::Plain(Binary::Mul), _, Some(0.0)) => Some(0.0),
            (infix, a, b) => a
                .zip(b)
                .map(|(a, b)| value(&[a, b], |graph, of| infix_node(graph, infix, of[0], of[1]))),
        },
        Kind::Call(function, arguments) => {
            let values = arguments.iter().map(constant);
            let values: Option<Vec<f64>> = values.collect::<Result<_, _>>()?;
            let scope = Scope::new(SignForm::Exact);
            values.map(|of| value(&of, |graph, of| scope.call(graph, *function, of)))
        }
    };
    match constant_of {
        Some(value) if !value.is_finite() => fault(format!("this is {value}, not a finite number")),
        _ => Ok(constant_of),
    }
}

/// The value of an operation on numbers.
fn value(of: &[f64], operation: impl FnOnce(&mut Graph, &[Node]) -> Node) -> f64 {
    let mut graph = Graph::new();
    let operands: Vec<Node> = of.iter().map(|number| graph.constant(*number)).collect();
    let result = operation(&mut graph, &operands);
    graph.finish(&[result]).eval(&[])[0]
}
