use std::collections::BTreeSet;
use std::f64::consts::TAU;

use super::assemble::lower;
use super::error::ModelError;
use super::filter::CommandFilter;
use super::internal_state::InternalState;
use crate::data::{NOMINAL, is_measured};
use crate::expr::{Formula, Graph, Node, Program, Scope, SignForm, suggestion};

/// Names that an effect's formula may mention besides its parameters.
pub const EFFECT_NAMES: [&str; 5] = ["q", "qd", "tau", "load", "t"];

/// Names that a formula on the sum of two joints may mention, and the parameter that is the next joint's share in the
/// sum.
pub(super) const COUPLING_NAMES: [&str; 4] = ["q", "qd", "qdd", "t"];
pub(super) const RATIO: &str = "r";

/// Names that the formula of a transmission may mention: by what the motor leads the link, and how fast that grows.
pub(super) const TRANSMISSION_NAMES: [&str; 3] = ["twist", "twist_rate", "t"];
/// The inertia of the motor behind a transmission, and whether sensor and friction are on its side (1) or the link's (0).
pub(super) const MOTOR_INERTIA: &str = "J_m";
pub(super) const SIDES: [&str; 2] = ["sensor", "friction"];

/// The position of a payload: parameters with these names.
pub(super) const PLACE: [&str; 3] = ["x", "y", "z"];

/// Number of commands on either side of zero at which acting torques are compared, and the step between them (N m or
/// N): typical values are for desktop rigs.
const COMMANDS: i32 = 60;
const COMMAND_STEP: f64 = 0.05;
/// Torques that differ by less than this share of a unit command are the same.
const PROPORTIONAL: f64 = 1e-9;

fn commands() -> impl Iterator<Item = f64> {
    (-COMMANDS..=COMMANDS).map(|k| f64::from(k) * COMMAND_STEP)
}

/// Angle, speed, torque and load at which an effect is compared with its mirror image.
const MIRRORED: [[f64; 4]; 3] = [
    [0.3, 0.7, 0.5, 0.4],
    [-0.8, 1.3, -0.2, 0.9],
    [1.7, -0.1, 1.1, -0.6],
];

/// A physical effect that a model may lack: one file of `models/effects`.
#[derive(Debug, Clone, PartialEq)]
pub struct Effect {
    pub name: String,
    pub about: String,
    pub entry: Entry,
    pub parameters: Vec<EffectParameter>,
    /// The states that it has of its own, which its formula and their rates may mention.
    pub states: Vec<InternalState>,
    /// A condition on the parameters, which holds if it is positive.
    pub valid_if: Option<Formula>,
    /// Simpler effects that are special cases of this one.
    pub contains: Vec<String>,
    /// Looked for only in place of an effect that it contains or, where a motion is compared, of all of them.
    pub refines: bool,
    pub confused_with: Vec<String>,
    /// The motion that shows the effect.
    pub shown_by: String,
    pub acts_on: ActsOn,
    pub shows_in: ShowsIn,
    pub alike_on: AlikeOn,
    /// Most machines have it, on every joint: such effects are tried together before all others, first those of rank 1,
    /// then those up to rank 2, and so on. Effects of rank 1 are also added to a model before its first fit.
    pub baseline: Option<usize>,
}

/// The joints on which an effect has a meaning.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum ActsOn {
    #[default]
    All,
    /// Where gravity's direction enters: the first joint of a chain, if it turns.
    First,
    /// Joints that turn: the effect repeats with each turn.
    Turning,
}

/// The comparisons in which an effect is looked for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum ShowsIn {
    #[default]
    Any,
    /// Of torques only: in an open-loop motion it is too much like something else.
    Torques,
    /// Of torques that the law of a drive asks for.
    LawTorques,
    /// Any, where the law of a drive turns commands into torques.
    Law,
}

/// The joints that have the effect alike, if one of them has it: it belongs to how they are built.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum AlikeOn {
    /// It belongs to a single joint.
    #[default]
    None,
    /// Joints that are built alike.
    LikeJoints,
    /// All that commands drive: one bus brings the commands.
    Commanded,
}

/// The two sides of a transmission.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Side {
    Link,
    Motor,
}

