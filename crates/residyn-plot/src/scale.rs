//! Scales: from numbers to pixels, and to the numbers on an axis.

use residyn_core::data::statistics::quantile;

/// An axis ends here, so that its width stays finite.
const FARTHEST: f64 = 1e300;
/// A logarithmic axis spans at most from the inverse of this power of ten to the power itself.
const FARTHEST_DECADE: f64 = 300.0;

/// A part of the number line that has a width.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Range {
    pub lo: f64,
    pub hi: f64,
}

impl Range {
    /// From the lowest to the highest finite value; none if no value is finite.
    pub fn spanning(values: impl IntoIterator<Item = f64>) -> Option<Self> {
        values.into_iter().filter(|value| value.is_finite()).fold(
            None,
            |found: Option<Self>, value| {
                let Self { lo, hi } = found.unwrap_or(Self {
                    lo: value,
                    hi: value,
                });
                Some(Self {
                    lo: lo.min(value),
                    hi: hi.max(value),
                })
            },
        )
    }

    /// From one quantile of the finite values to another.
    pub fn between_quantiles(
        values: impl Iterator<Item = f64>,
        low: f64,
        high: f64,
    ) -> Option<Self> {
        let finite: Vec<f64> = values.filter(|value| value.is_finite()).collect();
        (!finite.is_empty()).then(|| Self {
            lo: quantile(&finite, low),
            hi: quantile(&finite, high),
        })
    }

    pub fn union(self, other: Self) -> Self {
        Self {
            lo: self.lo.min(other.lo),
            hi: self.hi.max(other.hi),
        }
    }

    pub fn intersection(self, other: Self) -> Self {
        Self {
            lo: self.lo.max(other.lo),
            hi: self.hi.min(other.hi),
        }
    }

    pub fn width(self) -> f64 {
        self.hi - self.lo
    }

    pub fn contains(self, value: f64) -> bool {
        (self.lo..=self.hi).contains(&value)
    }

    /// Widened by a share of the width at both ends.
    pub fn widened(self, share: f64) -> Self {
        let margin = share * self.width();
        Self {
            lo: self.lo - margin,
            hi: self.hi + margin,
        }
    }

    /// A range that an axis can show: a range whose width is zero or lost in rounding is widened around its value.
    pub fn drawable(self) -> Self {
        let [lo, hi] = [self.lo, self.hi].map(|end| end.clamp(-FARTHEST, FARTHEST));
        let size = lo.abs().max(hi.abs());
        if hi - lo > 1e-9 * size {
            return Self { lo, hi };
        }
        let reach = if size > 0.0 { 0.1 * size } else { 1.0 };
        Self {
            lo: lo - reach,
            hi: hi + reach,
        }
    }
}

/// How values are laid out along an axis.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Scale {
    /// Equal steps for equal differences.
    Linear,
    /// Equal steps for equal ratios; shows only values above zero.
    Logarithmic,
}

impl Scale {
    /// The number that a value's place is proportional to.
    pub(crate) fn forward(self, value: f64) -> f64 {
        match self {
            Self::Linear => value,
            Self::Logarithmic => value.log10(),
        }
    }

    fn back(self, place: f64) -> f64 {
        match self {
            Self::Linear => place,
            Self::Logarithmic => 10_f64.powf(place.clamp(-FARTHEST_DECADE, FARTHEST_DECADE)),
        }
    }

    /// Whether a value has a place.
    pub(crate) fn shows(self, value: f64) -> bool {
        self.forward(value).is_finite()
    }

    /// The places between which a range lies.
    pub(crate) fn stretched(self, Range { lo, hi }: Range) -> Range {
        Range {
            lo: self.forward(lo),
            hi: self.forward(hi),
        }
    }

    /// A range widened by a share of its length on the axis at both ends.
    pub(crate) fn widened(self, range: Range, share: f64) -> Range {
        let Range { lo, hi } = self.stretched(range).widened(share);
        Range {
            lo: self.back(lo),
            hi: self.back(hi),
        }
    }

    pub(crate) fn ticks(self, range: Range, wanted: usize) -> Ticks {
        match self {
            Self::Linear => Ticks::new(range, wanted),
            Self::Logarithmic => Ticks::logarithmic(range, wanted),
        }
    }
}

/// Where an axis has its marks, and their labels.
pub(crate) struct Ticks {
    pub values: Vec<f64>,
    pub labels: Vec<String>,
    /// The labels count in this power of ten.
    pub exponent: i32,
}

