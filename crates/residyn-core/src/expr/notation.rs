//! How a language writes expressions.

/// How a language writes the operations of a program. Printed expressions carry the precedence of their weakest
/// operator, so that parentheses are added only where they are needed. The defaults are those of most programming
/// languages.
pub trait Notation {
    /// A constant; it may be negative.
    fn number(&self, value: f64) -> String;
    /// An input, an output or an intermediate.
    fn name(&self, name: &str) -> String;
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
        infix(self, a, "/", b, PRODUCT)
    }

    /// `a` to the power of `b`; squares and cubes come with a whole number for `b`. As products they are exact where
    /// powers are rounded, and faster.
    fn power(&self, a: Part, b: Part) -> Part {
        let times = match b.text.as_str() {
            "2" => 2,
            "3" => 3,
            _ => return atom(self.call("pow", &[a.text, b.text])),
        };
        Part::of(
            PRODUCT,
            vec![a.binding(self, PRODUCT + 1); times].join(" * "),
        )
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
    pub(super) fn of(precedence: u8, text: String) -> Self {
        Self { text, precedence }
    }

    /// The text as a condition: only a comparison reads as one by itself.
    pub fn condition(&self) -> String {
        let sign = if self.precedence == COMPARE {
            ""
        } else {
            " > 0"
        };
        format!("{}{sign}", self.text)
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
    Part::of(ATOM, text)
}

/// An operation whose operators of one precedence are read from the left.
pub(super) fn infix<N: Notation + ?Sized>(
    notation: &N,
    a: Part,
    sign: &str,
    b: Part,
    precedence: u8,
) -> Part {
    let b = b.binding(notation, precedence + 1);
    let a = a.binding(notation, precedence);
    Part::of(precedence, a + " " + sign + " " + &b)
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
        let (a, b) = (a.binding(self, POWER + 1), b.binding(self, POWER));
        Part::of(POWER, a + "^" + &b)
    }

    fn choice(&self, condition: &Part, a: &str, b: &str) -> String {
        format!("where({}, {a}, {b})", condition.text)
    }
}