/// How an effect enters the equations of its joint. Formulas are in `q`, `qd`, `tau`, `load`, `t` of that joint and in
/// the effect's parameters.
#[derive(Debug, Clone, PartialEq)]
pub enum Entry {
    /// Added to the generalised force, and so passed through the mass matrix.
    Force(Formula),
    /// Replaces the commanded torque.
    Torque(Formula),
    /// Replaces the joint's angle in the declared equations.
    Angle(Formula),
    /// Added to the joint's diagonal entry of the mass matrix.
    Inertia(Formula),
    /// Multiplies the friction of its joint: the forces of effects that its velocity changes.
    Friction(Formula),
    /// Added to the declared parameter of this index.
    Shift(usize, Formula),
    /// A filter of the commanded torque, applied before all other effects on it.
    Command(CommandFilter),
    /// Replaces the measured angle.
    Reading(Formula),
    /// A generalised force on the sum q + r q' of the joint's coordinate and the next joint's, r being the parameter of
    /// that name: it acts on the joint, and r times on the next one. It may be linear in the acceleration of the sum,
    /// `qdd`.
    Coupling(Formula),
    /// A point mass on the last body of a chain, at the parameters x, y, z in that body's frame.
    Payload(Formula),
    /// The torque that passes from a motor with an inertia of its own to the link. The motor's torque is that after all
    /// effects on the torque; the parameters `sensor` and `friction` say on which side both are.
    Transmission(Formula),
}

impl Entry {
    /// Names that the formula may mention besides the effect's parameters.
    pub(super) fn names(&self) -> &'static [&'static str] {
        match self {
            Self::Coupling(_) => &COUPLING_NAMES,
            Self::Transmission(_) => &TRANSMISSION_NAMES,
            Self::Payload(_) => &[],
            _ => &EFFECT_NAMES,
        }
    }

    /// Whether the formula may mention further measured columns: all but that of a load, which is what it is.
    pub(super) fn may_be_measured(&self) -> bool {
        !matches!(self, Self::Payload(_))
    }

    /// Parameters that the effect has by name: the share of the next joint, the position of a load.
    pub(crate) fn needed(&self) -> &'static [&'static str] {
        match self {
            Self::Coupling(_) => &[RATIO],
            Self::Transmission(_) => &[MOTOR_INERTIA, SIDES[0], SIDES[1]],
            Self::Payload(_) => &PLACE,
            _ => &[],
        }
    }

    /// The effect's formula, or the filter if it is one.
    pub(super) fn formula_or_filter(&self) -> Result<&Formula, CommandFilter> {
        match self {
            Self::Force(f)
            | Self::Torque(f)
            | Self::Angle(f)
            | Self::Inertia(f)
            | Self::Friction(f)
            | Self::Shift(_, f)
            | Self::Reading(f)
            | Self::Coupling(f)
            | Self::Transmission(f)
            | Self::Payload(f) => Ok(f),
            Self::Command(filter) => Err(*filter),
        }
    }

    /// The formula of the effect, unless it is a filter.
    pub fn formula(&self) -> Option<&Formula> {
        self.formula_or_filter().ok()
    }

    /// Whether the formula may mention states of the effect.
    pub(super) fn may_have_states(&self) -> bool {
        matches!(
            self,
            Self::Force(_) | Self::Torque(_) | Self::Friction(_) | Self::Reading(_)
        )
    }
}

/// The unit of a parameter's bounds and starting values.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Measure {
    /// The parameter's own unit.
    One,
    /// The highest speed of the joint in the logs.
    Speed,
    /// The highest torque of the joint in the logs.
    Torque,
    /// The inertia that the declared equations give the joint.
    Inertia,
    /// The longest log.
    Duration,
}

/// How far the logs of a joint reach.
#[derive(Clone, Copy)]
pub struct Logged<'a> {
    /// The speed over which dry friction reverses, rad/s or m/s.
    pub reversal: f64,
    /// The highest speed, rad/s or m/s.
    pub top_speed: f64,
    /// The highest torque, N m or N.
    pub top_torque: f64,
    /// The inertia in the declared equations, kg m^2 or kg, for effects that ask.
    pub inertia: &'a dyn Fn() -> f64,
    /// The length of the longest log, s.
    pub duration_s: f64,
    /// From the lowest angle to the highest, rad or m.
    pub travel: f64,
}

