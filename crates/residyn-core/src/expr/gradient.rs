use super::graph::Graph;
use super::op::{Binary, Node, Op, Unary};

impl Graph {
    /// Reverse mode: the gradient of `sum_k seeds[k] * outputs[k]` with respect to each of `wrt`, as further nodes of
    /// this graph, so that gradients are evaluated and printed like programs.
    ///
    /// `sign`, comparisons and the condition of `where` count as constant.
    pub fn gradient(&mut self, outputs: &[Node], seeds: &[Node], wrt: &[Node]) -> Vec<Node> {
        let mut adjoints: Vec<Option<Node>> = vec![None; self.ops.len()];
        for (output, seed) in outputs.iter().zip(seeds) {
            self.accumulate(&mut adjoints, *output, *seed);
        }
        for index in (0..adjoints.len()).rev() {
            if let Some(adjoint) = adjoints[index] {
                let node = Node(u32::try_from(index).expect("nodes are numbered in 32 bits"));
                self.spread(&mut adjoints, node, adjoint);
            }
        }
        let zero = self.constant(0.0);
        let adjoint = |node: &Node| adjoints.get(node.index()).copied().flatten();
        wrt.iter()
            .map(|node| adjoint(node).unwrap_or(zero))
            .collect()
    }

    /// The matrix of derivatives `[output][wrt]`.
    pub fn jacobian(&mut self, outputs: &[Node], wrt: &[Node]) -> Vec<Vec<Node>> {
        let one = self.constant(1.0);
        outputs
            .iter()
            .map(|output| self.gradient(&[*output], &[one], wrt))
            .collect()
    }

    fn accumulate(&mut self, adjoints: &mut [Option<Node>], node: Node, part: Node) {
        if self.constant_value(part) == Some(0.0) {
            return;
        }
        adjoints[node.index()] = Some(match adjoints[node.index()] {
            Some(sum) => self.add(sum, part),
            None => part,
        });
    }

    /// Pass the adjoint of `node` on to its operands.
    fn spread(&mut self, adjoints: &mut [Option<Node>], node: Node, adjoint: Node) {
        let parts = match self.ops[node.index()] {
            Op::Const(_) | Op::Input(_) => Vec::new(),
            Op::Unary(op, a) => match self.unary_slope(op, a, node) {
                Some(slope) => vec![(a, self.mul(adjoint, slope))],
                None => Vec::new(),
            },
            Op::Binary(op, a, b) => self.binary_parts(op, a, b, node, adjoint),
            Op::Where(condition, a, b) => self.choice_parts(condition, a, b, adjoint),
        };
        for (operand, part) in parts {
            self.accumulate(adjoints, operand, part);
        }
    }

    /// d node / d a, where `node` is `op(a)`.
    fn unary_slope(&mut self, op: Unary, a: Node, node: Node) -> Option<Node> {
        let one = self.constant(1.0);
        Some(match op {
            Unary::Neg => self.constant(-1.0),
            Unary::Sin => self.unary(Unary::Cos, a),
            Unary::Cos => {
                let sine = self.unary(Unary::Sin, a);
                self.neg(sine)
            }
            Unary::Tan => {
                let square = self.mul(node, node);
                self.add(one, square)
            }
            Unary::Exp => node,
            Unary::Log => self.div(one, a),
            Unary::Sqrt => {
                let half = self.constant(0.5);
                self.div(half, node)
            }
            Unary::Abs => self.unary(Unary::Sign, a),
            Unary::Sign => return None,
            Unary::Tanh => {
                let square = self.mul(node, node);
                self.sub(one, square)
            }
        })
    }

    fn binary_parts(
        &mut self,
        op: Binary,
        a: Node,
        b: Node,
        node: Node,
        adjoint: Node,
    ) -> Vec<(Node, Node)> {
        match op {
            Binary::Add => vec![(a, adjoint), (b, adjoint)],
            Binary::Sub => vec![(a, adjoint), (b, self.neg(adjoint))],
            Binary::Mul => vec![(a, self.mul(adjoint, b)), (b, self.mul(adjoint, a))],
            Binary::Div => {
                let to_a = self.div(adjoint, b);
                let product = self.mul(to_a, node);
                vec![(a, to_a), (b, self.neg(product))]
            }
            Binary::Pow => self.power_parts(a, b, node, adjoint),
            Binary::Atan2 => {
                let (yy, xx) = (self.mul(a, a), self.mul(b, b));
                let square = self.add(yy, xx);
                let scaled = self.div(adjoint, square);
                let to_x = self.mul(scaled, a);
                vec![(a, self.mul(scaled, b)), (b, self.neg(to_x))]
            }
            Binary::Min => {
                let first = self.binary(Binary::Less, a, b);
                self.choice_parts(first, a, b, adjoint)
            }
            Binary::Max => {
                let first = self.binary(Binary::Less, b, a);
                self.choice_parts(first, a, b, adjoint)
            }
            Binary::Less => Vec::new(),
        }
    }

    /// d(a^b) = b a^(b-1) da + a^b log(a) db; the second part only if the power is not a constant. It tends to 0 with
    /// a.
    fn power_parts(&mut self, a: Node, b: Node, node: Node, adjoint: Node) -> Vec<(Node, Node)> {
        let one = self.constant(1.0);
        let less = self.sub(b, one);
        let lower = self.binary(Binary::Pow, a, less);
        let slope = self.mul(b, lower);
        let mut parts = vec![(a, self.mul(adjoint, slope))];
        if self.constant_value(b).is_none() {
            let log = self.unary(Unary::Log, a);
            let slope = self.mul(node, log);
            let slope = self.zero_at_zero(a, slope);
            parts.push((b, self.mul(adjoint, slope)));
        }
        parts
    }

    /// `value`, or 0 where `a` is 0; NaN stays NaN.
    fn zero_at_zero(&mut self, a: Node, value: Node) -> Node {
        let sign = self.unary(Unary::Sign, a);
        let size = self.unary(Unary::Abs, sign);
        let [zero, one] = [0.0, 1.0].map(|value| self.constant(value));
        let is_zero = self.sub(one, size);
        self.select(is_zero, zero, value)
    }

    /// The adjoint goes to `a` where the condition is positive, else to `b`.
    fn choice_parts(&mut self, first: Node, a: Node, b: Node, adjoint: Node) -> Vec<(Node, Node)> {
        let zero = self.constant(0.0);
        let to_a = self.select(first, adjoint, zero);
        vec![(a, to_a), (b, self.select(first, zero, adjoint))]
    }
}
