//! Statements in a model file that can be read but cannot be meant: one file per kind of finding.

mod inputs;
mod lines;
mod mass;
mod names;
mod power;
mod units;
mod unused;

use std::collections::HashSet;
use std::fmt;

use rand::Rng;
use serde::Serialize;

use super::system::Model;
use crate::layout::hanging;

/// Widest line \[characters\].
const WIDTH: usize = 80;

/// How much a finding matters.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Severity {
    /// Results computed with this model are wrong, or cannot be computed.
    Error,
    /// The file says something that has no consequence, or not the one that it seems to have.
    Warning,
}

/// What a finding is about.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Kind {
    /// A parameter or an intermediate that no equation uses.
    Unused,
    /// A torque or a command that no equation uses.
    Input,
    /// A mass matrix that rigid bodies cannot have.
    Mass,
    /// Coriolis and centrifugal forces that do not belong to the mass matrix.
    Power,
    /// Units that do not fit.
    Units,
    /// A name that hides another one or is easily taken for it.
    Name,
}

/// One plain sentence about a model file.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Finding {
    pub severity: Severity,
    pub kind: Kind,
    /// Its line in the file, counted from 1; `None` if it concerns no single line.
    pub line: Option<usize>,
    pub text: String,
}

/// What was found in a model file.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Check {
    /// The system's name.
    pub name: String,
    pub joints: usize,
    pub parameters: usize,
    /// Errors first, then in the order of the file.
    pub findings: Vec<Finding>,
}

impl Model {
    /// Look for statements in the model's file that cannot be meant. Its mass matrix is checked in states drawn from
    /// `rng`.
    pub fn check(&self, rng: &mut impl Rng) -> Check {
        let mut findings = [
            unused::find(self),
            inputs::find(self),
            mass::find(self, rng),
            power::find(self, rng),
            units::find(self),
            names::find(self),
        ]
        .concat();
        findings.sort_by_key(|finding| (finding.severity, finding.line));
        Check {
            name: self.name.clone(),
            joints: self.joints,
            parameters: self.parameters.len(),
            findings,
        }
    }

    /// Why rigid bodies cannot have its mass matrix, if so: accelerations are then not finite, or not physical.
    pub fn mass_fault(&self) -> Option<String> {
        let found = mass::find(self, &mut crate::rng(0));
        found.into_iter().next().map(|finding| finding.text)
    }

    /// Every name that these formulas mention, themselves or through intermediates.
    fn reached<'m>(&'m self, names: impl IntoIterator<Item = &'m str>) -> HashSet<&'m str> {
        let mut reached: HashSet<&str> = names.into_iter().collect();
        // An intermediate uses only earlier ones.
        for (name, formula) in self.equations.lets.iter().rev() {
            if reached.contains(name.as_str()) {
                reached.extend(formula.value.names());
            }
        }
        reached
    }
}

impl Finding {
    fn new(kind: Kind, line: impl Into<Option<usize>>, text: String) -> Self {
        let severity = match kind {
            Kind::Mass => Severity::Error,
            _ => Severity::Warning,
        };
        Self {
            severity,
            kind,
            line: line.into(),
            text,
        }
    }
}

impl fmt::Display for Finding {
    /// `line 7: no equation uses `m``
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if let Some(line) = self.line {
            write!(f, "line {line}: ")?;
        }
        f.write_str(&self.text)
    }
}

impl fmt::Display for Check {
    /// The model in one line, then the findings; no line is longer than 80 characters, unless a single word is.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self {
            name,
            joints,
            parameters,
            findings,
        } = self;
        writeln!(f, "{name}: {joints} joint(s), {parameters} parameter(s)")?;
        if findings.is_empty() {
            return writeln!(f, "no findings");
        }
        for finding in findings {
            let label = match finding.severity {
                Severity::Error => "error",
                Severity::Warning => "warning",
            };
            f.write_str(&hanging(label, &finding.to_string(), WIDTH))?;
        }
        Ok(())
    }
}