/// A parameter of an effect.
#[derive(Debug, Clone, PartialEq)]
pub struct EffectParameter {
    pub name: String,
    pub unit: String,
    pub about: String,
    /// Typical magnitude on a desktop rig.
    pub typical: f64,
    /// Admissible range, in `measure`.
    pub bounds: [f64; 2],
    /// Values from which fits start, in `measure`. A single value is the one without effect, mostly zero.
    pub starts: Vec<f64>,
    /// Unit of bounds and starting values.
    pub measure: Measure,
    /// Whole numbers only: searched among the starting values, not fitted.
    pub whole: bool,
    /// Takes a separate value in each log.
    pub per_log: bool,
    pub hold: Hold,
}

/// Whether fits hold a parameter where they start.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Hold {
    Never,
    /// If the logs do not determine it: it says how the others are to be read, and any value explains the logs.
    IfUnknown,
    /// As they do not.
    Held,
}

impl Effect {
    /// The same effect with what logs need not determine held; `None` if there is nothing of the kind.
    pub(crate) fn with_unknown_held(&self) -> Option<Self> {
        let mut held = self.clone();
        let mut unknown = held.parameters.iter_mut();
        let unknown = unknown.find(|parameter| parameter.hold == Hold::IfUnknown)?;
        unknown.hold = Hold::Held;
        Some(held)
    }

    /// Free what was held: beside other effects logs may determine it.
    pub(crate) fn free_held(&mut self) {
        if let Some(held) = self.held() {
            self.parameters[held].hold = Hold::IfUnknown;
        }
    }

    /// The parameter that is held since the logs do not determine it, by its place.
    pub fn held(&self) -> Option<usize> {
        let mut parameters = self.parameters.iter();
        parameters.position(|parameter| parameter.hold == Hold::Held)
    }

    /// The names of its parameters.
    pub fn names(&self) -> impl Iterator<Item = &str> {
        self.parameters
            .iter()
            .map(|parameter| parameter.name.as_str())
    }

    /// Every name that its formula and those of its states mention, in order.
    pub fn mentions(&self) -> BTreeSet<&str> {
        let of_states = self.states.iter().flat_map(InternalState::formulas);
        let formulas = self.entry.formula().into_iter().chain(of_states);
        formulas.flat_map(Formula::names).collect()
    }

    /// The further measured columns that it reads, in the order of their names.
    pub fn measured(&self) -> impl Iterator<Item = &str> {
        let names = self.mentions().into_iter();
        names.filter(|name| is_measured(name))
    }

    /// Whether the effect is invisible on a joint without torque.
    pub fn needs_torque(&self) -> bool {
        let names = self.mentions();
        let reads = |name: &&str| names.contains(*name);
        self.is_filter() || self.is_transmission() || ["tau", "load"].iter().any(reads)
    }

    /// Whether one of two effects is listed as easily confused with the other.
    pub fn is_confused_with(&self, other: &Self) -> bool {
        self.confused_with.contains(&other.name) || other.confused_with.contains(&self.name)
    }

    /// Whether the effect is a force that the velocity of its joint changes.
    pub fn is_friction(&self) -> bool {
        matches!(self.entry, Entry::Force(_)) && self.mentions().contains("qd")
    }

    /// Whether the effect delays commands or low-passes them.
    pub fn is_filter(&self) -> bool {
        matches!(self.entry, Entry::Command(_))
    }

    /// The same effect with the sensor of its joint on this side, if that matters to it.
    #[must_use]
    pub(crate) fn read_on(mut self, side: Side) -> Self {
        if self.is_transmission() {
            let mut parameters = self.parameters.iter_mut();
            let sensor = parameters.find(|parameter| parameter.name == SIDES[0]);
            let value = match side {
                Side::Link => 0.0,
                Side::Motor => 1.0,
            };
            let sensor = sensor.expect("checked when the file was read");
            (sensor.starts, sensor.bounds) = (vec![value], [value; 2]);
        }
        self
    }

    /// Whether the effect stands between a motor and its link.
    pub fn is_transmission(&self) -> bool {
        matches!(self.entry, Entry::Transmission(_))
    }

