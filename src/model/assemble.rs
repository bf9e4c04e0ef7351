use super::effect::{EFFECT_NAMES, Effect, Entry, Measure};
use super::filter::{CommandFilter, Filter};
use super::reader::Located;
use super::system::{FittedEffect, Motion, System};
use super::{Dynamics, Parameter};
use crate::expr::{Formula, Graph, Node, Program, Scope, SignForm};

impl System {
    /// The declared equations with the file's own effects, ready to run.
    pub fn dynamics(&self, sign: &[SignForm]) -> Dynamics {
        self.dynamics_with(&self.effects, sign)
    }

    /// The declared equations with `effects` in place of the file's own.
    ///
    /// Filters of the command act first, then other effects of the torque, in the order given, then forces are
    /// added. `load` is the torque before the latter. `sign` says for each joint how dry friction is written.
    ///
    /// # Panics
    /// When an effect names a joint that the system does not have, or `sign` has not one entry a joint.
    pub fn dynamics_with(&self, effects: &[FittedEffect], sign: &[SignForm]) -> Dynamics {
        assert_eq!(
            sign.len(),
            self.joints,
            "one form of the sign for each joint"
        );
        let mut assembly = Assembly::new(self, effects, sign);
        let reading = assembly.reading();
        assembly.apply_sensors();
        assembly.apply_torque_effects();
        assembly.apply_forces();
        let accelerations = assembly.accelerations();
        let mut outputs = assembly.qd.clone();
        outputs.extend(accelerations);
        Dynamics {
            name: self.name.clone(),
            joints: self.joints,
            parameters: assembly.parameters,
            program: assembly.graph.finish(&outputs),
            filters: filters(self.parameters.len(), effects),
            reading,
        }
    }
}

/// The filters among `effects`, whose parameters follow the `declared` ones.
fn filters(declared: usize, effects: &[FittedEffect]) -> Vec<Filter> {
    let mut parameter = declared;
    let mut filters = Vec::new();
    for effect in effects {
        if let Entry::Command(kind) = effect.effect.entry {
            filters.push(Filter {
                joint: effect.joint,
                kind,
                parameter,
            });
        }
        parameter += effect.values.len();
    }
    filters
}

impl FittedEffect {
    /// The effect on a joint (counted from 0) with all parameters zero.
    pub fn absent(effect: &Effect, joint: usize) -> Self {
        Self {
            effect: effect.clone(),
            joint,
            values: vec![(0.0, None); effect.parameters.len()],
            own: Vec::new(),
            fixed: false,
        }
    }

    /// What tells this effect from others in one model.
    pub fn label(&self) -> String {
        format!("{} on joint {}", self.title(), self.joint + 1)
    }

    /// Whether the two cannot act in one model: they are the same effect, or filters of one kind on one joint.
    pub fn excludes(&self, other: &Self) -> bool {
        let filter = matches!(self.effect.entry, Entry::Command(_));
        let same_filter = filter && self.effect.entry == other.effect.entry;
        self.label() == other.label() || same_filter && self.joint == other.joint
    }

    /// The effect's formula in the names of its joint: `-F_c1 * sign(qd1)`.
    pub fn expression(&self, names: &[String]) -> String {
        match self.program(names) {
            Ok(program) => program.formula(0),
            Err(filter) => filter.expression(&format!("tau{}", self.joint + 1), &names[0]),
        }
    }

    /// The effect's formula as a program, or the filter that it is.
    pub(super) fn program(&self, names: &[String]) -> Result<Program, CommandFilter> {
        let formula = match &self.effect.entry {
            Entry::Command(filter) => return Err(*filter),
            Entry::Force(f)
            | Entry::Torque(f)
            | Entry::Angle(f)
            | Entry::Inertia(f)
            | Entry::Shift(_, f)
            | Entry::Reading(f) => f,
        };
        let mut graph = Graph::new();
        let mut scope = Scope::new(SignForm::Exact);
        for name in EFFECT_NAMES {
            let suffix = if name == "t" {
                String::new()
            } else {
                (self.joint + 1).to_string()
            };
            let node = graph.input(&format!("{name}{suffix}"));
            scope.bind(name, node);
        }
        for (parameter, name) in self.effect.parameters.iter().zip(names) {
            let node = graph.input(name);
            scope.bind(&parameter.name, node);
        }
        let node = scope
            .lower(&mut graph, formula)
            .expect("formulas were checked when the file was read");
        Ok(graph.finish(&[node]))
    }

