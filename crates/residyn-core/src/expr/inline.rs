use super::op::{Node, Op};
use super::{Graph, Program};

impl Graph {
    /// Write `program` into this graph with its inputs replaced by `inputs`, so that programs can be built upon
    /// programs. Returns the nodes of its outputs; its labels are kept.
    ///
    /// # Panics
    /// When `inputs` is not as long as [`Program::inputs`].
    pub fn append(&mut self, program: &Program, inputs: &[Node]) -> Vec<Node> {
        assert_eq!(
            inputs.len(),
            program.inputs.len(),
            "one node for each input"
        );
        let mut written: Vec<Node> = Vec::with_capacity(program.ops.len());
        for op in &program.ops {
            let at = |node: Node| written[node.index()];
            let node = match *op {
                Op::Const(value) => self.constant(value),
                Op::Input(k) => inputs[k as usize],
                Op::Unary(op, a) => self.unary(op, at(a)),
                Op::Binary(op, a, b) => self.binary(op, at(a), at(b)),
                Op::Where(c, a, b) => self.select(at(c), at(a), at(b)),
            };
            written.push(node);
        }
        for (node, name) in &program.labels {
            self.label(written[node.index()], name);
        }
        program
            .outputs
            .iter()
            .map(|output| written[output.index()])
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use crate::expr::{Graph, Scope, parse};

    #[test]
    fn an_appended_program_is_a_composition() {
        let mut inner = Graph::new();
        let scope = Scope::of_inputs(&mut inner, ["a", "b"]);
        let formula = parse("where(a < b, sin(a) * 2, b^3 - max(a, 1))").unwrap();
        let output = scope.lower(&mut inner, &formula).unwrap();
        let inner = inner.finish(&[output, output]);

        let mut outer = Graph::new();
        let (x, two) = (outer.input("x"), outer.constant(2.0));
        let doubled = outer.mul(x, two);
        let results = outer.append(&inner, &[doubled, x]);
        let sum = outer.add(results[0], results[1]);
        let outer = outer.finish(&[sum]);
        for x in [-1.3, 0.4, 2.0] {
            assert_eq!(outer.eval(&[x])[0], 2.0 * inner.eval(&[2.0 * x, x])[0]);
        }
    }
}
