use std::path::Path;

use super::effect::{Effect, Entry, Measure};
use super::reader::Located;
use super::{Dynamics, Parameter};
use crate::data::{Columns, Log};
use crate::expr::{Formula, Graph, Node, Scope, SignForm};

/// How a model file states the motion.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Motion {
    /// qdd = ..., one formula a joint.
    Accelerations(Vec<Located<Formula>>),
    /// mass(q) qdd + bias(q, qd) = tau.
    MassAndBias {
        mass: Vec<Vec<Located<Formula>>>,
        bias: Vec<Located<Formula>>,
    },
}

/// The balance of energy and work: d(total)/dt = power along every motion.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Energy {
    pub total: Located<Formula>,
    pub power: Located<Formula>,
}

/// An effect that a model file already carries.
#[derive(Debug, Clone, PartialEq)]
pub struct FittedEffect {
    pub effect: Effect,
    /// Counted from 0.
    pub joint: usize,
    /// One for each of the effect's parameters: value and 95 % interval.
    pub values: Vec<(f64, Option<[f64; 2]>)>,
    /// Values that single logs have of their own; where there is none, that of `values` holds.
    pub own: Vec<OwnValue>,
    /// Held at the values given.
    pub fixed: bool,
}

/// The value that a parameter of an effect has in one log.
#[derive(Debug, Clone, PartialEq)]
pub struct OwnValue {
    /// The log's path or name.
    pub log: String,
    /// Index into the effect's parameters.
    pub parameter: usize,
    pub value: f64,
    pub ci95: Option<[f64; 2]>,
}

impl OwnValue {
    /// The log's file name.
    pub fn log_name(&self) -> String {
        let name = Path::new(&self.log).file_name();
        name.map_or_else(
            || self.log.clone(),
            |name| name.to_string_lossy().into_owned(),
        )
    }
}

/// Put what a log has of its own into the `values` of all parameters: `declared` ones, then those of the effects.
pub fn put_own(values: &mut [f64], declared: usize, effects: &[FittedEffect], log: &Log) {
    let mut first = declared;
    for effect in effects {
        for own in effect.own.iter().filter(|own| log.is_called(&own.log)) {
            values[first + own.parameter] = own.value;
        }
        first += effect.values.len();
    }
}

/// A declared model: what a model file says, checked.
#[derive(Debug, Clone)]
pub struct System {
    pub name: String,
    pub about: String,
    pub joints: usize,
    /// For each joint whether it slides (m, N) rather than turns (rad, N m).
    pub prismatic: Vec<bool>,
    /// For each joint the speed (rad/s or m/s) over which dry friction reverses; where the file gives none,
    /// fits choose it by the speeds in the logs.
    pub sign_width: Option<Vec<f64>>,
    pub columns: Columns,
    pub parameters: Vec<Parameter>,
    pub effects: Vec<FittedEffect>,
    /// Widths of the hidden layers of the residual MLP.
    pub hidden: Vec<usize>,
    /// The text of the file.
    pub text: String,
    /// The text of the declared part of the file: everything before the first effect.
    pub declaration: String,
    pub(super) lets: Vec<(String, Located<Formula>)>,
    pub(super) motion: Motion,
    pub(super) energy: Option<Energy>,
}

impl System {
    /// Names that effects must not take: of parameters and of intermediates.
    pub(super) fn own_names(&self) -> impl Iterator<Item = &str> {
        let lets = self.lets.iter().map(|(name, _)| name.as_str());
        self.parameters.iter().map(|p| p.name.as_str()).chain(lets)
    }

    /// The names that formulas may use before any `let`: states, torques, time, parameters.
    pub fn input_names(&self) -> Vec<String> {
        let numbered = |stem: &str| {
            (1..=self.joints)
                .map(move |j| format!("{stem}{j}"))
                .collect::<Vec<_>>()
        };
        let mut names = [numbered("q"), numbered("qd"), numbered("tau")].concat();
        names.push("t".into());
        names.extend(self.parameters.iter().map(|p| p.name.clone()));
        names
    }

