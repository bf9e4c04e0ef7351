use std::fmt;

use residyn_core::data::Joint;
use serde::{Serialize, Serializer};

/// What kind of thing has changed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Kind {
    /// A parameter of the model.
    Parameter,
    /// A load at a tip, or a mass that stands for one.
    Payload,
    /// The zero of an encoder.
    EncoderZero,
    /// Something that no hypothesis explains.
    Unexplained,
}

/// By how much something has changed.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Estimate {
    pub value: f64,
    pub ci95: [f64; 2],
    /// Whether both are shares of the declared value; else they are in `unit`.
    pub is_relative: bool,
    pub unit: String,
}

/// One thing that may have changed.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Named {
    pub kind: Kind,
    /// From 1.
    pub joint: Joint,
    /// The parameter, as the model file names it, or `payload`, `encoder zero`, `unexplained`.
    pub name: String,
    /// `None` for something unexplained.
    pub estimate: Option<Estimate>,
    /// Its name in words.
    #[serde(skip)]
    pub what: String,
    /// The joint's name, with its number.
    #[serde(skip)]
    pub label: String,
}

/// Something has changed.
#[derive(Debug, Clone, PartialEq)]
pub struct Alarm {
    /// When it was raised, s.
    pub time_s: f64,
    /// When it began, by the likelihood, s.
    pub since_s: f64,
    /// What explains most, and what explains it as well.
    pub causes: Vec<Named>,
    /// Whether the same was told before, and has changed further since.
    pub is_further: bool,
}

impl Alarm {
    /// What explains most.
    pub fn cause(&self) -> &Named {
        &self.causes[0]
    }
}

impl Serialize for Alarm {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        #[derive(Serialize)]
        struct Told<'a> {
            time_s: f64,
            since_s: f64,
            #[serde(flatten)]
            cause: &'a Named,
            or: &'a [Named],
            is_further: bool,
            message: String,
        }
        let told = Told {
            time_s: self.time_s,
            since_s: self.since_s,
            cause: self.cause(),
            or: &self.causes[1..],
            is_further: self.is_further,
            message: self.to_string(),
        };
        told.serialize(serializer)
    }
}

impl fmt::Display for Alarm {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (at, cause) in self.causes.iter().enumerate() {
            let before = if at > 0 { ", or " } else { "" };
            write!(f, "{before}{cause}")?;
        }
        write!(f, ", since {:.0} s", self.since_s)
    }
}

impl fmt::Display for Named {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self {
            what, name, label, ..
        } = self;
        match (self.kind, &self.estimate) {
            (Kind::Parameter, Some(estimate)) if what == name => {
                write!(f, "{name} of joint {label} {estimate}")
            }
            (Kind::Parameter, Some(estimate)) => {
                write!(f, "{what} of joint {label} ({name}) {estimate}")
            }
            (Kind::Payload, Some(estimate)) => match what == name {
                true => write!(f, "a load at joint {label}, as {name} {estimate}"),
                false => write!(f, "a payload at the link of joint {label}, {estimate}"),
            },
            (Kind::EncoderZero, Some(estimate)) => {
                write!(f, "the zero of joint {label}'s encoder {estimate}")
            }
            _ => write!(f, "something unexplained on joint {label}"),
        }
    }
}

impl fmt::Display for Estimate {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let way = if self.value < 0.0 { "down" } else { "up" };
        let sign = self.value.signum();
        let mut ends = self.ci95.map(|end| end * sign);
        ends.sort_by(f64::total_cmp);
        let [low, high] = ends;
        let value = self.value.abs();
        match self.is_relative {
            true => write!(
                f,
                "{way} by {:.0} % (95 % interval {:.0} to {:.0} %)",
                100.0 * value,
                100.0 * low,
                100.0 * high
            ),
            false => write!(
                f,
                "{way} by {} {} (95 % interval {} to {})",
                shown(value),
                self.unit,
                shown(low),
                shown(high)
            ),
        }
    }
}

/// A number with two digits that count.
fn shown(value: f64) -> String {
    if value == 0.0 || !value.is_finite() {
        return value.to_string();
    }
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // at most 20
    let places = (1.0 - value.abs().log10().floor()).clamp(0.0, 20.0) as usize;
    format!("{value:.places$}")
}
