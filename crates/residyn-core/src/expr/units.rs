//! The units of a formula, derived from those of its names.

use super::FormulaError;
use super::error::shortened;
use super::op::{Binary, Function, Unary};
use super::parse::{Formula, Infix, Kind, Term};
use super::unit::Unit;

impl Formula {
    /// The unit of the formula's value, and every place where units do not fit. `of` is the unit of a name, angles being pure
    /// numbers.
    ///
    /// A unit is `None` if nothing determines it. A number may carry any unit, as lengths do in formulas derived from a
    /// drawing, and so may a product with it. A sum has the unit of the parts that have one.
    pub fn unit(&self, of: &dyn Fn(&str) -> Option<Unit>) -> (Option<Unit>, Vec<FormulaError>) {
        let mut reader = Reader {
            text: &self.text,
            of,
            misfits: Vec::new(),
        };
        let unit = reader.term(&self.root);
        (unit, reader.misfits)
    }
}

struct Reader<'f> {
    text: &'f str,
    of: &'f dyn Fn(&str) -> Option<Unit>,
    misfits: Vec<FormulaError>,
}

impl Reader<'_> {
    fn term(&mut self, term: &Term) -> Option<Unit> {
        match &term.kind {
            Kind::Number(_) => None,
            Kind::Name(name) => (self.of)(name),
            Kind::Negate(inner) => self.term(inner),
            Kind::Infix(infix, a, b) => self.infix(*infix, term, [a, b]),
            Kind::Call(function, arguments) => self.call(*function, term, arguments),
        }
    }

    fn infix(&mut self, infix: Infix, whole: &Term, [a, b]: [&Term; 2]) -> Option<Unit> {
        match infix {
            Infix::Plain(op @ (Binary::Mul | Binary::Div)) => {
                let (a, b) = (self.term(a), self.term(b));
                let combined = if op == Binary::Mul {
                    Unit::times
                } else {
                    Unit::over
                };
                Some(combined(a?, b?))
            }
            Infix::Plain(Binary::Pow) => self.power(whole, a, b),
            Infix::Plain(Binary::Add | Binary::Sub) => self.alike([a, b]),
            // The rest are comparisons.
            _ => {
                self.alike([a, b]);
                Some(Unit::ONE)
            }
        }
    }

    fn call(&mut self, function: Function, call: &Term, arguments: &[Term]) -> Option<Unit> {
        match (function, arguments) {
            (Function::Unary(Unary::Neg | Unary::Abs), [x]) => self.term(x),
            (Function::Unary(Unary::Sqrt), [x]) => self.term(x)?.root(),
            (Function::Unary(_), [x]) => {
                self.pure(x, call);
                Some(Unit::ONE)
            }
            (Function::Sign, [x]) => {
                self.term(x);
                Some(Unit::ONE)
            }
            (Function::Where, [condition, then, otherwise]) => {
                self.term(condition);
                self.alike([then, otherwise])
            }
            (Function::Binary(Binary::Atan2), [y, x]) => {
                self.alike([y, x]);
                Some(Unit::ONE)
            }
            (_, all) => self.alike(all),
        }
    }

    /// The one unit of terms that are added or compared.
    fn alike<'t>(&mut self, terms: impl IntoIterator<Item = &'t Term>) -> Option<Unit> {
        let mut known: Option<(&Term, Unit)> = None;
        for term in terms {
            let Some(unit) = self.term(term) else {
                continue;
            };
            match known {
                None => known = Some((term, unit)),
                Some((first, of_first)) if of_first != unit => {
                    let message = format!(
                        "{} and {} cannot be added or compared",
                        self.with_unit(first, of_first),
                        self.with_unit(term, unit)
                    );
                    self.tell(term, message);
                }
                Some(_) => {}
            }
        }
        known.map(|(_, unit)| unit)
    }

    /// An argument of a function, or an exponent, that must be a pure number or an angle.
    fn pure(&mut self, term: &Term, of: &Term) {
        if let Some(unit) = self.term(term).filter(|unit| *unit != Unit::ONE) {
            let message = format!(
                "{} in `{}` must be a pure number or an angle",
                self.with_unit(term, unit),
                shortened(&self.text[of.span.clone()])
            );
            self.tell(term, message);
        }
    }

    fn power(&mut self, whole: &Term, base: &Term, exponent: &Term) -> Option<Unit> {
        let unit = self.term(base);
        if let Kind::Number(number) = exponent.kind {
            #[allow(clippy::cast_possible_truncation)] // bounded by the guard
            return match number {
                0.5 => unit?.root(),
                whole if whole.fract() == 0.0 && whole.abs() < 100.0 => {
                    Some(unit?.power(whole as i32))
                }
                _ => None,
            };
        }
        self.pure(exponent, whole);
        unit.filter(|unit| *unit == Unit::ONE)
    }

    /// `m*g [N]`, in quotes.
    fn with_unit(&self, term: &Term, unit: Unit) -> String {
        format!("`{}` [{unit}]", shortened(&self.text[term.span.clone()]))
    }

    fn tell(&mut self, at: &Term, message: String) {
        self.misfits
            .push(FormulaError::new(self.text, at.span.clone(), message));
    }
}

#[cfg(test)]
mod tests {
    use super::Unit;
    use crate::expr::parse;

    /// The unit of a formula of a pendulum, and the messages about its misfits.
    fn of(formula: &str) -> (Option<String>, Vec<String>) {
        let unit = |name: &str| match name {
            "m" => Unit::parse("kg"),
            "l" => Unit::parse("m"),
            "g" => Unit::parse("m/s^2"),
            "q1" => Some(Unit::ONE),
            "qd1" => Unit::parse("1/s"),
            _ => None,
        };
        let (unit, misfits) = parse(formula).unwrap().unit(&unit);
        let message = misfits.into_iter().map(|misfit| misfit.message);
        (unit.map(|unit| unit.to_string()), message.collect())
    }

    #[test]
    fn units_follow_from_those_of_the_names() {
        for (formula, unit) in [
            ("m*g*l*sin(q1)", Some("N m")),
            ("-m*l^2*(qd1 + 2*qd1)", Some("N m s")),
            ("sqrt(g/l)", Some("1/s")),
            ("(g/l)^0.5 - qd1", Some("1/s")),
            ("sign(m) + atan2(l, 2*l)", Some("1")),
            ("where(qd1 > 0, l, 3)", Some("m")),
            ("clamp(l, -1, 1) + max(l, l)", Some("m")),
            ("m*unknown + l", Some("m")),
            ("0.36*m", None),
            ("sqrt(m)", None),
            ("exp(q1)^q1", Some("1")),
        ] {
            assert_eq!(of(formula), (unit.map(str::to_owned), vec![]), "{formula}");
        }
    }

    #[test]
    fn what_does_not_fit_is_reported_with_its_units() {
        for (formula, message) in [
            ("m*g*l + m*g", "`m*g*l` [N m] and `m*g` [N] cannot be added"),
            ("sin(l)", "`l` [m] in `sin(l)` must be a pure number"),
            ("2^m", "`m` [kg] in `2^m` must be a pure number"),
            ("clamp(l, -m, m)", "`l` [m] and `-m` [kg] cannot be added"),
            ("where(qd1 > g, 1, 2)", "`qd1` [1/s] and `g` [m/s^2] cannot"),
        ] {
            let (_, misfits) = of(formula);
            assert!(misfits[0].starts_with(message), "{misfits:?}");
        }
    }
}
