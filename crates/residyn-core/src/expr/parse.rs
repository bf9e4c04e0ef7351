use std::ops::Range;

use super::FormulaError;
use super::notation::{COMPARE, POWER, PRODUCT, SIGN, SUM};
use super::op::{Binary, FUNCTIONS, Function};
use crate::limits::{FORMULA_CHAIN, FORMULA_NESTING};

/// A parsed formula: names are not resolved yet, so that one formula can serve many joints.
#[derive(Debug, Clone, PartialEq)]
pub struct Formula {
    pub(super) text: String,
    pub(super) root: Term,
    terms: usize,
}

/// A part of a formula and the bytes that it was written in.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Term {
    pub(super) kind: Kind,
    pub(super) span: Range<usize>,
    /// Nested terms from here down, this one included: the recursion depth of a walk over the tree.
    height: usize,
}

#[derive(Debug, Clone, PartialEq)]
pub(super) enum Kind {
    Number(f64),
    Name(String),
    Negate(Box<Term>),
    Infix(Infix, Box<Term>, Box<Term>),
    Call(Function, Vec<Term>),
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Infix {
    Plain(Binary),
    Greater,
    AtMost,
    AtLeast,
}

impl Formula {
    /// The formula as it was written.
    pub fn text(&self) -> &str {
        &self.text
    }

    /// Number of its numbers, names and operations.
    pub fn terms(&self) -> usize {
        self.terms
    }

    /// Whether the formula is this name and nothing else.
    pub fn is_name(&self, name: &str) -> bool {
        matches!(&self.root.kind, Kind::Name(own) if own == name)
    }

    /// Every name that the formula mentions, in order, with repetitions.
    pub fn names(&self) -> Vec<&str> {
        let mut names = Vec::new();
        self.root.add_names(&mut names);
        names
    }

    /// By how much a comparison holds: its larger side less the smaller one. `None` of a formula that is no comparison.
    pub fn margin(&self) -> Option<Self> {
        let (larger, smaller) = match &self.root.kind {
            Kind::Infix(Infix::Greater | Infix::AtLeast, a, b) => (a, b),
            Kind::Infix(Infix::Plain(Binary::Less) | Infix::AtMost, a, b) => (b, a),
            _ => return None,
        };
        let minus = Infix::Plain(Binary::Sub);
        let root = Term {
            kind: Kind::Infix(minus, larger.clone(), smaller.clone()),
            ..self.root.clone()
        };
        Some(Self {
            root,
            ..self.clone()
        })
    }

    /// The formula with other names, where there is one.
    ///
    /// # Panics
    /// If what is given is not a name.
    #[must_use]
    pub fn renamed(&self, other: &dyn Fn(&str) -> Option<String>) -> Self {
        let mut places = Vec::new();
        self.root.add_places(&mut places);
        let mut text = self.text.clone();
        for (name, span) in places.iter().rev() {
            if let Some(other) = other(name) {
                text.replace_range(span.clone(), &other);
            }
        }
        parse(&text).expect("names can take the place of names")
    }

    /// Whether the formula calls this function.
    pub fn calls(&self, function: &str) -> bool {
        self.root.calls(function)
    }
}

impl Kind {
    fn operands(&self) -> Vec<&Term> {
        match self {
            Self::Number(_) | Self::Name(_) => Vec::new(),
            Self::Negate(a) => vec![a],
            Self::Infix(_, a, b) => vec![a, b],
            Self::Call(_, arguments) => arguments.iter().collect(),
        }
    }
}

impl Term {
    fn calls(&self, function: &str) -> bool {
        let is_called = matches!(&self.kind, Kind::Call(own, _) if own.name() == function);
        is_called
            || self
                .kind
                .operands()
                .iter()
                .any(|operand| operand.calls(function))
    }

    /// As [`Term::add_names`], each with its place in the text.
    fn add_places<'t>(&'t self, names: &mut Vec<(&'t str, Range<usize>)>) {
        if let Kind::Name(name) = &self.kind {
            names.push((name, self.span.clone()));
        }
        for operand in self.kind.operands() {
            operand.add_places(names);
        }
    }

