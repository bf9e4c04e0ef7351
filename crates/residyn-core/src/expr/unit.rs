use std::fmt;

/// The base units, and the radian, which the FMI standard counts as one.
pub const BASE: [&str; 8] = ["kg", "m", "s", "A", "K", "mol", "cd", "rad"];

/// Exponents of the units in [`BASE`].
type Exponents = [i32; BASE.len()];

/// A unit as a product of powers of the base units.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Unit(Exponents);

/// Derived units by their exponents of kg, m, s and A.
const DERIVED: [(&str, [i32; 4]); 9] = [
    ("N", [1, 1, -2, 0]),
    ("J", [1, 2, -2, 0]),
    ("W", [1, 2, -3, 0]),
    ("Pa", [1, -1, -2, 0]),
    ("Hz", [0, 0, -1, 0]),
    ("C", [0, 0, 1, 1]),
    ("V", [1, 2, -3, -1]),
    ("Ohm", [1, 2, -3, -2]),
    ("1", [0, 0, 0, 0]),
];

/// Units that are easier to read than their base units.
const READABLE: [&str; 9] = ["1", "N", "N m", "W", "V", "V/A", "N m/A", "N m s", "N/m"];

/// Whether a value in this unit is in proportion to the torques that it explains: a mass, an inertia, a friction.
pub fn is_of_torque(unit: &str) -> bool {
    let mass = BASE.iter().position(|base| *base == "kg");
    let exponents = Unit::parse(unit).map(Unit::exponents);
    exponents.zip(mass).is_some_and(|(all, kg)| all[kg] == 1)
}

impl Unit {
    /// The unit of pure numbers.
    pub const ONE: Self = Self([0; BASE.len()]);

    /// A unit such as `N m s^2/rad` or `1/(kg m^2)`; `None` for a unit that is not SI.
    pub fn parse(text: &str) -> Option<Self> {
        let mut rest = text;
        let exponents = product(&mut rest)?;
        rest.is_empty().then_some(Self(exponents))
    }

    /// Exponents of the units in [`BASE`].
    pub fn exponents(self) -> Exponents {
        self.0
    }

    /// The same unit with angles as pure numbers.
    #[must_use]
    pub fn without_angle(self) -> Self {
        let [base @ .., _] = self.0;
        let mut exponents = [0; BASE.len()];
        exponents[..base.len()].copy_from_slice(&base);
        Self(exponents)
    }

    #[must_use]
    pub fn times(self, other: Self) -> Self {
        Self(std::array::from_fn(|k| self.0[k] + other.0[k]))
    }

    #[must_use]
    pub fn over(self, other: Self) -> Self {
        self.times(other.power(-1))
    }

    #[must_use]
    pub fn power(self, exponent: i32) -> Self {
        Self(self.0.map(|e| e * exponent))
    }

    /// The unit whose square this is, if there is one.
    pub fn root(self) -> Option<Self> {
        let is_square = self.0.iter().all(|e| e % 2 == 0);
        is_square.then(|| Self(self.0.map(|e| e / 2)))
    }
}

impl fmt::Display for Unit {
    /// `N m`, `kg m/s^2`, `1/s`
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if let Some(text) = READABLE
            .iter()
            .find(|text| Self::parse(text) == Some(*self))
        {
            return f.write_str(text);
        }
        let power = |(base, e): (&&str, i32)| match e {
            1 => (*base).to_owned(),
            e => format!("{base}^{e}"),
        };
        let factors = || BASE.iter().zip(self.0);
        let above: Vec<String> = factors().filter(|(_, e)| *e > 0).map(power).collect();
        let below = factors().filter(|(_, e)| *e < 0);
        let below = below.map(|(base, e)| format!("/{}", power((base, -e))));
        f.write_str(&if above.is_empty() {
            "1".to_owned()
        } else {
            above.join(" ")
        })?;
        f.write_str(&below.collect::<String>())
    }
}

/// Factors in order, with a slash before each that divides.
fn product(rest: &mut &str) -> Option<Exponents> {
    let mut sum = power(rest)?;
    loop {
        *rest = rest.trim_start_matches([' ', '*']);
        let sign = match rest.chars().next() {
            None | Some(')') => return Some(sum),
            Some('/') => {
                *rest = rest[1..].trim_start();
                -1
            }
            Some(_) => 1,
        };
        let factor = power(rest)?;
        sum = std::array::from_fn(|k| sum[k] + sign * factor[k]);
    }
}

fn power(rest: &mut &str) -> Option<Exponents> {
    let base = match rest.strip_prefix('(') {
        Some(inner) => {
            *rest = inner;
            let inside = product(rest)?;
            *rest = rest.strip_prefix(')')?;
            inside
        }
        None => symbol(take(rest, char::is_alphanumeric))?,
    };
    let Some(after) = rest.strip_prefix('^') else {
        return Some(base);
    };
    *rest = after;
    let exponent: i32 = take(rest, |c| c.is_ascii_digit() || c == '-')
        .parse()
        .ok()?;
    Some(base.map(|e| e * exponent))
}

fn take<'t>(rest: &mut &'t str, of: impl Fn(char) -> bool) -> &'t str {
    let end = rest.find(|c| !of(c)).unwrap_or(rest.len());
    let (taken, after) = rest.split_at(end);
    *rest = after;
    taken
}

fn symbol(name: &str) -> Option<Exponents> {
    if let Some(k) = BASE.iter().position(|base| *base == name) {
        return Some(std::array::from_fn(|i| i32::from(i == k)));
    }
    let (_, [kg, m, s, a]) = DERIVED.iter().find(|(derived, _)| *derived == name)?;
    Some([*kg, *m, *s, *a, 0, 0, 0, 0])
}

#[cfg(test)]
mod tests {
    use super::Unit;

    #[test]
    fn units_reduce_to_base_units() {
        for (unit, [kg, m, s, rad]) in [
            ("1/s^2", [0, 0, -2, 0]),
            ("N m s^2/rad^2", [1, 2, 0, -2]),
            ("1/(kg m^2)", [-1, -2, 0, 0]),
            ("1/(N m)", [-1, -2, 2, 0]),
            ("rad/s", [0, 0, -1, 1]),
            ("1", [0, 0, 0, 0]),
        ] {
            let exponents = Unit::parse(unit).map(Unit::exponents);
            assert_eq!(exponents, Some([kg, m, s, 0, 0, 0, 0, rad]), "{unit}");
        }
    }

    #[test]
    fn other_units_have_no_exponents() {
        for unit in ["furlong", "N m)", "m^x", "(m", ""] {
            assert_eq!(Unit::parse(unit), None, "{unit}");
        }
    }

    #[test]
    fn units_are_written_as_they_are_read() {
        for (unit, text) in [
            ("kg m^2/s^2", "N m"),
            ("N s^2/m", "kg"),
            ("1/(kg m^2)", "1/kg/m^2"),
            ("rad/s", "rad/s"),
            ("V A", "W"),
        ] {
            let unit = Unit::parse(unit).unwrap();
            assert_eq!(unit.to_string(), text);
            assert_eq!(Unit::parse(text), Some(unit));
        }
    }
}