    /// All parameters of `dynamics`, of this model or of one with a network on top, as they are in a log.
    pub fn values_in(&self, dynamics: &Dynamics, log: &Log) -> Vec<f64> {
        let mut values = dynamics.values();
        put_own(&mut values, self.parameters.len(), &self.effects, log);
        values
    }

    /// How dry friction is written in each joint: as the file says, else in the default width.
    pub fn sign(&self) -> Vec<SignForm> {
        let width = |width: &f64| SignForm::Smooth { width: *width };
        let given = self.sign_width.as_ref();
        given.map_or(vec![SignForm::DEFAULT; self.joints], |widths| {
            widths.iter().map(width).collect()
        })
    }

    /// Whether an effect can act on a joint (counted from 0) of this system.
    ///
    /// # Errors
    /// Why not.
    pub fn can_carry(&self, effect: &Effect, joint: usize) -> Result<(), String> {
        let name = &effect.name;
        if effect.first_joint_only && (joint > 0 || self.prismatic[joint]) {
            return Err(format!(
                "`{name}` acts on the first joint, where that turns"
            ));
        }
        match effect.entry {
            Entry::Inertia(_) if !self.has_mass_matrix() => Err(format!(
                "`{name}` needs a model that gives `mass` and `bias`; {} gives accelerations",
                self.name
            )),
            _ => Ok(()),
        }
    }

    /// Whether an effect with its values can join `present` ones.
    ///
    /// # Errors
    /// Why not: see [`System::can_carry`], a value outside of its bounds, or the same effect twice.
    pub fn check_effect(&self, new: &FittedEffect, present: &[FittedEffect]) -> Result<(), String> {
        let name = &new.effect.name;
        self.can_carry(&new.effect, new.joint)?;
        let mut others = present.iter();
        if let Some(old) = others.find(|old| old.excludes(new)) {
            return Err(format!(
                "`{}` acts on joint {} already",
                old.effect.name,
                new.joint + 1
            ));
        }
        let common = (0..).zip(new.values.iter().map(|(value, _)| value));
        let own = new.own.iter().map(|own| (own.parameter, &own.value));
        for (k, value) in common.chain(own) {
            let parameter = &new.effect.parameters[k];
            let [low, high] = parameter.bounds;
            // Bounds that are multiples of what logs show cannot be checked before there are logs.
            if parameter.measure == Measure::One && !(low..=high).contains(value) {
                return Err(format!(
                    "`{name}`: {} = {value} lies outside of {low} to {high}",
                    parameter.name
                ));
            }
        }
        Ok(())
    }

    /// Whether the file gives mass matrix and bias, which effects of the inertia need.
    pub fn has_mass_matrix(&self) -> bool {
        matches!(self.motion, Motion::MassAndBias { .. })
    }

    /// Total energy and the power of the torques as a program of [`System::input_names`], where the file
    /// states them: `[total, power, d total/dq.., d total/dqd..]`.
    pub fn energy_program(&self) -> Option<crate::expr::Program> {
        let energy = self.energy.as_ref()?;
        let mut graph = Graph::new();
        let mut scope = Scope::new(SignForm::Exact);
        let inputs: Vec<Node> = self
            .input_names()
            .iter()
            .map(|name| graph.input(name))
            .collect();
        for (name, node) in self.input_names().iter().zip(&inputs) {
            scope.bind(name, *node);
        }
        let mut lower = |scope: &Scope, formula: &Located<Formula>| {
            scope
                .lower(&mut graph, &formula.value)
                .expect("formulas were checked when the file was read")
        };
        for (name, formula) in &self.lets {
            let node = lower(&scope, formula);
            scope.bind(name, node);
        }
        let (total, power) = (lower(&scope, &energy.total), lower(&scope, &energy.power));
        let one = graph.constant(1.0);
        let slopes = graph.gradient(&[total], &[one], &inputs[..2 * self.joints]);
        Some(graph.finish(&[&[total, power], slopes.as_slice()].concat()))
    }
}

impl Motion {
    pub(super) fn formulas(&self) -> Box<dyn Iterator<Item = &Located<Formula>> + '_> {
        match self {
            Self::Accelerations(formulas) => Box::new(formulas.iter()),
            Self::MassAndBias { mass, bias } => Box::new(mass.iter().flatten().chain(bias)),
        }
    }
}
