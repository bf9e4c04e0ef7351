use std::collections::HashMap;
use std::ops::Range;

use super::error::{listed, shortened, suggestion};
use super::graph::Graph;
use super::op::{Binary, Function, Node, Unary};
use super::parse::{Formula, Infix, Kind, Term};
use super::{FormulaError, Program};

/// The form in which `sign` enters a program.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum SignForm {
    /// -1, 0, 1: for printing, and for simulations that handle the jump.
    Exact,
    /// tanh(x / width): for fitting and training, where the jump has no useful derivative.
    /// The width is in the unit of the argument.
    Smooth { width: f64 },
}

/// Bytes of a formula and what is wrong there.
pub(super) type Fault = (Range<usize>, String);

/// The names that a formula may use, and their nodes.
#[derive(Debug, Clone)]
pub struct Scope {
    names: HashMap<String, Node>,
    sign: SignForm,
    /// Nodes whose signs are given as nodes.
    signs: HashMap<Node, Node>,
}

impl Formula {
    /// The formula as a program of these inputs; `sign` is exact.
    ///
    /// # Errors
    /// A name that is not an input, with the nearest input.
    pub fn program<'n>(
        &self,
        inputs: impl IntoIterator<Item = &'n str>,
    ) -> Result<Program, FormulaError> {
        let mut graph = Graph::new();
        let scope = Scope::of_inputs(&mut graph, inputs);
        let output = scope.lower(&mut graph, self)?;
        Ok(graph.finish(&[output]))
    }
}

impl Scope {
    /// An empty scope.
    pub fn new(sign: SignForm) -> Self {
        Self {
            names: HashMap::new(),
            sign,
            signs: HashMap::new(),
        }
    }

    /// Bind a name to a node.
    pub fn bind(&mut self, name: &str, node: Node) {
        self.names.insert(name.to_owned(), node);
    }

    /// Use the node `sign` as the sign of the node `of`.
    pub fn give_sign(&mut self, of: Node, sign: Node) {
        self.signs.insert(of, sign);
    }

    /// New inputs of a graph under their own names; `sign` is exact.
    pub fn of_inputs<'n>(graph: &mut Graph, names: impl IntoIterator<Item = &'n str>) -> Self {
        let mut scope = Self::new(SignForm::Exact);
        for name in names {
            let node = graph.input(name);
            scope.bind(name, node);
        }
        scope
    }

    pub fn get(&self, name: &str) -> Option<Node> {
        self.names.get(name).copied()
    }

    /// Write the formula into the graph.
    ///
    /// # Errors
    /// A name that the scope does not know, with the nearest one that it knows.
    pub fn lower(&self, graph: &mut Graph, formula: &Formula) -> Result<Node, FormulaError> {
        self.term(graph, &formula.root)
            .map_err(|(span, message)| FormulaError::new(&formula.text, span, message))
    }

    fn term(&self, graph: &mut Graph, term: &Term) -> Result<Node, Fault> {
        match &term.kind {
            Kind::Number(value) => Ok(graph.constant(*value)),
            Kind::Name(name) => self.names.get(name).copied().ok_or_else(|| {
                let mut known: Vec<&str> = self.names.keys().map(String::as_str).collect();
                known.sort_unstable();
                let near = suggestion(name, known.iter().copied());
                let list = if near.is_empty() {
                    format!("; known are {}", listed(known))
                } else {
                    near
                };
                let name = shortened(name);
                (term.span.clone(), format!("unknown name `{name}`{list}"))
            }),
            Kind::Negate(inner) => {
                let inner = self.term(graph, inner)?;
                Ok(graph.neg(inner))
            }
            Kind::Infix(infix, a, b) => {
                let (a, b) = (self.term(graph, a)?, self.term(graph, b)?);
                Ok(infix_node(graph, *infix, a, b))
            }
            Kind::Call(function, arguments) => {
                let arguments = arguments
                    .iter()
                    .map(|a| self.term(graph, a))
                    .collect::<Result<Vec<_>, _>>()?;
                Ok(self.call(graph, *function, &arguments))
            }
        }
    }

    pub(super) fn call(&self, graph: &mut Graph, function: Function, arguments: &[Node]) -> Node {
        match (function, arguments) {
            (Function::Unary(op), [a]) => graph.unary(op, *a),
            (Function::Binary(op), [a, b]) => graph.binary(op, *a, *b),
            (Function::Clamp, [x, low, high]) => {
                let raised = graph.binary(Binary::Max, *x, *low);
                graph.binary(Binary::Min, raised, *high)
            }
            (Function::Where, [condition, then, otherwise]) => {
                graph.select(*condition, *then, *otherwise)
            }
            (Function::Sign, [x]) => match (self.signs.get(x), self.sign) {
                (Some(sign), _) => *sign,
                (None, SignForm::Exact) => graph.unary(Unary::Sign, *x),
                (None, SignForm::Smooth { width }) => {
                    let width = graph.constant(width);
                    let scaled = graph.div(*x, width);
                    graph.unary(Unary::Tanh, scaled)
                }
            },
            _ => unreachable!("the parser counts arguments"),
        }
    }
}

pub(super) fn infix_node(graph: &mut Graph, infix: Infix, a: Node, b: Node) -> Node {
    match infix {
        Infix::Plain(op) => graph.binary(op, a, b),
        Infix::Greater => graph.binary(Binary::Less, b, a),
        Infix::AtMost => {
            let above = infix_node(graph, Infix::Greater, a, b);
            let one = graph.constant(1.0);
            graph.sub(one, above)
        }
        Infix::AtLeast => infix_node(graph, Infix::AtMost, b, a),
    }
}