impl Ticks {
    /// About `wanted` marks at multiples of 1, 2 or 5 times a power of ten.
    pub fn new(range: Range, wanted: usize) -> Self {
        let step = round_step(range.width() / wanted.max(1) as f64);
        let (first, last) = ((range.lo / step).ceil(), (range.hi / step).floor());
        let count = (last - first).clamp(-1.0, 100.0) as i32 + 1;
        // A whole number times the step: adding up the step would accumulate rounding errors.
        let values: Vec<f64> = (0..count).map(|i| (first + f64::from(i)) * step).collect();
        let exponent = axis_exponent(&values);
        let unit = 10_f64.powi(exponent);
        let decimals = decimals_of(step / unit);
        let labels = values
            .iter()
            .map(|value| number(value / unit, decimals))
            .collect();
        Self {
            values,
            labels,
            exponent,
        }
    }

    /// At most `wanted` marks at 1, 2 and 5 times the powers of ten, or at powers of ten alone. A range that holds
    /// fewer than two marks gets those of a linear axis.
    fn logarithmic(range: Range, wanted: usize) -> Self {
        let Range { lo, hi } = Scale::Logarithmic.stretched(range);
        let decades = lo.floor() as i32..=hi.floor() as i32;
        let stride = (hi - lo) as i32 / wanted.max(1) as i32 + 1;
        let fine = marks(range, decades.clone(), &[1.0, 2.0, 5.0]);
        let values = if fine.len() <= wanted {
            fine
        } else {
            marks(range, decades.filter(|decade| decade % stride == 0), &[1.0])
        };
        if values.len() < 2 {
            return Self::new(range, wanted);
        }
        let labels = values.iter().map(|value| power_number(*value)).collect();
        Self {
            values,
            labels,
            exponent: 0,
        }
    }
}

/// The products of factors and powers of ten that lie in a range.
fn marks(range: Range, exponents: impl Iterator<Item = i32>, factors: &[f64]) -> Vec<f64> {
    let products = exponents.flat_map(|exponent| {
        let power = 10_f64.powi(exponent);
        factors.iter().map(move |factor| factor * power)
    });
    products.filter(|value| range.contains(*value)).collect()
}

/// The nearest of 1, 2 and 5 times a power of ten, by ratio.
fn round_step(raw: f64) -> f64 {
    let power = 10_f64.powf(raw.log10().floor());
    let factor = match raw / power {
        ratio if ratio < 2_f64.sqrt() => 1.0,
        ratio if ratio < 10_f64.sqrt() => 2.0,
        ratio if ratio < 50_f64.sqrt() => 5.0,
        _ => 10.0,
    };
    factor * power
}

/// A multiple of three, other than zero only where plain numbers would be long.
fn axis_exponent(values: &[f64]) -> i32 {
    let largest = values
        .iter()
        .fold(0.0_f64, |size, value| size.max(value.abs()));
    if largest == 0.0 || (0.01..1e5).contains(&largest) {
        return 0;
    }
    3 * (largest.log10() / 3.0 + 1e-9).floor() as i32
}

fn decimals_of(step: f64) -> usize {
    (-(step.log10() + 1e-9).floor()).clamp(0.0, 12.0) as usize
}

/// A number with fixed decimals and a true minus sign.
fn number(value: f64, decimals: usize) -> String {
    let text = format!("{:.decimals$}", value.abs());
    let is_zero = text.bytes().all(|byte| matches!(byte, b'0' | b'.'));
    if value < 0.0 && !is_zero {
        format!("\u{2212}{text}")
    } else {
        text
    }
}

/// A number with three significant digits.
pub(crate) fn three_digits(value: f64) -> String {
    if value == 0.0 {
        return "0".to_owned();
    }
    let magnitude = value.abs().log10().floor();
    if (-4.0..6.0).contains(&magnitude) {
        return number(value, (2.0 - magnitude).max(0.0) as usize);
    }
    let power = superscript(magnitude as i32);
    format!(
        "{}\u{b7}10{power}",
        number(value / 10_f64.powf(magnitude), 2)
    )
}

/// One digit and a power of ten, written out where that is short.
fn power_number(value: f64) -> String {
    let magnitude = (value.log10() + 1e-9).floor();
    if (-3.0..6.0).contains(&magnitude) {
        return number(value, (-magnitude).max(0.0) as usize);
    }
    let power = superscript(magnitude as i32);
    match number(value / 10_f64.powf(magnitude), 0).as_str() {
        "1" => format!("10{power}"),
        factor => format!("{factor}\u{b7}10{power}"),
    }
}