    /// Whether the effect is a transmission that is free within a range, in which nothing passes.
    pub fn has_play(&self) -> bool {
        self.is_transmission() && self.states.iter().any(|state| state.within.is_some())
    }

    /// Whether the effect couples its joint with the next one.
    pub fn is_coupling(&self) -> bool {
        matches!(self.entry, Entry::Coupling(_))
    }

    /// The force of a coupling at zero acceleration, and the inertia of the sum, as a program of [`COUPLING_NAMES`], the
    /// measured columns and the parameters; `sign` is how dry friction reverses.
    pub(super) fn coupling(&self, sign: SignForm) -> Option<Program> {
        let Entry::Coupling(formula) = &self.entry else {
            return None;
        };
        let mut graph = Graph::new();
        let mut scope = Scope::new(sign);
        let motion = COUPLING_NAMES.into_iter().chain(self.measured());
        for name in motion.chain(self.names()) {
            let node = graph.input(name);
            scope.bind(name, node);
        }
        let force = lower(&scope, &mut graph, formula);
        let acceleration = scope.get("qdd").expect("bound above");
        let one = graph.constant(1.0);
        let slope = graph.gradient(&[force], &[one], &[acceleration])[0];
        let (inertia, rest) = (graph.neg(slope), graph.constant(0.0));
        scope.bind("qdd", rest);
        let at_rest = lower(&scope, &mut graph, formula);
        Some(graph.finish(&[at_rest, inertia]))
    }

    /// The variable that the effect's force depends on, if that is one of `q`, `qd`, `tau` and `t` alone, with the
    /// force and its derivatives with respect to the parameters as a program of the variable and the parameters.
    pub fn over_one_variable(&self) -> Option<(&'static str, Program)> {
        let (formula, replaced) = match &self.entry {
            Entry::Force(formula) => (formula, None),
            Entry::Torque(formula) => (formula, Some("tau")),
            _ => return None,
        };
        if self.measured().next().is_some() || !self.states.is_empty() {
            return None;
        }
        let names = formula.names();
        let is_used = |name: &&str| names.contains(name) || replaced == Some(*name);
        let used: Vec<&str> = EFFECT_NAMES.into_iter().filter(is_used).collect();
        let [variable @ ("q" | "qd" | "tau" | "t")] = used[..] else {
            return None;
        };
        let mut graph = Graph::new();
        let inputs = std::iter::once(variable).chain(self.names());
        let scope = Scope::of_inputs(&mut graph, inputs);
        let acting = lower(&scope, &mut graph, formula);
        let force = match replaced.and_then(|name| scope.get(name)) {
            Some(commanded) => graph.sub(acting, commanded),
            None => acting,
        };
        let parameters: Vec<Node> = self.names().filter_map(|name| scope.get(name)).collect();
        let one = graph.constant(1.0);
        let slopes = graph.gradient(&[force], &[one], &parameters);
        Some((
            variable,
            graph.finish(&[&[force], slopes.as_slice()].concat()),
        ))
    }