    fn add_names<'t>(&'t self, names: &mut Vec<&'t str>) {
        if let Kind::Name(name) = &self.kind {
            names.push(name);
        }
        for operand in self.kind.operands() {
            operand.add_names(names);
        }
    }
}

/// Parse a formula such as `C_g * sin(q1) - max(0, b*qd1)^2`.
///
/// Operators by rising precedence: `< > <= >=`, `+ -`, `* /`, unary `-`, `^` (right-associative).
///
/// # Errors
/// A [`FormulaError`] that points at the first place that cannot be parsed, or that lies too deep ([`crate::limits`]).
pub fn parse(text: &str) -> Result<Formula, FormulaError> {
    let mut parser = Parser {
        text,
        at: 0,
        depth: 0,
        terms: 0,
    };
    let root = parser.infix(0)?;
    parser.skip_space();
    if parser.at < text.len() {
        let found = parser.next_char_text();
        return Err(parser.error_here(format!("expected an operator, found `{found}`")));
    }
    Ok(Formula {
        text: text.to_owned(),
        root,
        terms: parser.terms,
    })
}

/// [`parse`] for what a person wrote: no part of it may be infinite or NaN, whatever the names stand for.
///
/// # Errors
/// As [`parse`], and the first such part.
pub fn parse_finite(text: &str) -> Result<Formula, FormulaError> {
    let formula = parse(text)?;
    formula.check_constants()?;
    Ok(formula)
}

struct Parser<'a> {
    text: &'a str,
    at: usize,
    /// Nesting depth of operands here.
    depth: usize,
    terms: usize,
}

/// Infix operators with their precedence, longest spelling first.
const INFIX: &[(&str, Infix, u8)] = &[
    ("<=", Infix::AtMost, COMPARE),
    (">=", Infix::AtLeast, COMPARE),
    ("<", Infix::Plain(Binary::Less), COMPARE),
    (">", Infix::Greater, COMPARE),
    ("+", Infix::Plain(Binary::Add), SUM),
    ("-", Infix::Plain(Binary::Sub), SUM),
    ("*", Infix::Plain(Binary::Mul), PRODUCT),
    ("/", Infix::Plain(Binary::Div), PRODUCT),
    ("^", Infix::Plain(Binary::Pow), POWER),
];

/// What to do about a formula that is too deep.
const REMEDY: &str = "name parts of it under [dynamics.let]";

impl<'a> Parser<'a> {
    /// Reads everything that binds at least as strongly as `least`.
    fn infix(&mut self, least: u8) -> Result<Term, FormulaError> {
        if self.depth == FORMULA_NESTING {
            return Err(self.error_here(format!(
                "is nested in more than {FORMULA_NESTING} parentheses, calls, signs or powers; {REMEDY}"
            )));
        }
        self.depth += 1;
        let term = self.climb(least);
        self.depth -= 1;
        term
    }

    /// Precedence climbing. Operators of one precedence are read from the left, except powers.
    fn climb(&mut self, least: u8) -> Result<Term, FormulaError> {
        let mut left = self.prefix()?;
        while let Some(&(spelling, infix, precedence)) = self.peek_infix() {
            if precedence < least {
                break;
            }
            if self.rest().starts_with("**") {
                return Err(self.error_here("powers are written `^`".into()));
            }
            self.at += spelling.len();
            let right = self.infix(precedence + u8::from(precedence != POWER))?;
            let span = left.span.start..right.span.end;
            left = self.term(Kind::Infix(infix, Box::new(left), Box::new(right)), span)?;
        }
        Ok(left)
    }

    fn prefix(&mut self) -> Result<Term, FormulaError> {
        self.skip_space();
        let start = self.at;
        if self.eat('-') {
            let inner = self.infix(SIGN)?;
            let span = start..inner.span.end;
            return self.term(Kind::Negate(Box::new(inner)), span);
        }
        if self.eat('+') {
            return self.infix(SIGN);
        }
        self.atom()
    }

    fn atom(&mut self) -> Result<Term, FormulaError> {
        match self.rest().chars().next() {
            Some('(') => self.parenthesis(),
            Some(c) if c.is_ascii_digit() || c == '.' => self.number(),
            Some(c) if c.is_alphabetic() || c == '_' => self.name_or_call(),
            Some(c) => {
                Err(self.error_here(format!("expected a number, a name or `(`, found `{c}`")))
            }
            None if self.text.trim().is_empty() => {
                Err(self.error_here("the formula is empty".into()))
            }
            None => Err(self.error_here("the formula ends where a value is expected".into())),
        }
    }

