use std::ops::Range;
use std::sync::Arc;

use super::assemble::lower;
use super::bodies::Bodies;
use super::configuration::{Configuration, Differing};
use super::drive::Drive;
use super::dynamics::{Dynamics, Parameter, PerLogValue};
use super::effect::{ActsOn, Effect, Entry, Measure, Side};
use super::error::ModelError;
use super::fitted::FittedEffect;
use super::input_layout::InputLayout;
use super::measured_in_file::MeasuredQuantity;
use super::reader::Located;
use super::tree::{Body, Recovered};
use crate::data::statistics::mean;
use crate::data::{Columns, Joint, Log, LogError, Quantity, TorqueColumn};
use crate::expr::{Formula, Graph, Node, Scope, SignForm};

/// Speed over which dry friction reverses (rad/s or m/s), unless the file or a fit to logs sets another one.
const DEFAULT_SMOOTHING_VELOCITY: f64 = 0.01;

/// How a model file states the motion.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Motion {
    /// qdd = ..., one formula per joint.
    Accelerations(Vec<Located<Formula>>),
    /// mass(q) qdd + bias(q, qd) = tau.
    MassAndBias {
        mass: Vec<Vec<Located<Formula>>>,
        bias: Vec<Located<Formula>>,
    },
    /// The same, for a chain of bodies.
    Tree(Box<Bodies>),
}

/// The balance of energy and work: d(total)/dt = power along every motion.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Energy {
    pub total: Located<Formula>,
    pub power: Located<Formula>,
}

/// The declared equations of motion, checked. Models that differ in values or effects share them.
#[derive(Debug, Clone)]
pub(super) struct Equations {
    pub lets: Vec<(String, Located<Formula>)>,
    pub motion: Motion,
    pub energy: Option<Energy>,
    /// What turns commands into torques, if commands drive the rig.
    pub drive: Option<Drive>,
}

/// A model: declared equations, effects on their joints, the values of all parameters and the smoothing of friction.
///
/// It is what a model file holds, what a fit returns and what is compiled for everything that runs it: see
/// [`Model::dynamics`].
#[derive(Debug, Clone)]
pub struct Model {
    pub name: String,
    pub about: String,
    pub joints: usize,
    /// Names of the joints in a URDF or on the rig; empty if they have only numbers.
    pub joint_names: Vec<String>,
    /// Groups of joints that are built alike, as the file gives them; `None` if it gives none.
    pub like: Option<Vec<Vec<Joint>>>,
    /// For each joint, whether it slides (m, N) rather than turns (rad, N m).
    pub prismatic: Vec<bool>,
    /// Speed (rad/s or m/s) over which dry friction of each joint reverses, 0 for a jump. `None` if the file sets none:
    /// fits then choose it from the speeds in the logs.
    pub smoothing_velocity: Option<Vec<f64>>,
    pub columns: Columns,
    /// Further measured columns of the logs that formulas may use.
    pub measured: Vec<MeasuredQuantity>,
    pub parameters: Vec<Parameter>,
    /// Fitted values of declared parameters in single logs; in all other logs those of `parameters` hold.
    pub own: Vec<PerLogValue>,
    /// What the file says of some logs only, in its order: of several values for a log, the last one holds.
    pub configurations: Vec<Configuration>,
    pub effects: Vec<FittedEffect>,
    /// Widths of the hidden layers of the residual MLP.
    pub hidden: Vec<usize>,
    /// The side of a transmission on which the sensor of each joint is, if the file says.
    pub sides: Option<Vec<Side>>,
    /// The text of the file.
    pub text: String,
    /// The text of the declared part of the file: everything but the effects.
    pub declaration: String,
    pub(super) equations: Arc<Equations>,
    pub(super) places: Places,
}

/// Where the file has its parameters, its measured columns and its effects, in their order \[bytes\].
#[derive(Debug, Clone)]
pub(super) struct Places {
    pub parameters: Vec<usize>,
    pub measured: Vec<usize>,
    pub effects: Vec<usize>,
}

