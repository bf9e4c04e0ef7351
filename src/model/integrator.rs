use std::fmt::{self, Display, Formatter};
use std::num::NonZeroU32;
use std::str::FromStr;

use serde::{Deserialize, Serialize};

/// How ds/dt becomes the next state. The input is held over the step.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Integrator {
    /// Velocity first, then position with the new velocity: v' = v + h f_v, q' = q + h (f_q + h f_v).
    /// Where f_q = v this is q' = q + h v'; whatever else f_q holds is taken at the step's start. Order 1.
    #[default]
    SemiImplicitEuler,
    /// The classical Runge-Kutta method of order 4.
    Rk4,
    /// Equal substeps of [`Integrator::Rk4`], which reach a given error in far fewer evaluations than
    /// substeps of order 1.
    Fine { steps: NonZeroU32 },
}

impl Integrator {
    /// How it is written on a command line.
    const USAGE: &str = "semi_implicit_euler, rk4, or fine:N for N substeps of rk4";

    /// The equal parts of a step that are integrated one after the other.
    pub fn parts(self) -> usize {
        match self {
            Self::SemiImplicitEuler | Self::Rk4 => 1,
            Self::Fine { steps } => steps.get() as usize,
        }
    }
}

impl FromStr for Integrator {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let unknown = || format!("unknown integrator {text:?}; there are {}", Self::USAGE);
        match (text, text.split_once(':')) {
            ("semi_implicit_euler", _) => Ok(Self::SemiImplicitEuler),
            ("rk4", _) => Ok(Self::Rk4),
            (_, Some(("fine", steps))) => {
                let steps = steps.parse().map_err(|_| unknown())?;
                Ok(Self::Fine { steps })
            }
            _ => Err(unknown()),
        }
    }
}

impl Display for Integrator {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        match self {
            Self::SemiImplicitEuler => f.write_str("semi_implicit_euler"),
            Self::Rk4 => f.write_str("rk4"),
            Self::Fine { steps } => write!(f, "fine:{steps}"),
        }
    }
}