    fn parenthesis(&mut self) -> Result<Term, FormulaError> {
        let open = self.at;
        self.at += 1;
        let inner = self.infix(0)?;
        self.skip_space();
        if !self.eat(')') {
            return Err(self.unclosed(open, "an operator"));
        }
        Ok(Term {
            span: open..self.at,
            ..inner
        })
    }

    fn number(&mut self) -> Result<Term, FormulaError> {
        let start = self.at;
        self.eat_digits();
        if self.eat('.') {
            self.eat_digits();
        }
        if self.rest().starts_with(['e', 'E']) {
            self.at += 1;
            if self.rest().starts_with(['+', '-']) {
                self.at += 1;
            }
            self.eat_digits();
        }
        let span = start..self.at;
        let written = &self.text[span.clone()];
        match written.parse() {
            Ok(value) if f64::is_finite(value) => self.term(Kind::Number(value), span),
            _ => Err(self.error_at(span, format!("`{written}` is not a number"))),
        }
    }

    fn name_or_call(&mut self) -> Result<Term, FormulaError> {
        let start = self.at;
        let is_name = |c: char| c.is_alphanumeric() || c == '_';
        self.at += self
            .rest()
            .find(|c| !is_name(c))
            .unwrap_or(self.rest().len());
        let name = &self.text[start..self.at];
        self.skip_space();
        if self.rest().starts_with('(') {
            return self.call(name, start);
        }
        let span = start..start + name.len();
        self.term(Kind::Name(name.to_owned()), span)
    }

    fn call(&mut self, name: &str, start: usize) -> Result<Term, FormulaError> {
        let name_span = start..start + name.len();
        let Some(function) = Function::find(name) else {
            let near = super::error::suggestion(name, FUNCTIONS.iter().map(|(n, _)| *n));
            return Err(self.error_at(name_span, format!("unknown function `{name}`{near}")));
        };
        let arguments = self.arguments()?;
        let wanted = function.arguments();
        if arguments.len() != wanted.len() {
            let usage = wanted.join(", ");
            let found = arguments.len();
            return Err(self.error_at(
                start..self.at,
                format!(
                    "`{name}({usage})` takes {} arguments, found {found}",
                    wanted.len()
                ),
            ));
        }
        self.term(Kind::Call(function, arguments), start..self.at)
    }

    fn arguments(&mut self) -> Result<Vec<Term>, FormulaError> {
        let open = self.at;
        self.at += 1;
        let mut arguments = vec![self.infix(0)?];
        loop {
            self.skip_space();
            if self.eat(')') {
                return Ok(arguments);
            }
            if !self.eat(',') {
                return Err(self.unclosed(open, "an operator or `,`"));
            }
            arguments.push(self.infix(0)?);
        }
    }

    /// A term that was read.
    fn term(&mut self, kind: Kind, span: Range<usize>) -> Result<Term, FormulaError> {
        self.terms += 1;
        let of_operands = kind.operands().into_iter().map(|operand| operand.height);
        let height = of_operands.max().unwrap_or(0) + 1;
        if height > FORMULA_CHAIN {
            let message = format!("more than {FORMULA_CHAIN} operations in a row; {REMEDY}");
            return Err(self.error_at(span, message));
        }
        Ok(Term { kind, span, height })
    }