    /// The names of the effect's parameters on its joint, told apart from names already `taken`.
    pub fn parameter_names(&self, taken: &[&str]) -> Vec<String> {
        let joint = self.joint + 1;
        let plain = |own: &str| match self.shifted() {
            Some(_) => format!("{own}_shift"),
            None => format!("{own}{joint}"),
        };
        let name = |own: &str| match plain(own) {
            plain if taken.contains(&plain.as_str()) => {
                format!("{}_{plain}", self.effect.name)
            }
            plain => plain,
        };
        self.effect
            .parameters
            .iter()
            .map(|p| name(&p.name))
            .collect()
    }
}

/// The graph while it grows.
struct Assembly<'a> {
    system: &'a System,
    effects: Vec<(&'a FittedEffect, Vec<Node>)>,
    sign: &'a [SignForm],
    graph: Graph,
    parameters: Vec<Parameter>,
    /// The angle of the rig, once sensors are accounted for.
    q: Vec<Node>,
    qd: Vec<Node>,
    /// The torque after what has been applied so far.
    tau: Vec<Node>,
    time: Node,
    declared: Vec<Node>,
}

impl<'a> Assembly<'a> {
    fn new(system: &'a System, effects: &'a [FittedEffect], sign: &'a [SignForm]) -> Self {
        let mut graph = Graph::new();
        let mut numbered = |stem: &str| -> Vec<Node> {
            (1..=system.joints)
                .map(|j| graph.input(&format!("{stem}{j}")))
                .collect()
        };
        let (q, qd, tau) = (numbered("q"), numbered("qd"), numbered("tau"));
        let time = graph.input("t");
        let declared = system
            .parameters
            .iter()
            .map(|p| graph.input(&p.name))
            .collect();
        let mut parameters = system.parameters.clone();
        let mut with_nodes = Vec::new();
        for effect in effects {
            let of_effects = parameters.iter().map(|p| p.name.as_str());
            let taken: Vec<&str> = system.own_names().chain(of_effects).collect();
            let own = effect_parameters(effect, &taken, system.prismatic[effect.joint]);
            with_nodes.push((effect, own.iter().map(|p| graph.input(&p.name)).collect()));
            parameters.extend(own);
        }
        Self {
            system,
            effects: with_nodes,
            sign,
            graph,
            parameters,
            q,
            qd,
            tau,
            time,
            declared,
        }
    }

    /// The state's angles are those that the sensors read: everything else sees the rig's own.
    fn apply_sensors(&mut self) {
        for (index, joint, formula) in self.entries(Effect::is_of_sensor) {
            self.q[joint] = self.effect_node(index, formula);
        }
    }

    fn apply_torque_effects(&mut self) {
        for (index, joint, formula) in
            self.entries(|effect| matches!(effect.entry, Entry::Torque(_)))
        {
            self.tau[joint] = self.effect_node(index, formula);
        }
    }

    fn apply_forces(&mut self) {
        // All forces see the torque as it was before any of them.
        let forces: Vec<(usize, Node)> = self
            .entries(|effect| matches!(effect.entry, Entry::Force(_)))
            .into_iter()
            .map(|(index, joint, formula)| (joint, self.effect_node(index, formula)))
            .collect();
        for (joint, force) in forces {
            self.tau[joint] = self.graph.add(self.tau[joint], force);
        }
    }

    /// The effects that enter in one way: number, joint and formula.
    fn entries(&self, is_wanted: impl Fn(&Effect) -> bool) -> Vec<(usize, usize, &'a Formula)> {
        let effects = self.effects.iter().enumerate();
        let wanted = effects.filter(|(_, (effect, _))| is_wanted(&effect.effect));
        wanted
            .filter_map(|(index, (effect, _))| {
                Some((index, effect.joint, effect.effect.entry.formula()?))
            })
            .collect()
    }

    /// An effect's formula in terms of its joint.
    fn effect_node(&mut self, index: usize, formula: &Formula) -> Node {
        let (effect, nodes) = &self.effects[index];
        let joint = effect.joint;
        let mut scope = Scope::new(self.sign[joint]);
        scope.bind("q", self.q[joint]);
        scope.bind("qd", self.qd[joint]);
        scope.bind("tau", self.tau[joint]);
        scope.bind("load", self.tau[joint]);
        scope.bind("t", self.time);
        for (parameter, node) in effect.effect.parameters.iter().zip(nodes) {
            scope.bind(&parameter.name, *node);
        }
        scope
            .lower(&mut self.graph, formula)
            .expect("formulas were checked when the file was read")
    }

    fn accelerations(&mut self) -> Vec<Node> {
        let scope = self.declared_scope();
        match &self.system.motion {
            Motion::Accelerations(formulas) => formulas
                .iter()
                .map(|formula| lower(&scope, &mut self.graph, formula))
                .collect(),
            Motion::MassAndBias { mass, bias } => {
                let mut matrix: Vec<Vec<Node>> = mass
                    .iter()
                    .map(|row| {
                        row.iter()
                            .map(|entry| lower(&scope, &mut self.graph, entry))
                            .collect()
                    })
                    .collect();
                self.add_inertia(&mut matrix);
                let right: Vec<Node> = bias
                    .iter()
                    .zip(self.tau.clone())
                    .map(|(entry, tau)| {
                        let bias = lower(&scope, &mut self.graph, entry);
                        self.graph.sub(tau, bias)
                    })
                    .collect();
                self.graph.solve_spd(&matrix, &right)
            }
        }
    }

