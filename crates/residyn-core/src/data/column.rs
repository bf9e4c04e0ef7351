//! One column of a file: its name, and the conversion of its numbers to those of a channel.

use std::f64::consts::{PI, TAU};
use std::fmt;

use serde::Serialize;

/// What a channel measures, and with it the units that its columns may have.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Quantity {
    Time,
    Angle,
    Velocity,
    Torque,
    /// Command of a drive that turns it into a torque: a position target, volts, a duty cycle, amperes.
    Command,
    /// Something else that the rig measures: a supply voltage, a temperature.
    Measured,
}

/// A unit and its size in the channel's own unit.
type Unit = (&'static str, f64);

impl Quantity {
    /// The key under `[columns]`, and the stem of the standard names.
    pub const fn key(self) -> &'static str {
        match self {
            Self::Time => "time",
            Self::Angle => "q",
            Self::Velocity => "qd",
            Self::Torque => "tau",
            Self::Command => "cmd",
            Self::Measured => "u",
        }
    }

    /// The units that a column may be in; the first of a kind is the channel's own. Joints that slide have lengths and
    /// forces in place of angles and torques.
    pub const fn units(self) -> &'static [Unit] {
        match self {
            Self::Time => &[("s", 1.0), ("ms", 1e-3), ("us", 1e-6), ("ns", 1e-9)],
            Self::Angle => &[
                ("rad", 1.0),
                ("deg", PI / 180.0),
                ("rev", TAU),
                ("m", 1.0),
                ("mm", 1e-3),
            ],
            Self::Velocity => &[
                ("rad/s", 1.0),
                ("deg/s", PI / 180.0),
                ("rpm", TAU / 60.0),
                ("m/s", 1.0),
                ("mm/s", 1e-3),
            ],
            Self::Torque => &[("N m", 1.0), ("mN m", 1e-3), ("N", 1.0)],
            Self::Command => &[
                ("rad", 1.0),
                ("deg", PI / 180.0),
                ("rev", TAU),
                ("m", 1.0),
                ("mm", 1e-3),
                ("rad/s", 1.0),
                ("rpm", TAU / 60.0),
                ("V", 1.0),
                ("mV", 1e-3),
                ("A", 1.0),
                ("mA", 1e-3),
                ("%", 1e-2),
            ],
            Self::Measured => &[
                ("V", 1.0),
                ("mV", 1e-3),
                ("A", 1.0),
                ("mA", 1e-3),
                ("K", 1.0),
                ("Pa", 1.0),
                ("1", 1.0),
                ("%", 1e-2),
            ],
        }
    }

    /// Size of a unit in the channel's own unit; `None` for a unit of another quantity.
    pub fn size_of(self, unit: &str) -> Option<f64> {
        let units = self.units().iter();
        units
            .clone()
            .find(|(name, _)| *name == unit)
            .map(|(_, size)| *size)
    }
}

/// A column of a log file. Its numbers times [`Column::scale`] are the channel's, in s, rad, rad/s or N m (m, m/s or N
/// for a joint that slides).
#[derive(Debug, Clone, PartialEq)]
pub struct Column {
    /// As the header has it; its number, from 1, in a file without a header. Empty for a joint without a drive.
    pub name: String,
    /// The unit of the file's numbers, one of [`Quantity::units`]; `None` for the channel's own unit.
    pub unit: Option<&'static str>,
    /// A further factor: -1 for an opposite sign, radians per count of an encoder, a gear ratio.
    pub factor: f64,
    /// For an angle: the file wraps it at each full turn, as from -pi to pi. Full turns are then counted.
    pub wrapped: bool,
    /// How long before the times of their rows the values were taken, s: another clock, a bus, a filter. Below zero for
    /// values taken later.
    pub late_s: f64,
}

impl Column {
    /// A column in the channel's own unit.
    pub fn named(name: impl Into<String>) -> Self {
        Self {
            name: name.into(),
            unit: None,
            factor: 1.0,
            wrapped: false,
            late_s: 0.0,
        }
    }

    /// Whether it stands for no column: its joint has no drive.
    pub fn is_none(&self) -> bool {
        self.name.is_empty()
    }

    /// What a number in the file is multiplied by.
    ///
    /// # Panics
    /// When its unit is not one of the quantity's.
    pub fn scale(&self, quantity: Quantity) -> f64 {
        let size = |unit| {
            quantity
                .size_of(unit)
                .expect("the unit is checked where it is read")
        };
        self.factor * self.unit.map_or(1.0, size)
    }
}

impl From<&str> for Column {
    fn from(name: &str) -> Self {
        Self::named(name)
    }
}

impl fmt::Display for Column {
    /// As a model file has it: `"q1"`, or `{ column = "q1", unit = "deg" }`.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self {
            name,
            unit,
            factor,
            wrapped,
            late_s,
        } = self;
        if *self == Self::named(name.as_str()) {
            return write!(f, "{name:?}");
        }
        write!(f, "{{ column = {name:?}")?;
        if let Some(unit) = unit {
            write!(f, ", unit = {unit:?}")?;
        }
        if *factor != 1.0 {
            write!(f, ", factor = {factor}")?;
        }
        if *wrapped {
            write!(f, ", wrapped = true")?;
        }
        if *late_s != 0.0 {
            write!(f, ", late = {late_s}")?;
        }
        write!(f, " }}")
    }
}

/// Unwraps an angle that starts over at each full turn: a step of over half a turn passes the end of the turn, as no
/// joint turns that far from one row to the next. Returns how often it does.
pub(super) fn unwrap(angles: &mut [f64], turn: f64) -> usize {
    let (mut turns, mut passed) = (0.0, 0);
    let mut before = angles.first().copied().unwrap_or(0.0);
    for angle in angles.iter_mut() {
        let whole = ((*angle - before) / turn).round();
        before = *angle;
        turns -= whole;
        passed += usize::from(whole != 0.0);
        *angle += turns * turn;
    }
    passed
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_column_is_shown_as_a_model_file_has_it() {
        assert_eq!(Column::named("q1").to_string(), "\"q1\"");
        let column = Column {
            unit: Some("deg"),
            factor: -0.5,
            wrapped: true,
            late_s: 0.004,
            ..Column::named("a b")
        };
        assert_eq!(
            column.to_string(),
            "{ column = \"a b\", unit = \"deg\", factor = -0.5, wrapped = true, late = 0.004 }"
        );
        let scale = column.scale(Quantity::Angle);
        assert!((scale + PI / 360.0).abs() < 1e-15);
    }

    #[test]
    fn turns_are_counted_both_ways() {
        let angle = |k: i32| 0.01 * f64::from(k * (700 - k)) / 30.0;
        let whole: Vec<f64> = (0..700).map(angle).collect();
        let mut angles: Vec<f64> = whole
            .iter()
            .map(|a| (a + PI).rem_euclid(TAU) - PI)
            .collect();
        assert!(unwrap(&mut angles, TAU) > 8);
        assert!(whole.iter().zip(&angles).all(|(a, b)| (a - b).abs() < 1e-9));
        assert_eq!(unwrap(&mut [], TAU), 0);
    }
}