impl Model {
    /// The log with these columns in memory; `name` is for messages and the report.
    ///
    /// # Errors
    /// Columns that lack a name or a number.
    pub fn log_from_columns(
        &self,
        name: &str,
        columns: impl IntoIterator<Item = (String, Vec<f64>)>,
    ) -> Result<Log, LogError> {
        Log::from_columns(name, columns, Some((self.joints, &self.columns)))
    }

    /// Names that effects must not take: those of parameters and intermediates.
    pub(super) fn own_names(&self) -> impl Iterator<Item = &str> {
        let lets = self.equations.lets.iter().map(|(name, _)| name.as_str());
        self.parameters.iter().map(|p| p.name.as_str()).chain(lets)
    }

    /// A joint's label for users: `2`, or `2 (elbow)` if it has a name.
    pub fn joint_label(&self, joint: Joint) -> String {
        joint.called(self.joint_names.get(joint.index()).map(String::as_str))
    }

    /// The names of the further measured columns, in the order in which programs read them.
    pub fn measured_names(&self) -> impl Iterator<Item = &str> {
        self.measured.iter().map(|quantity| quantity.name.as_str())
    }

    /// The same model, whose effects may read these further measured columns as well, in units that are not known.
    #[must_use]
    pub(crate) fn reading<'n>(&self, columns: impl IntoIterator<Item = &'n str>) -> Self {
        let mut model = self.clone();
        for name in columns {
            if self.measured_names().all(|own| own != name) {
                model.measured.push(MeasuredQuantity {
                    name: name.to_owned(),
                    unit: String::new(),
                });
            }
        }
        model
    }

    /// Refuses a model that reads further measured columns, for what runs it without a log: `what`, such as "an exported
    /// file".
    ///
    /// # Errors
    /// The first column that it reads.
    pub fn runs_without_logs(&self, what: &'static str) -> Result<(), ModelError> {
        match self.measured_names().next() {
            None => Ok(()),
            Some(column) => Err(ModelError::ReadsMeasured {
                model: self.name.clone(),
                column: column.to_owned(),
                what,
            }),
        }
    }

    /// Refuses a model with effects that have states of their own or that reads further measured columns, for what has
    /// neither: `what`, such as "an exported file".
    ///
    /// # Errors
    /// The first column or effect of this kind.
    pub fn stands_alone(&self, what: &'static str) -> Result<(), ModelError> {
        self.runs_without_logs(what)?;
        let mut effects = self.effects.iter();
        match effects.find(|effect| !effect.effect.states.is_empty()) {
            None => Ok(()),
            Some(effect) => Err(ModelError::HasInternalStates {
                model: self.name.clone(),
                effect: effect.label(),
                what,
            }),
        }
    }

    /// Places of the inputs of the model's programs.
    pub(crate) fn layout(&self) -> InputLayout {
        let effects = self.effects.iter();
        InputLayout::of(self.joints)
            .with_internal(effects.map(|effect| effect.effect.states.len()).sum())
            .with_measured(self.measured.len())
    }

    /// The names that formulas of the motion may use before any `let`: states, torques, further measured columns, time,
    /// parameters.
    pub fn input_names(&self) -> Vec<String> {
        self.names_under(Quantity::Torque)
    }

    /// States, torques or commands, further measured columns, time and parameters, in the order of a compiled model's
    /// inputs.
    pub(super) fn names_under(&self, driven_by: Quantity) -> Vec<String> {
        let of_stem = |stem| Joint::all(self.joints).map(move |joint| joint.name(stem));
        let states = ["q", "qd", driven_by.key()].into_iter().flat_map(of_stem);
        let parameters = self.parameters.iter().map(|p| p.name.clone());
        let measured = self.measured_names().map(str::to_owned);
        let moving = states.chain(measured).chain(["t".to_owned()]);
        moving.chain(parameters).collect()
    }

    /// Speed (rad/s or m/s) over which dry friction of each joint reverses, 0 for a jump.
    pub fn smoothing_velocities(&self) -> Vec<f64> {
        let default = || vec![DEFAULT_SMOOTHING_VELOCITY; self.joints];
        self.smoothing_velocity.clone().unwrap_or_else(default)
    }

    /// How dry friction is written in each joint.
    pub(super) fn sign(&self) -> Vec<SignForm> {
        let form = |width: f64| match width {
            0.0 => SignForm::Exact,
            width => SignForm::Smooth { width },
        };
        self.smoothing_velocities().into_iter().map(form).collect()
    }

    /// The same model with these effects in place of its own.
    #[must_use]
    pub fn with_effects(&self, effects: Vec<FittedEffect>) -> Self {
        Self {
            effects,
            ..self.clone()
        }
    }

    /// The same model for logs whose torques are those that a host sent, and so held from their rows on, unless its file says what
    /// they are.
    #[must_use]
    pub fn for_sent_torques(&self) -> Self {
        let mut model = self.clone();
        model.columns.torque.get_or_insert(TorqueColumn::Held);
        model
    }

    /// The same model with dry friction that reverses over these speeds (rad/s or m/s), one per joint; 0 for a jump.
    ///
    /// # Panics
    /// When there is not one width per joint.
    #[must_use]
    pub fn with_smoothing_velocities(&self, widths: Vec<f64>) -> Self {
        assert_eq!(widths.len(), self.joints, "one width for each joint");
        Self {
            smoothing_velocity: Some(widths),
            ..self.clone()
        }
    }

    /// Values of all parameters: the declared ones, then those of the effects, in their order.
    pub fn values(&self) -> Vec<f64> {
        let declared = self.parameters.iter().map(|p| p.value);
        let of_effects = self.effects.iter().flat_map(|effect| &effect.values);
        declared
            .chain(of_effects.map(|(value, _)| *value))
            .collect()
    }

    /// The value of a parameter, by its index among all; with a log, its value there.
    pub fn value_of(&self, parameter: usize, log: Option<&Log>) -> f64 {
        let own = self.per_log_values();
        let differing = Differing {
            configurations: &self.configurations,
            own: &own,
        };
        let of_group = self.parameters.get(parameter).is_some_and(|p| p.per_group);
        let in_log = log.and_then(|log| differing.value(parameter, of_group, log));
        in_log.map_or_else(|| self.values()[parameter], |found| found.value)
    }

    /// Values of the declared parameters in a log.
    pub(super) fn declared_values_in(&self, log: &Log) -> Vec<f64> {
        let differing = self.differing();
        let value = |(k, p): (usize, &Parameter)| {
            let in_log = differing.value(k, p.per_group, log);
            in_log.map_or(p.value, |found| found.value)
        };
        self.parameters.iter().enumerate().map(value).collect()
    }

    /// How declared parameters differ between logs.
    pub(super) fn differing(&self) -> Differing<'_> {
        Differing {
            configurations: &self.configurations,
            own: &self.own,
        }
    }

    /// Whether a declared parameter has other values in some logs.
    pub(super) fn differs(&self, parameter: usize) -> bool {
        let mut given = self.configurations.iter().flat_map(|table| &table.given);
        self.parameters[parameter].per_log || given.any(|(k, _)| *k == parameter)
    }

    /// The patterns of the tables `[logs."pattern"]` that match none of these logs.
    pub fn unmatched<'l>(&self, logs: impl IntoIterator<Item = &'l Log>) -> Vec<&str> {
        let names: Vec<String> = logs.into_iter().map(Log::name).collect();
        let is_of_none = |table: &&Configuration| !names.iter().any(|name| table.is_of(name));
        let unmatched = self.configurations.iter().filter(is_of_none);
        unmatched.map(|table| table.pattern.as_str()).collect()
    }

    /// The same model with the values of its compiled form, per-log values included. Intervals are dropped, since they
    /// belong to other values.
    ///
    /// # Panics
    /// If `compiled` has another number of parameters.
    #[must_use]
    pub fn at(&self, compiled: &Dynamics) -> Self {
        let mut model = self.clone();
        let slots = model.slots();
        assert_eq!(
            slots.len(),
            compiled.parameters.len(),
            "one value for each parameter"
        );
        for ((value, interval), parameter) in slots.into_iter().zip(&compiled.parameters) {
            (*value, *interval) = (parameter.value, None);
        }
        let declared = model.parameters.len();
        let own = compiled.own.iter().filter(|own| own.parameter < declared);
        model.own = own.cloned().collect();
        for (k, parameter) in model.parameters.iter_mut().enumerate() {
            let own = model.own.iter().filter(|own| own.parameter == k);
            let values: Vec<f64> = own.map(|own| own.value).collect();
            if parameter.per_log && !values.is_empty() {
                // The best guess for a log that was not fitted.
                parameter.value = mean(&values);
            }
        }
        for k in 0..model.effects.len() {
            let place = self.place_of(k);
            let of_effect = |own: &&PerLogValue| place.contains(&own.parameter);
            let own = compiled
                .own
                .iter()
                .filter(of_effect)
                .map(|own| PerLogValue {
                    parameter: own.parameter - place.start,
                    ..own.clone()
                });
            model.effects[k].own = own.collect();
        }
        model
    }

    /// Set the interval of a parameter's value, or of its value in one log, by its half width; it is clipped to the
    /// parameter's bounds. Values of an effect that stand on one that no log determines have none.
    pub fn set_half_width(&mut self, parameter: usize, log: Option<&Log>, half: f64) {
        let [low, high] = self.all_parameters()[parameter].bounds;
        let stands_on_held = self
            .placed()
            .any(|(effect, place)| effect.effect.held().is_some() && place.contains(&parameter));
        let around = |value: f64| {
            let interval = [(value - half).max(low), (value + half).min(high)];
            (!stands_on_held).then_some(interval)
        };
        let Some(log) = log else {
            let (value, interval) = self.slots().swap_remove(parameter);
            *interval = around(*value);
            return;
        };
        if let Some(declared) = self.parameters.get(parameter) {
            let (of_group, before) = (declared.per_group, self.own.clone());
            let differing = Differing {
                configurations: &self.configurations,
                own: &before,
            };
            for own in &mut self.own {
                if own.parameter == parameter && differing.holds(own, of_group, log) {
                    own.ci95 = around(own.value);
                }
            }
            return;
        }
        let Some(k) = (0..self.effects.len()).find(|k| self.place_of(*k).contains(&parameter))
        else {
            return;
        };
        let first = self.place_of(k).start;
        let mut own = self.effects[k].own.iter_mut();
        let is_it =
            |own: &&mut PerLogValue| own.parameter == parameter - first && log.is_called(&own.log);
        if let Some(own) = own.find(is_it) {
            own.ci95 = around(own.value);
        }
    }

    /// Value and interval of every parameter.
    fn slots(&mut self) -> Vec<(&mut f64, &mut Option<[f64; 2]>)> {
        let declared = self
            .parameters
            .iter_mut()
            .map(|p| (&mut p.value, &mut p.ci95));
        let of_effects = self
            .effects
            .iter_mut()
            .flat_map(|effect| &mut effect.values);
        declared
            .chain(of_effects.map(|(value, ci95)| (value, ci95)))
            .collect()
    }

    /// Indices of the parameters of the k-th effect among all.
    pub fn place_of(&self, k: usize) -> Range<usize> {
        let before = self.effects[..k].iter().map(|effect| effect.values.len());
        let first = self.parameters.len() + before.sum::<usize>();
        first..first + self.effects[k].values.len()
    }

    /// Each effect with the indices of its parameters among all.
    pub(super) fn placed(&self) -> impl Iterator<Item = (&FittedEffect, Range<usize>)> {
        let places = (0..self.effects.len()).map(|k| self.place_of(k));
        self.effects.iter().zip(places)
    }

    /// Whether an effect can act on a joint of this system.
    ///
    /// # Errors
    /// Why not.
    pub fn can_carry(&self, effect: &Effect, joint: Joint) -> Result<(), ModelError> {
        let name = || effect.name.clone();
        let slides = self.prismatic[joint];
        match effect.acts_on {
            ActsOn::First if slides || !self.is_on_base(joint) => {
                return Err(ModelError::FirstJointOnly { effect: name() });
            }
            ActsOn::Turning if slides => {
                return Err(ModelError::TurningJointsOnly { effect: name() });
            }
            _ => {}
        }
        let mut measured = effect.measured();
        if let Some(column) = measured.find(|name| self.measured_names().all(|own| own != *name)) {
            return Err(ModelError::NotMeasured {
                effect: name(),
                column: column.to_owned(),
            });
        }
        match effect.entry {
            Entry::Payload(_) if !self.carries_at(joint) => {
                Err(ModelError::LastJointOnly { effect: name() })
            }
            Entry::Coupling(_) if !self.couples(joint) => {
                Err(ModelError::NeighboursOfOneKind { effect: name() })
            }
            Entry::Inertia(_) | Entry::Coupling(_) if !self.has_mass_matrix() => {
                Err(ModelError::NeedsMass {
                    effect: name(),
                    model: self.name.clone(),
                })
            }
            _ => Ok(()),
        }
    }

    /// Whether no joint carries this one.
    fn is_on_base(&self, joint: Joint) -> bool {
        match &self.equations.motion {
            Motion::Tree(bodies) => bodies.is_on_base(joint),
            _ => joint.index() == 0,
        }
    }

    /// Whether the joint moves the tip of a tree of bodies.
    fn carries_at(&self, joint: Joint) -> bool {
        matches!(&self.equations.motion, Motion::Tree(bodies) if bodies.is_tip(joint))
    }

    /// Whether a joint carries the next one, as far as the equations say, and both have coordinates of one kind.
    fn couples(&self, joint: Joint) -> bool {
        let next = joint.next();
        let is_carried = match &self.equations.motion {
            Motion::Tree(bodies) => bodies.carries(joint, next),
            _ => next.is_of(self.joints),
        };
        is_carried && self.prismatic[joint] == self.prismatic[next]
    }

    /// Whether an effect with its values can join `present` ones.
    ///
    /// # Errors
    /// Why not: see [`Model::can_carry`], a value outside of its bounds, or the same effect twice.
    pub fn check_effect(
        &self,
        new: &FittedEffect,
        present: &[FittedEffect],
    ) -> Result<(), ModelError> {
        self.can_carry(&new.effect, new.joint)?;
        let mut others = present.iter();
        if let Some(old) = others.find(|old| old.excludes(new)) {
            return Err(ModelError::Twice {
                effect: old.effect.name.clone(),
                joint: new.joint,
            });
        }
        let common = (0..).zip(new.values.iter().map(|(value, _)| value));
        let own = new.own.iter().map(|own| (own.parameter, &own.value));
        for (k, value) in common.chain(own) {
            let parameter = &new.effect.parameters[k];
            let [low, high] = parameter.bounds;
            // Bounds that are multiples of what logs show cannot be checked before there are logs.
            if parameter.measure == Measure::One && !(low..=high).contains(value) {
                return Err(ModelError::OutOfBounds {
                    effect: new.effect.name.clone(),
                    parameter: parameter.name.clone(),
                    value: *value,
                    low,
                    high,
                });
            }
        }
        Ok(())
    }

    /// Whether the file gives mass matrix and bias, which effects on the inertia need.
    pub fn has_mass_matrix(&self) -> bool {
        !matches!(self.equations.motion, Motion::Accelerations(_))
    }

    /// The intermediates, under their names.
    pub(super) fn bind_lets(&self, graph: &mut Graph, scope: &mut Scope) {
        for (name, formula) in &self.equations.lets {
            let node = lower(scope, graph, &formula.value);
            graph.label(node, name);
            scope.bind(name, node);
        }
    }

    /// Total energy and the power of the torques as a program of the inputs of a compiled model, if the file states
    /// them or its equations are those of a chain: `[total, power, d total/dq.., d total/dqd..]`.
    pub fn energy_program(&self) -> Option<crate::expr::Program> {
        let mut graph = Graph::new();
        let names = self.names_under(self.driven_by());
        let mut scope = Scope::of_inputs(&mut graph, names.iter().map(String::as_str));
        if let Some(drive) = &self.equations.drive {
            let torques = drive.torques(&mut graph, &scope);
            for (joint, torque) in Joint::all(self.joints).zip(torques) {
                scope.bind(&joint.name("tau"), torque);
            }
        }
        let states = names[..2 * self.joints].iter();
        let states: Vec<Node> = states.filter_map(|name| scope.get(name)).collect();
        self.bind_lets(&mut graph, &mut scope);
        let (total, power) = match (&self.equations.energy, &self.equations.motion) {
            (Some(Energy { total, power }), _) => {
                let mut lower = |formula: &Located<_>| lower(&scope, &mut graph, &formula.value);
                (lower(total), lower(power))
            }
            (None, Motion::Tree(bodies)) => bodies.energy(&mut graph, &scope),
            _ => return None,
        };
        let one = graph.constant(1.0);
        let slopes = graph.gradient(&[total], &[one], &states);
        Some(graph.finish(&[&[total, power], slopes.as_slice()].concat()))
    }
}