    /// The effect of this name.
    ///
    /// # Errors
    /// Unknown name, with a similar known one.
    pub(super) fn find<'e>(effects: &'e [Self], name: &str) -> Result<&'e Self, ModelError> {
        let found = effects.iter().find(|effect| effect.name == name);
        found.ok_or_else(|| ModelError::UnknownEffect {
            name: name.to_owned(),
            near: suggestion(name, effects.iter().map(|effect| effect.name.as_str())),
        })
    }

    /// The same effect with bounds and starting values in the parameters' own units, for a joint in its logs. Dry friction
    /// has no other shape within its reversal: no speed at which it changes is lower. What repeats with each turn is seen to
    /// repeat: less than one period of it has the shape of a spring, or of any other force that bends.
    #[must_use]
    pub fn measured_by(&self, logged: &Logged<'_>) -> Self {
        let is_dry = (self.entry.formula()).is_some_and(|formula| formula.calls("sign"));
        let slowest = if is_dry { logged.reversal } else { 0.0 };
        let mut effect = self.clone();
        for parameter in &mut effect.parameters {
            let (least, unit) = match std::mem::replace(&mut parameter.measure, Measure::One) {
                Measure::One => (None, 1.0),
                Measure::Speed => (Some(slowest), logged.top_speed),
                Measure::Torque => (None, logged.top_torque),
                Measure::Inertia => (None, (logged.inertia)()),
                Measure::Duration => (None, logged.duration_s),
            };
            let multiples = parameter.bounds.iter_mut().chain(&mut parameter.starts);
            multiples.for_each(|value| *value *= unit);
            if let Some(least) = least {
                let [low, high] = &mut parameter.bounds;
                *low = low.max(least).min(*high);
                // A start at the bound would be the shape of the reversal itself.
                parameter.starts.retain(|start| start > low);
            }
            if parameter.counts_periods() {
                parameter
                    .starts
                    .retain(|start| start * logged.travel >= TAU);
            }
        }
        effect
    }

    /// The effect as text, in the names of its file.
    pub fn text(&self) -> String {
        match self.entry.formula_or_filter() {
            Ok(formula) => formula.text().to_owned(),
            Err(filter) => filter.expression("tau", &self.parameters[0].name),
        }
    }

    /// Whether `valid_if` holds for these values of the parameters, in their order.
    pub fn is_valid(&self, values: &[f64]) -> bool {
        let condition = |formula| self.evaluate(formula, values, |_| 0.0) > 0.0;
        self.valid_if.as_ref().is_none_or(condition)
    }

    /// By how much these values of the parameters fulfil the comparison in `valid_if`; `None` if there is none.
    pub fn margin(&self, values: &[f64]) -> Option<f64> {
        let margin = self.valid_if.as_ref()?.margin()?;
        Some(self.evaluate(&margin, values, |_| 0.0))
    }

    /// The value of a formula, where `of_joint` gives its joint's `q`, `qd`, `tau` and so on; measured columns are at
    /// [`NOMINAL`], internal states at zero.
    fn evaluate(&self, formula: &Formula, values: &[f64], of_joint: impl Fn(&str) -> f64) -> f64 {
        let mut graph = Graph::new();
        let mut scope = Scope::new(SignForm::Exact);
        let of_joint = EFFECT_NAMES.map(|name| (name, of_joint(name)));
        let own = self.names().zip(values.iter().copied());
        let measured = self.measured().map(|name| (name, NOMINAL));
        let states = self.states.iter().map(|state| (state.name.as_str(), 0.0));
        let all = of_joint.into_iter().chain(measured).chain(states);
        for (name, value) in all.chain(own) {
            let node = graph.constant(value);
            scope.bind(name, node);
        }
        let node = lower(&scope, &mut graph, formula);
        graph.finish(&[node]).eval(&[])[0]
    }

    /// The sensor's reading, under a sensor effect with these values, when the joint rests at `angle`.
    pub fn reading(&self, values: &[f64], angle: f64) -> f64 {
        let Entry::Angle(formula) = &self.entry else {
            return angle;
        };
        let shown = |read: f64| {
            let at = |name: &str| if name == "q" { read } else { 0.0 };
            self.evaluate(formula, values, at)
        };
        let step = |read: f64| read + angle - shown(read);
        // One step is exact for an offset; a scale that is off by a tenth gains a digit a step.
        (0..16).fold(angle, |read, _| step(read))
    }

    /// Whether the acting torque determines the commanded one, at typical values: it grows with the command everywhere.
    /// A force that depends on the command may cancel it.
    pub fn distinguishes_command(&self) -> bool {
        match &self.entry {
            Entry::Torque(formula) => grows(&self.acting(formula, &self.typical())),
            Entry::Force(_) => !self.mentions().contains("tau"),
            _ => true,
        }
    }

    /// Whether the acting torque determines small commands alone, at typical values, and never falls with a larger one: a
    /// limit. Of a command beyond it, the torque says no more than that it is beyond.
    pub fn limits_command(&self) -> bool {
        let Entry::Torque(formula) = &self.entry else {
            return false;
        };
        let acting = self.acting(formula, &self.typical());
        let small = &acting[acting.len() / 2 - 1..][..3];
        grows(small) && acting.is_sorted() && !grows(&acting)
    }

    /// By what these values multiply every command, if the acting torque is in proportion to it: that of a gain.
    pub fn gain(&self, values: &[f64]) -> Option<f64> {
        let Entry::Torque(formula) = &self.entry else {
            return None;
        };
        // What it multiplies a command by depends on its states.
        if !self.states.is_empty() {
            return None;
        }
        let acting = self.acting(formula, values);
        let gain = acting.last()? / commands().last()?;
        let mut pairs = acting.iter().zip(commands());
        let is_in_proportion = pairs
            .all(|(acting, command)| (acting - gain * command).abs() <= PROPORTIONAL * gain.abs());
        is_in_proportion.then_some(gain)
    }

    /// Whether the acting torque is in proportion to the command, at typical values.
    pub(crate) fn is_gain(&self) -> bool {
        self.gain(&self.typical()).is_some()
    }

    fn typical(&self) -> Vec<f64> {
        self.parameters.iter().map(|p| p.typical).collect()
    }

    /// The torques that act under commands on either side of zero.
    fn acting(&self, formula: &Formula, values: &[f64]) -> Vec<f64> {
        let acting = |tau: f64| {
            let at = |name: &str| if name == "tau" { tau } else { 0.0 };
            self.evaluate(formula, values, at)
        };
        commands().map(acting).collect()
    }

    /// Whether the effect acts alike on a joint and on its mirror image: with the joint's axis turned round, the same values of
    /// its parameters do the same. Where they do not, the values of like joints on opposite sides differ in sign or swap.
    pub fn is_mirror_symmetric(&self) -> bool {
        let (formula, sign) = match &self.entry {
            Entry::Force(formula) | Entry::Torque(formula) | Entry::Transmission(formula) => {
                (formula, -1.0)
            }
            Entry::Inertia(formula) | Entry::Friction(formula) => (formula, 1.0),
            Entry::Command(_) => return true,
            _ => return false,
        };
        // With equal values, a friction with one level for each direction would look like one with a single level.
        let values = self.parameters.iter().zip(1..);
        let values: Vec<f64> = values
            .map(|(parameter, k)| parameter.typical * (1.0 + 0.1 * f64::from(k)))
            .collect();
        let turned = |[q, qd, tau, load]: [f64; 4], turn: f64| {
            let of_joint = |name: &str| match name {
                "q" => turn * q,
                "qd" => turn * qd,
                "tau" => turn * tau,
                "load" => turn * load,
                _ => 1.0,
            };
            self.evaluate(formula, &values, of_joint)
        };
        MIRRORED.into_iter().all(|at| {
            let (as_is, mirrored) = (turned(at, 1.0), turned(at, -1.0));
            (mirrored - sign * as_is).abs() <= 1e-9 * (1.0 + as_is.abs())
        })
    }

    /// Whether the effect belongs to the sensor of an angle, not to the rig: its parameters change from log to log.
    pub fn is_of_sensor(&self) -> bool {
        matches!(self.entry, Entry::Angle(_)) && self.parameters.iter().all(|p| p.per_log)
    }
}

