use serde::{Deserialize, Serialize};

/// A value in a [`Graph`](super::Graph) or [`Program`](super::Program): the position of the operation that computes it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Node(pub(super) u32);

impl Node {
    /// Its place in the list of operations.
    pub fn index(self) -> usize {
        self.0 as usize
    }
}

/// Functions of one value.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Unary {
    Neg,
    Sin,
    Cos,
    Tan,
    Exp,
    Log,
    Sqrt,
    Abs,
    /// -1, 0 or 1; its derivative is taken as zero everywhere.
    Sign,
    Tanh,
}

/// Functions of two values.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Binary {
    Add,
    Sub,
    Mul,
    Div,
    Pow,
    Atan2,
    Min,
    Max,
    /// 1 where the first is less than the second, else 0; its derivative is zero.
    Less,
}

/// One operation of a [`Program`](super::Program). Operands are earlier nodes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Op {
    Const(f64),
    /// The k-th named input.
    Input(u32),
    Unary(Unary, Node),
    Binary(Binary, Node, Node),
    /// The second operand where the first is positive, else the third.
    Where(Node, Node, Node),
}

/// The functions that a formula may call, and their operations.
pub(super) const FUNCTIONS: &[(&str, Function)] = &[
    ("abs", Function::Unary(Unary::Abs)),
    ("atan2", Function::Binary(Binary::Atan2)),
    ("clamp", Function::Clamp),
    ("cos", Function::Unary(Unary::Cos)),
    ("exp", Function::Unary(Unary::Exp)),
    ("log", Function::Unary(Unary::Log)),
    ("max", Function::Binary(Binary::Max)),
    ("min", Function::Binary(Binary::Min)),
    ("sign", Function::Sign),
    ("sin", Function::Unary(Unary::Sin)),
    ("sqrt", Function::Unary(Unary::Sqrt)),
    ("tan", Function::Unary(Unary::Tan)),
    ("tanh", Function::Unary(Unary::Tanh)),
    ("where", Function::Where),
];

/// Whether formulas know a function of this name.
pub fn is_function(name: &str) -> bool {
    Function::find(name).is_some()
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Function {
    Unary(Unary),
    Binary(Binary),
    Clamp,
    Sign,
    Where,
}

impl Function {
    pub(super) fn find(name: &str) -> Option<Self> {
        FUNCTIONS.iter().find(|(n, _)| *n == name).map(|(_, f)| *f)
    }

    /// As formulas call it.
    pub(super) fn name(self) -> &'static str {
        let own = FUNCTIONS.iter().find(|(_, function)| *function == self);
        own.map_or("", |(name, _)| name)
    }

    /// Names of its arguments, for error messages.
    pub(super) fn arguments(self) -> &'static [&'static str] {
        match self {
            Self::Unary(_) | Self::Sign => &["x"],
            Self::Binary(Binary::Atan2) => &["y", "x"],
            Self::Binary(_) => &["a", "b"],
            Self::Clamp => &["x", "low", "high"],
            Self::Where => &["condition", "then", "else"],
        }
    }
}

impl Op {
    /// Its operands.
    pub fn operands(self) -> impl Iterator<Item = Node> {
        let operands = match self {
            Self::Const(_) | Self::Input(_) => [None; 3],
            Self::Unary(_, a) => [Some(a), None, None],
            Self::Binary(_, a, b) => [Some(a), Some(b), None],
            Self::Where(c, a, b) => [Some(c), Some(a), Some(b)],
        };
        operands.into_iter().flatten()
    }

    /// The same operation on other nodes.
    #[must_use]
    pub fn map(self, mut f: impl FnMut(Node) -> Node) -> Self {
        match self {
            Self::Const(_) | Self::Input(_) => self,
            Self::Unary(op, a) => Self::Unary(op, f(a)),
            Self::Binary(op, a, b) => Self::Binary(op, f(a), f(b)),
            Self::Where(c, a, b) => Self::Where(f(c), f(a), f(b)),
        }
    }
}

impl Unary {
    pub(super) fn apply<T: crate::lanes::Element>(self, a: T) -> T {
        match self {
            Self::Neg => -a,
            Self::Sin => a.sin(),
            Self::Cos => a.cos(),
            Self::Tan => a.tan(),
            Self::Exp => a.exp(),
            Self::Log => a.ln(),
            Self::Sqrt => a.sqrt(),
            Self::Abs => a.abs(),
            // Unlike the standard library's signum, zero at zero: no dry friction acts on a joint at rest.
            Self::Sign if a == T::zero() => T::zero(),
            Self::Sign => a.signum(),
            Self::Tanh => a.tanh(),
        }
    }
}

impl Binary {
    pub(super) fn apply<T: crate::lanes::Element>(self, a: T, b: T) -> T {
        match self {
            Self::Add => a + b,
            Self::Sub => a - b,
            Self::Mul => a * b,
            Self::Div => a / b,
            Self::Pow => a.powf(b),
            Self::Atan2 => a.atan2(b),
            // Comparisons, not the standard min and max, so that NaN propagates.
            Self::Min if a.is_nan() || a < b => a,
            Self::Max if a.is_nan() || a > b => a,
            Self::Min | Self::Max => b,
            Self::Less if a < b => T::one(),
            Self::Less => T::zero(),
        }
    }
}