    fn add_inertia(&mut self, matrix: &mut [Vec<Node>]) {
        for (index, joint, formula) in
            self.entries(|effect| matches!(effect.entry, Entry::Inertia(_)))
        {
            let extra = self.effect_node(index, formula);
            matrix[joint][joint] = self.graph.add(matrix[joint][joint], extra);
        }
    }

    /// The angles of the declared equations: those of the rig as effects turn them.
    fn declared_angles(&mut self) -> Vec<Node> {
        self.turned(|effect| matches!(effect.entry, Entry::Angle(_)) && !effect.is_of_sensor())
    }

    /// What sensors show where effects stand between them and the rig.
    fn reading(&mut self) -> Option<Program> {
        let stands_between = |effect: &Effect| matches!(effect.entry, Entry::Reading(_));
        let shown = self.turned(stands_between);
        (shown != self.q).then(|| self.graph.clone().finish(&shown))
    }

    /// The angles as some effects turn them, one after the other.
    fn turned(&mut self, by: impl Fn(&Effect) -> bool) -> Vec<Node> {
        let before = self.q.clone();
        for (index, joint, formula) in self.entries(by) {
            self.q[joint] = self.effect_node(index, formula);
        }
        std::mem::replace(&mut self.q, before)
    }

    /// The names of the declared equations: angles as effects turn them, torques as effects leave them.
    fn declared_scope(&mut self) -> Scope {
        let angles = self.declared_angles();
        let mut scope = Scope::new(self.narrowest_sign());
        for j in 0..self.system.joints {
            scope.bind(&format!("q{}", j + 1), angles[j]);
            scope.bind(&format!("qd{}", j + 1), self.qd[j]);
            scope.bind(&format!("tau{}", j + 1), self.tau[j]);
        }
        scope.bind("t", self.time);
        for (parameter, node) in self.system.parameters.iter().zip(&self.declared) {
            scope.bind(&parameter.name, *node);
        }
        self.bind_shifted(&mut scope);
        for (name, formula) in &self.system.lets {
            let node = lower(&scope, &mut self.graph, formula);
            self.graph.label(node, name);
            scope.bind(name, node);
        }
        scope
    }

    /// Shifted parameters take the place of the declared ones.
    fn bind_shifted(&mut self, scope: &mut Scope) {
        for (index, _, formula) in self.entries(|e| matches!(e.entry, Entry::Shift(..))) {
            if let Some(k) = self.effects[index].0.shifted() {
                let shift = self.effect_node(index, formula);
                let shifted = self.graph.add(self.declared[k], shift);
                scope.bind(&self.system.parameters[k].name, shifted);
            }
        }
    }

    /// A declared formula may mix joints, so the narrowest of their widths is safe for all.
    fn narrowest_sign(&self) -> SignForm {
        let width = |sign: &SignForm| match sign {
            SignForm::Exact => 0.0,
            SignForm::Smooth { width } => *width,
        };
        *self
            .sign
            .iter()
            .min_by(|a, b| width(a).total_cmp(&width(b)))
            .expect("a system has at least one joint")
    }
}

fn lower(scope: &Scope, graph: &mut Graph, formula: &Located<Formula>) -> Node {
    scope
        .lower(graph, &formula.value)
        .expect("formulas were checked when the file was read")
}

/// Effect files speak of turning joints; on a sliding one forces stand for torques and metres for radians.
fn unit_on(prismatic: bool, unit: &str) -> String {
    if prismatic {
        unit.replace("kg m^2", "kg")
            .replace("N m", "N")
            .replace("rad", "m")
    } else {
        unit.to_owned()
    }
}

fn effect_parameters(effect: &FittedEffect, taken: &[&str], prismatic: bool) -> Vec<Parameter> {
    let names = effect.parameter_names(taken);
    let declared = effect.effect.parameters.iter().zip(&effect.values);
    declared
        .zip(names)
        .map(|((parameter, (value, ci95)), name)| Parameter {
            name,
            value: *value,
            unit: unit_on(prismatic, &parameter.unit),
            bounds: match parameter.measure {
                Measure::One => parameter.bounds,
                Measure::Speed | Measure::Torque => [0.0, f64::INFINITY],
            },
            fixed: effect.fixed || parameter.whole,
            per_log: parameter.per_log,
            ci95: *ci95,
            scale: parameter.typical,
        })
        .collect()
}