impl EffectParameter {
    /// Whether the effect is absent at zero of this parameter.
    pub fn is_switch(&self) -> bool {
        self.starts == [0.0]
    }

    /// Whether it is a number of periods per turn.
    fn counts_periods(&self) -> bool {
        self.whole && self.unit == "1/rad"
    }
}

/// Whether each torque is larger than the one before.
fn grows(torques: &[f64]) -> bool {
    torques.is_sorted_by(|less, more| less < more)
}

#[cfg(test)]
mod tests {
    use std::f64::consts::TAU;

    use super::{EffectParameter, Logged};
    use crate::model::Library;

    /// The variable of a built-in effect, and its force there with the derivatives with respect to the parameters.
    fn over(name: &str, inputs: &[f64]) -> Option<(&'static str, Vec<f64>)> {
        let library = Library::built_in();
        let effect = library.effect(name).unwrap();
        let (variable, program) = effect.over_one_variable()?;
        Some((variable, program.eval(inputs)))
    }

    #[test]
    fn effects_of_one_variable_are_curves_over_it() {
        let dry = over("coulomb_friction", &[-2.0, 0.16]);
        assert_eq!(dry, Some(("qd", vec![0.16, 1.0])));
        // The torque that the drive gives beyond the commanded one.
        let gain = over("actuator_gain", &[3.0, 0.1]).unwrap();
        assert_eq!((gain.0, gain.1[1]), ("tau", 3.0));
        assert!((gain.1[0] - 0.3).abs() < 1e-12);
        for other in [
            "load_friction",
            "constant_torque",
            "rotor_inertia",
            "backlash",
            "actuator_delay",
        ] {
            assert_eq!(over(other, &[]), None, "{other}");
        }
    }