impl Model {
    /// The parameters of each body of a chain whose ten parts are plain parameters: mass, first moments, and xx, xy,
    /// xz, yy, yz, zz of the tensor.
    pub fn inertias(&self) -> Vec<[usize; 10]> {
        let Motion::Tree(bodies) = &self.equations.motion else {
            return Vec::new();
        };
        let place = |formula: &Located<Formula>| {
            let mut parameters = self.parameters.iter();
            parameters.position(|parameter| formula.value.is_name(&parameter.name))
        };
        let body = |body: &Body<Located<Formula>>| -> Option<[usize; 10]> {
            let places: Option<Vec<usize>> = body.parts().map(place).collect();
            places?.try_into().ok()
        };
        bodies.bodies.iter().filter_map(body).collect()
    }

    /// The bodies that the file describes, if it describes a chain, at these values of the declared parameters.
    pub fn mechanism(&self, values: &[f64]) -> Option<Recovered> {
        let Motion::Tree(bodies) = &self.equations.motion else {
            return None;
        };
        let mut graph = Graph::new();
        let names = self.parameters.iter().map(|p| p.name.as_str());
        let mut scope = Scope::of_inputs(&mut graph, names);
        self.bind_lets(&mut graph, &mut scope);
        let nodes = bodies.constants(&mut graph, &scope);
        let numbers = graph.finish(&nodes).eval(&values[..self.parameters.len()]);
        Some(bodies.mechanism(&numbers))
    }
}

impl Equations {
    /// All formulas of the file but those of effects.
    pub fn formulas(&self) -> impl Iterator<Item = &Located<Formula>> {
        let energy = self.energy.iter();
        let energy = energy.flat_map(|energy| [&energy.total, &energy.power]);
        let lets = self.lets.iter().map(|(_, formula)| formula);
        let drives = self.drive.iter().flat_map(Drive::formulas);
        lets.chain(self.motion.formulas())
            .chain(energy)
            .chain(drives)
    }
}

impl Motion {
    pub(super) fn formulas(&self) -> Box<dyn Iterator<Item = &Located<Formula>> + '_> {
        match self {
            Self::Accelerations(formulas) => Box::new(formulas.iter()),
            Self::MassAndBias { mass, bias } => Box::new(mass.iter().flatten().chain(bias)),
            Self::Tree(bodies) => Box::new(bodies.formulas()),
        }
    }
}
