use serde::{Deserialize, Serialize};

use crate::data::Joint;

/// How a command is filtered; each kind has one parameter, in s. At zero both leave the command as it is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum CommandFilter {
    /// tau(t) -> tau(t - d)
    Delay,
    /// T dtau/dt + tau = commanded
    Lag,
}

impl CommandFilter {
    /// The filter of `tau` with its `parameter`, as text.
    pub fn expression(self, tau: &str, parameter: &str) -> String {
        match self {
            Self::Delay => format!("{tau}(t - {parameter})"),
            Self::Lag => format!("{parameter} * d({tau})/dt + {tau} = commanded"),
        }
    }

    /// The same in LaTeX.
    pub fn latex(self, tau: &str, parameter: &str) -> String {
        match self {
            Self::Delay => format!("{tau}\\left(t - {parameter}\\right)"),
            Self::Lag => format!("{parameter} \\,\\dot{{{tau}}} + {tau} = \\text{{commanded}}"),
        }
    }
}

/// A filter of one joint's commanded torque.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Filter {
    pub joint: Joint,
    pub kind: CommandFilter,
    /// Index into the model's parameters.
    pub parameter: usize,
}