/// A unit counted in a power of ten: `10⁻³ rad`.
pub(crate) fn scaled_unit(unit: &str, exponent: i32) -> String {
    match exponent {
        0 => unit.to_owned(),
        _ => format!("10{} {unit}", superscript(exponent)),
    }
}

fn superscript(exponent: i32) -> String {
    let raised = |digit| match digit {
        '-' => '⁻',
        '1' => '¹',
        '2' => '²',
        '3' => '³',
        '4' => '⁴',
        '5' => '⁵',
        '6' => '⁶',
        '7' => '⁷',
        '8' => '⁸',
        '9' => '⁹',
        _ => '⁰',
    };
    exponent.to_string().chars().map(raised).collect()
}

#[cfg(test)]
mod tests {
    use super::{Range, Scale, Ticks, scaled_unit, three_digits};

    fn ticks(lo: f64, hi: f64, wanted: usize) -> Ticks {
        Ticks::new(Range { lo, hi }, wanted)
    }

    #[test]
    fn labels_are_clean() {
        assert_eq!(
            ticks(0.0, 0.5, 5).labels,
            ["0.0", "0.1", "0.2", "0.3", "0.4", "0.5"]
        );
        assert_eq!(
            ticks(-1.1, 1.1, 4).labels,
            ["−1.0", "−0.5", "0.0", "0.5", "1.0"]
        );
        assert_eq!(ticks(0.0, 10.0, 5).labels, ["0", "2", "4", "6", "8", "10"]);
    }

    #[test]
    fn small_and_large_numbers_move_a_power_into_the_unit() {
        let small = ticks(-0.004, 0.004, 4);
        assert_eq!(small.labels, ["−4", "−2", "0", "2", "4"]);
        assert_eq!(scaled_unit("rad", small.exponent), "10⁻³ rad");
        assert_eq!(ticks(0.0, 3e6, 3).labels, ["0", "1", "2", "3"]);
    }

    #[test]
    fn logarithmic_marks_thin_out() {
        let labels = |lo, hi, wanted| Scale::Logarithmic.ticks(Range { lo, hi }, wanted).labels;
        assert_eq!(labels(25.0, 600.0, 6), ["50", "100", "200", "500"]);
        assert_eq!(labels(25.0, 10_000.0, 6), ["100", "1000", "10000"]);
        assert_eq!(labels(0.5, 2e6, 4), ["1", "100", "10000", "10⁶"]);
        assert_eq!(labels(1e-4, 1e-3, 4), ["10⁻⁴", "2·10⁻⁴", "5·10⁻⁴", "0.001"]);
    }

    #[test]
    fn a_logarithmic_axis_of_less_than_a_step_has_linear_marks() {
        let range = Range {
            lo: 210.0,
            hi: 290.0,
        };
        assert_eq!(
            Scale::Logarithmic.ticks(range, 4).labels,
            ["220", "240", "260", "280"]
        );
    }

    #[test]
    fn equal_ratios_take_equal_room() {
        let range = Range {
            lo: 10.0,
            hi: 1000.0,
        };
        let Range { lo, hi } = Scale::Logarithmic.widened(range, 0.5);
        assert!((lo - 1.0).abs() < 1e-12 && (hi - 1e4).abs() < 1e-8);
        assert!(!Scale::Logarithmic.shows(0.0) && !Scale::Logarithmic.shows(-1.0));
    }

    #[test]
    fn strange_ranges_end() {
        for (lo, hi) in [
            (-f64::MAX, f64::MAX),
            (0.0, 1e-300),
            (1e9, 1e9 + 2.0),
            (1.0, 1.0),
        ] {
            assert!(ticks(lo, hi, 5).values.len() <= 101);
        }
    }

    #[test]
    fn constant_values_get_a_range() {
        for value in [0.0, 3.0, -1e-12, 1e12] {
            let range = Range::spanning([value, f64::NAN]).unwrap().drawable();
            assert!(range.lo < value && value < range.hi);
            assert!(!Ticks::new(range, 5).values.is_empty());
        }
    }

    #[test]
    fn three_significant_digits() {
        let shown: Vec<_> = [0.0, 1234.0, 56.78, 0.012_34, 1.5e9, -2.0]
            .into_iter()
            .map(three_digits)
            .collect();
        assert_eq!(shown, ["0", "1234", "56.8", "0.0123", "1.50·10⁹", "−2.00"]);
    }
}
