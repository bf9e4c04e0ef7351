//! Effects as part of a model.

use super::Parameter;
use super::assemble::lower;
use super::dynamics::PerLogValue;
use super::effect::{Effect, Entry, Hold, Measure, RATIO};
use super::filter::CommandFilter;
use crate::data::{Joint, Quantity};
use crate::expr::{Graph, Program, Scope, SignForm};

/// How far the name of an effect that was found can be relied on.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Status {
    /// Significant among all candidates, and confirmed on blocks that its size was not fitted to.
    Established,
    /// Lowers the loss on blocks left out of the fit, but is not significant, or not confirmed.
    Supported,
}

impl Status {
    /// As model files and reports write it.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Established => "established",
            Self::Supported => "supported",
        }
    }
}

/// An effect on a joint of a model, with its values.
#[derive(Debug, Clone, PartialEq)]
pub struct FittedEffect {
    pub effect: Effect,
    pub joint: Joint,
    /// One for each of the effect's parameters: value and 95 % interval.
    pub values: Vec<(f64, Option<[f64; 2]>)>,
    /// Per-log values; in all other logs `values` hold.
    pub own: Vec<PerLogValue>,
    /// Held at these values in every fit.
    pub fixed: bool,
    /// How certain it is, if closing the loop found it.
    pub status: Option<Status>,
}

/// A state of an effect as its formula needs it: its name on its joint, and the outputs of the effect's program that are its
/// rate and the ends of its range, if it has them.
pub(super) struct PrintedState {
    pub name: String,
    pub rate: Option<usize>,
    pub ends: Option<[usize; 2]>,
}

impl FittedEffect {
    /// The effect on a joint with all parameters zero.
    pub fn absent(effect: &Effect, joint: Joint) -> Self {
        Self {
            effect: effect.clone(),
            joint,
            values: vec![(0.0, None); effect.parameters.len()],
            own: Vec::new(),
            fixed: false,
            status: None,
        }
    }

    /// The effect on a joint with the typical values of its parameters.
    pub fn typical(effect: &Effect, joint: Joint) -> Self {
        let mut new = Self::absent(effect, joint);
        for (value, parameter) in new.values.iter_mut().zip(&effect.parameters) {
            value.0 = parameter.typical;
        }
        new
    }

    /// The same effect with what the logs need not determine held where fits start; `None` if there is nothing of the kind.
    pub(crate) fn with_unknown_held(&self) -> Option<Self> {
        let effect = self.effect.with_unknown_held()?;
        let held = effect.held()?;
        let mut fitted = self.clone();
        fitted.values[held] = (effect.parameters[held].starts[0], None);
        Some(Self { effect, ..fitted })
    }

    /// By what it multiplies every command, if it is a gain.
    pub(crate) fn gain(&self) -> Option<f64> {
        let values: Vec<f64> = self.values.iter().map(|(value, _)| *value).collect();
        self.effect.gain(&values)
    }

    /// Identifies the effect within a model.
    pub fn label(&self) -> String {
        format!(
            "{} on joint {}",
            self.title(),
            self.place(|joint| joint.to_string())
        )
    }

    /// The name of its joint, or `5 with 6` if it couples two.
    pub fn place(&self, called: impl Fn(Joint) -> String) -> String {
        let joints: Vec<String> = self.joints().into_iter().map(called).collect();
        joints.join(" with ")
    }

    /// The joint that the effect acts on, and the next one if it couples the two.
    pub fn joints(&self) -> Vec<Joint> {
        let next = self.effect.is_coupling().then(|| self.joint.next());
        [self.joint].into_iter().chain(next).collect()
    }

    /// Whether the two cannot act in one model: they are the same effect, filters of one kind on one joint, or
    /// transmissions of one joint.
    pub fn excludes(&self, other: &Self) -> bool {
        let filter = matches!(self.effect.entry, Entry::Command(_));
        let same_filter = filter && self.effect.entry == other.effect.entry;
        let transmissions = self.effect.is_transmission() && other.effect.is_transmission();
        self.is_same(other) || (same_filter || transmissions) && self.joint == other.joint
    }

    /// Whether the two are one effect on one joint, whatever their values.
    pub fn is_same(&self, other: &Self) -> bool {
        self.joint == other.joint
            && self.effect.name == other.effect.name
            && self.shifted() == other.shifted()
    }

    /// Whether the other effect is a special case of this one, on the same joint.
    pub fn contains(&self, other: &Self) -> bool {
        self.joint == other.joint && self.effect.contains.contains(&other.effect.name)
    }