    fn peek_infix(&mut self) -> Option<&'static (&'static str, Infix, u8)> {
        self.skip_space();
        INFIX.iter().find(|entry| self.rest().starts_with(entry.0))
    }

    fn rest(&self) -> &'a str {
        &self.text[self.at..]
    }

    fn skip_space(&mut self) {
        self.at = self.text.len() - self.rest().trim_start().len();
    }

    fn eat(&mut self, c: char) -> bool {
        let found = self.rest().starts_with(c);
        if found {
            self.at += c.len_utf8();
        }
        found
    }

    fn eat_digits(&mut self) {
        let rest = self.rest();
        self.at += rest
            .find(|c: char| !c.is_ascii_digit())
            .unwrap_or(rest.len());
    }

    fn next_char_text(&self) -> String {
        self.rest().chars().take(1).collect()
    }

    fn error_here(&self, message: String) -> FormulaError {
        let width = self.rest().chars().next().map_or(0, char::len_utf8);
        self.error_at(self.at..self.at + width, message)
    }

    /// The error when a whole term in a parenthesis opened at `open` is followed by neither `wanted` nor `)`.
    fn unclosed(&self, open: usize, wanted: &str) -> FormulaError {
        match self.rest().chars().next() {
            Some(found) => self.error_here(format!("expected {wanted}, or `)`, found `{found}`")),
            None => self.error_at(open..open + 1, "this `(` is never closed".into()),
        }
    }

    fn error_at(&self, span: Range<usize>, message: String) -> FormulaError {
        FormulaError::new(self.text, span, message)
    }
}

#[cfg(test)]
mod tests {
    use super::{parse, parse_finite};

    fn message(text: &str) -> String {
        parse(text).unwrap_err().to_string()
    }

    #[test]
    fn a_comparison_holds_by_a_margin() {
        let margin = |text: &str| parse(text).unwrap().margin();
        for text in ["a > b", "a >= b", "b < a", "b <= a"] {
            assert_eq!(margin(text).unwrap().names(), ["a", "b"], "{text}");
        }
        assert_eq!(margin("a - b"), None);
    }

    #[test]
    fn parts_that_are_no_finite_numbers_are_pointed_at() {
        let message_of = |text: &str| parse_finite(text).unwrap_err().to_string();
        assert_eq!(
            message_of("a + 1e200 * 1e200"),
            "this is inf, not a finite number\n    a + 1e200 * 1e200\n        ^^^^^^^^^^^^^"
        );
        assert!(message_of("log(1 - 1) * a").starts_with("this is -inf"));
        for zero in [
            "a / (2 - 2)",
            "a / (b * 0)",
            "a / where(1 > 2, 3, clamp(-1, 0, 1))",
        ] {
            assert!(
                message_of(zero).starts_with("this divides by zero"),
                "{zero}"
            );
        }
        assert!(parse("a / 0").is_ok() && parse_finite("a / 2").is_ok());
    }

    #[test]
    fn errors_point_at_the_place() {
        assert_eq!(
            message("C_g * sinn(q1)"),
            "unknown function `sinn`; did you mean `sin`?\n    C_g * sinn(q1)\n          ^^^^"
        );
        assert_eq!(
            message("2 * (a + b"),
            "this `(` is never closed\n    2 * (a + b\n        ^"
        );
        assert_eq!(
            message("a * (2 b)"),
            "expected an operator, or `)`, found `b`\n    a * (2 b)\n           ^"
        );
        assert_eq!(
            message("clamp(x, 1)"),
            "`clamp(x, low, high)` takes 3 arguments, found 2\n    clamp(x, 1)\n    ^^^^^^^^^^^"
        );
        assert!(message("a +").starts_with("the formula ends where a value is expected"));
        assert!(message("  ").starts_with("the formula is empty"));
        assert!(message("a b").starts_with("expected an operator, found `b`"));
        assert!(message("a ** 2").starts_with("powers are written `^`"));
        assert!(message("1.2.3 + a").starts_with("expected an operator, found `.`"));
        assert!(message("1e999 * a").starts_with("`1e999` is not a number"));
    }

    #[test]
    fn formulas_are_as_deep_as_their_readers_can_go() {
        let of = |open: &str, close: &str, times| {
            format!("{}a{}", open.repeat(times), close.repeat(times))
        };
        for (open, close) in [("(", ")"), ("-", ""), ("+", ""), ("sin(", ")"), ("a^", "")] {
            assert!(parse(&of(open, close, 199)).is_ok(), "{open}");
            for times in [200, 300_000] {
                let message = message(&of(open, close, times));
                assert!(message.contains("more than 200 parentheses"), "{message}");
                assert!(message.len() < 400, "{message}");
            }
        }
        for operation in ["a+", "a*", "a<"] {
            assert_eq!(parse(&of(operation, "", 999)).unwrap().terms(), 1999);
            let message = message(&of(operation, "", 300_000));
            assert!(message.contains("more than 1000 operations"), "{message}");
        }
    }
}
