use rustc_hash::FxHashMap;

use super::Program;
use super::op::{Binary, Node, Op, Unary};

/// A program under construction. Equal operations are stored once (hash-consing), constants are folded if the result is
/// finite, since only finite constants can be written, and operands precede the operations that use them, so that the
/// list is in evaluation order.
#[derive(Debug, Clone, Default)]
pub struct Graph {
    pub(super) ops: Vec<Op>,
    inputs: Vec<String>,
    labels: Vec<(Node, String)>,
    known: FxHashMap<Key, Node>,
}

/// [`Op`] made hashable: constants by their bits.
type Key = (u8, u64, u32, u32);

impl Graph {
    /// An empty program.
    pub fn new() -> Self {
        Self::default()
    }

    /// A new named input. Inputs are numbered in the order of these calls.
    pub fn input(&mut self, name: &str) -> Node {
        self.inputs.push(name.to_owned());
        let input =
            Op::Input(u32::try_from(self.inputs.len() - 1).expect("fewer than 2^32 inputs"));
        self.push(input)
    }

    pub fn constant(&mut self, value: f64) -> Node {
        self.push(Op::Const(value))
    }

    /// Give `node` a name that the printers show as an intermediate.
    pub fn label(&mut self, node: Node, name: &str) {
        self.labels.push((node, name.to_owned()));
    }

    pub fn unary(&mut self, op: Unary, a: Node) -> Node {
        match (op, self.ops[a.index()]) {
            (_, Op::Const(value)) if op.apply(value).is_finite() => self.constant(op.apply(value)),
            (Unary::Neg, Op::Unary(Unary::Neg, inner)) => inner,
            _ => self.push(Op::Unary(op, a)),
        }
    }

    pub fn binary(&mut self, op: Binary, a: Node, b: Node) -> Node {
        let (left, right) = (self.constant_value(a), self.constant_value(b));
        if let (Some(left), Some(right)) = (left, right)
            && op.apply(left, right).is_finite()
        {
            return self.constant(op.apply(left, right));
        }
        match (op, left, right) {
            (Binary::Add, Some(0.0), _) | (Binary::Mul, Some(1.0), _) => b,
            (Binary::Add | Binary::Sub, _, Some(0.0))
            | (Binary::Mul | Binary::Div | Binary::Pow, _, Some(1.0)) => a,
            (Binary::Sub, Some(0.0), _) | (Binary::Mul, Some(-1.0), _) => self.unary(Unary::Neg, b),
            (Binary::Mul, _, Some(-1.0)) => self.unary(Unary::Neg, a),
            // An exact zero is a derivative that vanishes identically, whatever the other factor is.
            (Binary::Mul, Some(0.0), _)
            | (Binary::Mul, _, Some(0.0))
            | (Binary::Div, Some(0.0), _) => self.constant(0.0),
            (Binary::Pow, _, Some(power)) if power == 2.0 || power == 3.0 => {
                self.small_power(a, power)
            }
            _ => self.push(Op::Binary(op, a, b)),
        }
    }

    /// Squares and cubes as products: exact for negative bases and cheaper than a general power.
    fn small_power(&mut self, a: Node, power: f64) -> Node {
        let square = self.push(Op::Binary(Binary::Mul, a, a));
        if power == 2.0 {
            square
        } else {
            self.push(Op::Binary(Binary::Mul, square, a))
        }
    }

    pub fn select(&mut self, condition: Node, then: Node, otherwise: Node) -> Node {
        match self.constant_value(condition) {
            Some(value) if value > 0.0 => then,
            Some(_) => otherwise,
            None if then == otherwise => then,
            None => self.push(Op::Where(condition, then, otherwise)),
        }
    }

    pub fn add(&mut self, a: Node, b: Node) -> Node {
        self.binary(Binary::Add, a, b)
    }

    pub fn sub(&mut self, a: Node, b: Node) -> Node {
        self.binary(Binary::Sub, a, b)
    }

    pub fn mul(&mut self, a: Node, b: Node) -> Node {
        self.binary(Binary::Mul, a, b)
    }

    pub fn div(&mut self, a: Node, b: Node) -> Node {
        self.binary(Binary::Div, a, b)
    }

    /// The sum of products.
    pub fn dot(&mut self, a: &[Node], b: &[Node]) -> Node {
        let zero = self.constant(0.0);
        a.iter().zip(b).fold(zero, |sum, (a, b)| {
            let product = self.mul(*a, *b);
            self.add(sum, product)
        })
    }

    pub fn neg(&mut self, a: Node) -> Node {
        self.unary(Unary::Neg, a)
    }

    /// The solution of `matrix x = right` for a symmetric positive definite matrix, without a branch:
    /// the square-root-free Cholesky factorisation L D L^T, written out as operations.
    pub fn solve_spd(&mut self, matrix: &[Vec<Node>], right: &[Node]) -> Vec<Node> {
        let n = right.len();
        let zero = self.constant(0.0);
        let mut lower = vec![vec![zero; n]; n];
        let mut diagonal = vec![zero; n];
        for i in 0..n {
            for j in 0..=i {
                let mut rest = matrix[i][j];
                for k in 0..j {
                    let scaled = self.mul(lower[j][k], diagonal[k]);
                    let part = self.mul(lower[i][k], scaled);
                    rest = self.sub(rest, part);
                }
                if i == j {
                    diagonal[i] = rest;
                } else {
                    lower[i][j] = self.div(rest, diagonal[j]);
                }
            }
        }
        let mut x = right.to_vec();
        for i in 0..n {
            for k in 0..i {
                let part = self.mul(lower[i][k], x[k]);
                x[i] = self.sub(x[i], part);
            }
        }
        for i in 0..n {
            x[i] = self.div(x[i], diagonal[i]);
        }
        for i in (0..n).rev() {
            for k in i + 1..n {
                let part = self.mul(lower[k][i], x[k]);
                x[i] = self.sub(x[i], part);
            }
        }
        x
    }

    /// The finished program with these outputs; operations that no output needs are dropped.
    pub fn finish(self, outputs: &[Node]) -> Program {
        Program::compact(self.ops, self.inputs, self.labels, outputs)
    }

    /// Whether a value is zero whatever the inputs are.
    pub fn is_zero(&self, node: Node) -> bool {
        self.constant_value(node) == Some(0.0)
    }

    pub(super) fn constant_value(&self, node: Node) -> Option<f64> {
        match self.ops[node.index()] {
            Op::Const(value) => Some(value),
            _ => None,
        }
    }

    fn push(&mut self, op: Op) -> Node {
        let next = Node(u32::try_from(self.ops.len()).expect("fewer than 2^32 operations"));
        let ops = &mut self.ops;
        *self.known.entry(key(op)).or_insert_with(|| {
            ops.push(op);
            next
        })
    }
}

fn key(op: Op) -> Key {
    match op {
        Op::Const(value) => (0, value.to_bits(), 0, 0),
        Op::Input(k) => (1, u64::from(k), 0, 0),
        Op::Unary(op, a) => (2, op as u64, a.0, 0),
        Op::Binary(op, a, b) => (3, op as u64, a.0, b.0),
        Op::Where(c, a, b) => (4, u64::from(c.0), a.0, b.0),
    }
}
