/// Exponents of the base units in [`BASE`].
pub(super) type Exponents = [i32; 8];

pub(super) const BASE: [&str; 8] = ["kg", "m", "s", "A", "K", "mol", "cd", "rad"];

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

/// Exponents of a unit such as `N m s^2/rad` or `1/(kg m^2)`; none for one that is not SI.
pub(super) fn exponents(unit: &str) -> Option<Exponents> {
    let mut rest = unit;
    let exponents = product(&mut rest)?;
    rest.is_empty().then_some(exponents)
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
    use super::exponents;

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
            assert_eq!(exponents(unit), Some([kg, m, s, 0, 0, 0, 0, rad]), "{unit}");
        }
    }

    #[test]
    fn other_units_have_no_exponents() {
        for unit in ["furlong", "N m)", "m^x", "(m", ""] {
            assert_eq!(exponents(unit), None, "{unit}");
        }
    }
}