    #[test]
    fn limits_determine_small_commands_alone() {
        let library = Library::built_in();
        let effects = library.effects().iter();
        let limits = effects.filter(|effect| effect.limits_command());
        let names: Vec<&str> = limits.map(|effect| effect.name.as_str()).collect();
        assert_eq!(names, ["actuator_saturation", "torque_speed_limit"]);
        // Neither a gain, which determines them all, nor one that determines none of the small ones.
        let gain = library.effect("actuator_gain").unwrap();
        assert!(gain.distinguishes_command());
        let dead = library.effect("actuator_deadzone").unwrap();
        assert!(!dead.distinguishes_command() && !dead.limits_command());
    }

    #[test]
    fn a_gain_is_in_proportion_to_the_command() {
        let library = Library::built_in();
        let gain = |name: &str, values: &[f64]| library.effect(name).unwrap().gain(values);
        assert!((gain("actuator_gain", &[-0.4]).unwrap() - 0.6).abs() < 1e-12);
        assert_eq!(gain("actuator_saturation", &[1.0]), None);
        assert_eq!(gain("viscous_friction", &[1.0]), None);
    }

    #[test]
    fn an_effect_with_a_direction_is_not_mirror_symmetric() {
        let library = Library::built_in();
        let has = |name: &str| library.effect(name).unwrap().is_mirror_symmetric();
        for symmetric in [
            "coulomb_friction",
            "stribeck_friction",
            "load_friction",
            "gear_friction",
            "actuator_delay",
            "actuator_gain",
            "rotor_inertia",
        ] {
            assert!(has(symmetric), "{symmetric}");
        }
        for directed in [
            "asymmetric_friction",
            "constant_torque",
            "joint_spring",
            "cogging_torque",
            "sensor_offset",
            "payload",
        ] {
            assert!(!has(directed), "{directed}");
        }
    }

    /// A parameter of a built-in effect for a joint with this reversal and travel, in other respects always the same.
    fn measured(effect: &str, parameter: &str, reversal: f64, travel: f64) -> EffectParameter {
        let library = Library::built_in();
        let effect = library.effect(effect).unwrap();
        let measured = effect.measured_by(&Logged {
            reversal,
            top_speed: 10.0,
            top_torque: 1.0,
            inertia: &|| 0.1,
            duration_s: 20.0,
            travel,
        });
        let mut parameters = measured.parameters.into_iter();
        parameters.find(|own| own.name == parameter).unwrap()
    }

    #[test]
    fn dry_friction_changes_at_no_speed_within_its_reversal() {
        let speed = |effect: &str, parameter: &str, reversal: f64| {
            let speed = measured(effect, parameter, reversal, 1.0);
            (speed.bounds, speed.starts)
        };
        let stribeck = |reversal: f64| speed("stribeck_friction", "v_s", reversal);
        assert_eq!(stribeck(0.0), ([0.1, 10.0], vec![0.2, 0.5, 1.0, 2.0]));
        assert_eq!(stribeck(0.7), ([0.7, 10.0], vec![1.0, 2.0]));
        assert_eq!(stribeck(20.0), ([10.0, 10.0], vec![]));
        let degressive = |reversal: f64| speed("degressive_friction", "v_d", reversal);
        assert_eq!(degressive(0.7), degressive(0.0));
    }

    #[test]
    fn a_ripple_is_looked_for_where_a_whole_period_of_it_was_seen() {
        for effect in ["cogging_torque", "gear_ripple"] {
            let first = |travel: f64| measured(effect, "N", 0.0, travel).starts.first().copied();
            assert_eq!(first(TAU), Some(2.0));
            assert_eq!(first(1.0), Some(7.0));
            assert_eq!(first(0.1), None);
        }
    }
}
