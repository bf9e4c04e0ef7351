use std::fmt::{self, Display, Formatter};
use std::num::NonZeroU32;
use std::str::FromStr;

use serde::{Deserialize, Serialize};
use thiserror::Error;

use super::scheme::{RK4, SCHEMES, SEMI_IMPLICIT_EULER, Scheme};
use crate::limits::SUBSTEPS;

/// How a step is integrated while its input is held: a scheme, in equal substeps.
///
/// In files `"semi_implicit_euler"` or another scheme's name, or `{ fine = { steps = N } }` for N substeps of the
/// classical Runge-Kutta method, which reach a given error in far fewer evaluations than substeps of order 1.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(try_from = "Form", into = "Form")]
pub struct Integrator {
    scheme: &'static Scheme,
    substeps: NonZeroU32,
}

/// Why an integrator is refused.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub enum IntegratorError {
    /// No scheme has this name.
    #[error(
        "unknown integrator {name:?}; there are {}, and fine:N for N substeps of rk4",
        names()
    )]
    Unknown { name: String },
    /// More substeps than the limit.
    #[error("a step is integrated in at most {SUBSTEPS} substeps, found {found}")]
    TooManySubsteps { found: NonZeroU32 },
}

fn names() -> String {
    SCHEMES.map(|scheme| scheme.name).join(", ")
}

impl Integrator {
    pub const SEMI_IMPLICIT_EULER: Self = Self::of(SEMI_IMPLICIT_EULER);
    pub const RK4: Self = Self::of(RK4);

    /// Whole steps of a scheme.
    pub const fn of(scheme: &'static Scheme) -> Self {
        Self {
            scheme,
            substeps: NonZeroU32::MIN,
        }
    }

    /// Substeps of the classical Runge-Kutta method.
    pub const fn fine(substeps: NonZeroU32) -> Self {
        Self {
            substeps,
            ..Self::RK4
        }
    }

    pub const fn scheme(self) -> &'static Scheme {
        self.scheme
    }

    /// Number of equal parts of a step, integrated one after the other.
    pub const fn substeps(self) -> usize {
        self.substeps.get() as usize
    }

    /// Every scheme, and one in substeps.
    ///
    /// # Panics
    /// Never.
    pub fn each() -> Vec<Self> {
        let substeps = NonZeroU32::new(3).expect("not zero");
        let whole = SCHEMES.into_iter().map(Self::of);
        whole.chain([Self::fine(substeps)]).collect()
    }

    /// Substeps that a user gives, checked against the limit.
    fn checked(substeps: NonZeroU32) -> Result<Self, IntegratorError> {
        match substeps.get() <= SUBSTEPS {
            true => Ok(Self::fine(substeps)),
            false => Err(IntegratorError::TooManySubsteps { found: substeps }),
        }
    }

    fn named(name: &str) -> Result<Self, IntegratorError> {
        let scheme = Scheme::named(name).map(Self::of);
        scheme.ok_or_else(|| IntegratorError::Unknown {
            name: name.to_owned(),
        })
    }
}

impl Default for Integrator {
    fn default() -> Self {
        Self::SEMI_IMPLICIT_EULER
    }
}

/// As written on a command line: a scheme's name, or `fine:N`.
impl FromStr for Integrator {
    type Err = IntegratorError;

    fn from_str(text: &str) -> Result<Self, IntegratorError> {
        let substeps = text.strip_prefix("fine:").and_then(|n| n.parse().ok());
        substeps.map_or_else(|| Self::named(text), Self::checked)
    }
}

impl Display for Integrator {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        match self.substeps.get() {
            1 => f.write_str(self.scheme.name),
            substeps => write!(f, "fine:{substeps}"),
        }
    }
}

/// An integrator as written in files.
#[derive(Serialize, Deserialize)]
#[serde(
    untagged,
    expecting = "an integrator is the name of a scheme, or { fine = { steps = N } } with N of at least 1"
)]
enum Form {
    Name(String),
    Substeps(Fine),
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Fine {
    fine: Steps,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Steps {
    steps: NonZeroU32,
}

impl TryFrom<Form> for Integrator {
    type Error = IntegratorError;

    fn try_from(form: Form) -> Result<Self, IntegratorError> {
        match form {
            Form::Name(name) => Self::named(&name),
            Form::Substeps(Fine { fine }) => Self::checked(fine.steps),
        }
    }
}

impl From<Integrator> for Form {
    fn from(integrator: Integrator) -> Self {
        match integrator.substeps.get() {
            1 => Self::Name(integrator.scheme.name.to_owned()),
            _ => Self::Substeps(Fine {
                fine: Steps {
                    steps: integrator.substeps,
                },
            }),
        }
    }
}

#[cfg(test)]
mod tests {
    use serde_json::{Value, from_value, json, to_value};

    use super::{Integrator, SCHEMES};

    #[test]
    fn files_and_command_lines_name_the_same_integrators() {
        let names = SCHEMES.map(|scheme| (json!(scheme.name), scheme.name.to_owned()));
        let fine = (json!({"fine": {"steps": 20}}), "fine:20".to_owned());
        for (in_files, written) in names.into_iter().chain([fine]) {
            let integrator: Integrator = written.parse().unwrap();
            assert_eq!(integrator.to_string(), written);
            assert_eq!(to_value(integrator).unwrap(), in_files);
            assert_eq!(from_value::<Integrator>(in_files).unwrap(), integrator);
        }
    }

    #[test]
    fn what_is_no_integrator_is_refused_with_what_there_is() {
        let refusal = |value: Value| from_value::<Integrator>(value).unwrap_err().to_string();
        assert!(refusal(json!("rk5")).contains("there are semi_implicit_euler, "));
        for other in [
            json!({"fine": {"steps": 0}}),
            json!({"fine": {"steps": 2, "more": 1}}),
            json!({"coarse": {"steps": 2}}),
            json!(4),
        ] {
            assert!(refusal(other).contains("{ fine = { steps = N } }"));
        }
        for text in ["rk5", "fine:0", "fine:", "fine:2.5"] {
            assert!(text.parse::<Integrator>().is_err(), "{text}");
        }
    }
}