    /// The effect's formula in the names of its joint, which is driven by torques or commands: `-F_c1 * sign(qd1)`; then how
    /// its states move: `-k1 * z1, dz1/dt = qd1, -e1 <= z1 <= e1`.
    pub fn expression(&self, names: &[String], driven_by: Quantity) -> String {
        match self.program(names) {
            Ok(program) => {
                let state = |PrintedState { name, rate, ends }| {
                    let ends = ends.map(|ends| ends.map(|k| program.formula(k)));
                    let within = ends.map(|[low, high]| match rate {
                        Some(_) => format!(", {low} <= {name} <= {high}"),
                        None => format!(", {name} beyond {low} to {high}"),
                    });
                    let rate = rate.map(|k| format!(", d{name}/dt = {}", program.formula(k)));
                    rate.unwrap_or_default() + &within.unwrap_or_default()
                };
                let states = self.printed_states().map(state);
                program.formula(0) + &states.collect::<String>()
            }
            Err(filter) => filter.expression(&self.joint.name(driven_by.key()), &names[0]),
        }
    }

    /// What follows the formula, state by state.
    pub(super) fn printed_states(&self) -> impl Iterator<Item = PrintedState> {
        let states = self.effect.states.iter().enumerate();
        states.map(|(k, state)| PrintedState {
            name: self.joint.name(&state.name),
            rate: state.rate.as_ref().map(|_| 3 * k + 1),
            ends: state.within.as_ref().map(|_| [3 * k + 2, 3 * k + 3]),
        })
    }

    /// The effect's formula as a program, followed by the rate of each of its states and the ends of the state's range,
    /// which are both zero if it has none; or the filter if it is one.
    pub(super) fn program(&self, names: &[String]) -> Result<Program, CommandFilter> {
        let formula = self.effect.entry.formula_or_filter()?;
        let mut graph = Graph::new();
        let mut scope = Scope::new(SignForm::Exact);
        for (parameter, name) in self.effect.parameters.iter().zip(names) {
            let node = graph.input(name);
            scope.bind(&parameter.name, node);
        }
        for name in self.effect.measured() {
            let node = graph.input(name);
            scope.bind(name, node);
        }
        for state in &self.effect.states {
            let node = graph.input(&self.joint.name(&state.name));
            scope.bind(&state.name, node);
        }
        for stem in self.effect.entry.names() {
            let node = match (*stem, scope.get(RATIO)) {
                ("t", _) => graph.input("t"),
                _ if scope.get(stem).is_some() => continue,
                (_, Some(ratio)) if self.effect.is_coupling() => {
                    let [own, next] =
                        [self.joint, self.joint.next()].map(|j| graph.input(&j.name(stem)));
                    let shared = graph.mul(ratio, next);
                    graph.add(own, shared)
                }
                _ => graph.input(&self.joint.name(stem)),
            };
            scope.bind(stem, node);
        }
        let mut outputs = vec![lower(&scope, &mut graph, formula)];
        for state in &self.effect.states {
            let rate = state.rate.as_ref();
            let rate = rate.map(|rate| lower(&scope, &mut graph, rate));
            outputs.push(rate.unwrap_or_else(|| graph.constant(0.0)));
            let ends = state.within.as_ref();
            for end in 0..2 {
                let end = ends.map(|ends| lower(&scope, &mut graph, &ends[end]));
                outputs.push(end.unwrap_or_else(|| graph.constant(0.0)));
            }
        }
        Ok(graph.finish(&outputs))
    }

    /// The names of the effect's parameters on its joint, distinct from names already `taken`.
    pub fn parameter_names(&self, taken: &[&str]) -> Vec<String> {
        let names = self.effect.names();
        names.map(|own| self.name_of(own, taken)).collect()
    }

    /// The names of its states on its joint, distinct from names already `taken`.
    pub(super) fn state_names(&self, taken: &[&str]) -> Vec<String> {
        let states = self.effect.states.iter();
        states.map(|own| self.name_of(&own.name, taken)).collect()
    }

    fn name_of(&self, own: &str, taken: &[&str]) -> String {
        let plain = match self.shifted() {
            Some(_) => format!("{own}_shift"),
            None => self.joint.name(own),
        };
        match taken.contains(&plain.as_str()) {
            true => format!("{}_{plain}", self.effect.name),
            false => plain,
        }
    }

    /// The effect's parameters as those of a model, with names that are not `taken`.
    pub(super) fn parameters(&self, taken: &[&str], prismatic: bool) -> Vec<Parameter> {
        let names = self.parameter_names(taken);
        let declared = self.effect.parameters.iter().zip(&self.values);
        declared
            .zip(names)
            .map(|((parameter, (value, ci95)), name)| Parameter {
                name,
                value: *value,
                unit: unit_on(prismatic, &parameter.unit),
                bounds: match parameter.measure {
                    Measure::One => parameter.bounds,
                    _ => [0.0, f64::INFINITY],
                },
                fixed: self.fixed || parameter.whole || parameter.hold == Hold::Held,
                per_log: parameter.per_log,
                per_group: false,
                ci95: *ci95,
                scale: parameter.typical,
            })
            .collect()
    }
}

/// Effect files give units for joints that turn; on one that slides, N replaces N m and m replaces rad.
pub(super) fn unit_on(prismatic: bool, unit: &str) -> String {
    if prismatic {
        unit.replace("kg m^2", "kg")
            .replace("N m", "N")
            .replace("rad", "m")
    } else {
        unit.to_owned()
    }
}
