//! How a language writes expressions.

/// How a language writes the operations of a program. Printed expressions carry the precedence of their weakest
/// operator, so that parentheses are added only where they are needed. The defaults are those of most programming
/// languages.
pub trait Notation {
    /// A constant; it may be negative.
    fn number(&self, value: f64) -> String;
    /// An input, an output or an intermediate.
    fn name(&self, name: &str) -> String;
    /// `a` to the power of `b`; squares and cubes come with a whole number for `b`.
    fn power(&self, a: Part, b: Part) -> Part;
    /// `a` where `condition` is positive, else `b`.
    fn choice(&self, condition: &Part, a: &str, b: &str) -> String;

    fn call(&self, function: &str, arguments: &[String]) -> String {
        format!("{function}({})", arguments.join(", "))
    }

    fn parenthesis(&self, inner: &str) -> String {
        format!("({inner})")
    }

    fn product(&self, a: String, b: &str) -> String {
        a + " * " + b
    }

    fn quotient(&self, a: Part, b: Part) -> Part {
        let (a, b) = (a.binding(self, PRODUCT), b.binding(self, PRODUCT + 1));
        Part {
            text: a + " / " + &b,
            precedence: PRODUCT,
        }
    }

    fn absolute(&self, a: &str) -> String {
        self.call("abs", &[a.to_owned()])
    }

    fn root(&self, a: &str) -> String {
        self.call("sqrt", &[a.to_owned()])
    }
}

/// A printed expression and the precedence of its weakest operator.
#[derive(Debug, Clone)]
pub struct Part {
    pub text: String,
    pub(super) precedence: u8,
}

pub(super) const COMPARE: u8 = 1;
pub(super) const SUM: u8 = 3;
pub(super) const PRODUCT: u8 = 5;
pub(super) const SIGN: u8 = 7;
pub(super) const POWER: u8 = 9;
pub(super) const ATOM: u8 = 11;

impl Part {
    /// Whether it is a comparison.
    pub fn is_comparison(&self) -> bool {
        self.precedence == COMPARE
    }

    /// A product of factors that are already printed.
    pub fn product(text: String) -> Self {
        Self {
            text,
            precedence: PRODUCT,
        }
    }

    /// A call or another expression that needs no parentheses.
    pub fn call(text: String) -> Self {
        atom(text)
    }

    /// The text as a factor of a product, in parentheses if it needs them.
    pub fn factor<N: Notation + ?Sized>(self, notation: &N) -> String {
        self.binding(notation, PRODUCT + 1)
    }

    /// The text, in parentheses if it binds weaker than `least`.
    pub(super) fn binding<N: Notation + ?Sized>(self, notation: &N, least: u8) -> String {
        if self.precedence < least {
            notation.parenthesis(&self.text)
        } else {
            self.text
        }
    }
}

pub(super) fn atom(text: String) -> Part {
    Part {
        text,
        precedence: ATOM,
    }
}

/// The language of model files.
pub(super) struct Text;

impl Notation for Text {
    fn number(&self, value: f64) -> String {
        format!("{value}")
    }

    fn name(&self, name: &str) -> String {
        name.to_owned()
    }

    fn power(&self, a: Part, b: Part) -> Part {
        Part {
            text: format!("{}^{}", a.binding(self, POWER + 1), b.binding(self, POWER)),
            precedence: POWER,
        }
    }

    fn choice(&self, condition: &Part, a: &str, b: &str) -> String {
        format!("where({}, {a}, {b})", condition.text)
    }
}
