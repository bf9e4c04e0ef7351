use super::op::{Node, Op};
use super::steps::{Steps, steps};

/// A finished list of operations: named inputs, then values computed from earlier ones, and the positions of the
/// outputs. Built by [`Graph::finish`](super::Graph::finish); never changed afterwards.
#[derive(Debug, Clone, PartialEq)]
pub struct Program {
    pub(super) inputs: Vec<String>,
    pub(super) ops: Vec<Op>,
    pub(super) outputs: Vec<Node>,
    pub(super) labels: Vec<(Node, String)>,
    pub(super) steps: Steps,
}

impl Program {
    /// Names of the inputs, in the order in which values are given.
    pub fn inputs(&self) -> &[String] {
        &self.inputs
    }

    /// The operations in evaluation order.
    pub fn ops(&self) -> &[Op] {
        &self.ops
    }

    /// The operations whose values are the outputs.
    pub fn outputs(&self) -> &[Node] {
        &self.outputs
    }

    /// Number of outputs.
    pub fn output_count(&self) -> usize {
        self.outputs.len()
    }

    /// For each input whether an output depends on it.
    pub fn inputs_read(&self) -> Vec<bool> {
        let mut read = vec![false; self.inputs.len()];
        let needed = needed(&self.ops, &self.outputs);
        for (op, needed) in self.ops.iter().zip(needed) {
            if let Op::Input(input) = op {
                read[*input as usize] |= needed;
            }
        }
        read
    }

    /// The same program with one of its outputs alone.
    #[must_use]
    pub fn of_output(&self, output: usize) -> Self {
        Self::compact(
            self.ops.clone(),
            self.inputs.clone(),
            self.labels.clone(),
            &self.outputs[output..=output],
        )
    }

    /// Keep the operations that the outputs need, and all inputs, whose numbering callers rely on. Inputs come first, then
    /// constants, then all other operations, so that an evaluator sets the first two once.
    pub(super) fn compact(
        ops: Vec<Op>,
        inputs: Vec<String>,
        labels: Vec<(Node, String)>,
        outputs: &[Node],
    ) -> Self {
        let needed = needed(&ops, outputs);
        let rank = |op: &Op| match op {
            Op::Input(_) => 0,
            Op::Const(_) => 1,
            _ => 2,
        };
        let mut order: Vec<usize> = (0..ops.len())
            .filter(|&i| needed[i] || matches!(ops[i], Op::Input(_)))
            .collect();
        order.sort_by_key(|&i| rank(&ops[i]));
        let mut renamed = vec![Node(u32::MAX); ops.len()];
        for (new, &old) in (0u32..).zip(&order) {
            renamed[old] = Node(new);
        }
        let rename = |node: Node| renamed[node.index()];
        let ops: Vec<Op> = order.iter().map(|&i| ops[i].map(rename)).collect();
        let outputs: Vec<Node> = outputs.iter().map(|&o| rename(o)).collect();
        Self {
            inputs,
            steps: steps(&ops, outputs.iter().map(|output| output.index())),
            ops,
            outputs,
            labels: labels
                .into_iter()
                .filter(|(node, _)| needed[node.index()])
                .map(|(node, name)| (rename(node), name))
                .collect(),
        }
    }
}

fn needed(ops: &[Op], outputs: &[Node]) -> Vec<bool> {
    let mut needed = vec![false; ops.len()];
    for output in outputs {
        needed[output.index()] = true;
    }
    for index in (0..ops.len()).rev() {
        if needed[index] {
            for operand in ops[index].operands() {
                needed[operand.index()] = true;
            }
        }
    }
    needed
}
