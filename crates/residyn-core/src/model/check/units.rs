//! Units that do not match, if they are declared.
//!
//! Every finding is certain: the unit of a term that contains a plain number is unknown, since formulas derived from a
//! drawing have lengths as numbers, and so is the unit of a command or of a parameter without `unit`. Angles are pure
//! numbers.

use std::collections::HashMap;

use super::{Finding, Kind};
use crate::data::Joint;
use crate::expr::{Formula, Unit};
use crate::model::effect::{Effect, Entry};
use crate::model::reader::Located;
use crate::model::system::{Model, Motion};
use crate::model::{InternalState, MeasuredQuantity, Parameter};

/// Names and their units, if they have one.
type Names = HashMap<String, Option<Unit>>;

pub(super) fn find(model: &Model) -> Vec<Finding> {
    let mut units = Units {
        model,
        names: Names::new(),
        findings: Vec::new(),
    };
    units.parameters();
    units.measured();
    units.states();
    units.drive();
    units.intermediates();
    units.motion();
    units.energy();
    for (k, effect) in model.effects.iter().enumerate() {
        units.effect(model.line_of_effect(k), &effect.effect);
    }
    units.findings
}

/// A unit as written in this code.
fn unit(text: &str) -> Unit {
    Unit::parse(text).expect("an SI unit").without_angle()
}

/// The unit that a file declares; none if it declares none, or an unknown one.
fn declared(text: &str) -> Option<Unit> {
    Unit::parse(text).map(Unit::without_angle)
}

/// Units of a joint's coordinate and of its force.
fn of_joint(model: &Model, joint: Joint) -> [Unit; 2] {
    match model.prismatic[joint] {
        true => [unit("m"), unit("N")],
        false => [unit("1"), unit("N m")],
    }
}

struct Units<'p> {
    model: &'p Model,
    names: Names,
    findings: Vec<Finding>,
}

impl Units<'_> {
    fn parameters(&mut self) {
        let model = self.model;
        for Parameter { name, unit, .. } in &model.parameters {
            self.quantity(model.line_of_parameter(name), name, unit);
        }
    }

    fn measured(&mut self) {
        let model = self.model;
        for MeasuredQuantity { name, unit } in &model.measured {
            self.quantity(model.line_of_measured(name), name, unit);
        }
    }

    /// A name with the unit that the file declares for it.
    fn quantity(&mut self, line: Option<usize>, name: &str, unit: &str) {
        let known = declared(unit);
        if known.is_none() && !unit.is_empty() {
            let text = format!(
                "the unit `{unit}` of `{name}` is not a product of SI units: values are in SI units, and terms that \
                 contain it are not checked"
            );
            self.tell(line, text);
        }
        self.names.insert(name.to_owned(), known);
    }

    fn states(&mut self) {
        let model = self.model;
        for joint in Joint::all(model.joints) {
            let [q, force] = of_joint(model, joint);
            self.names.insert(joint.name("q"), Some(q));
            self.names.insert(joint.name("qd"), Some(q.over(unit("s"))));
            self.names.insert(joint.name("tau"), Some(force));
        }
        self.names.insert("t".to_owned(), Some(unit("s")));
    }

    fn drive(&mut self) {
        let model = self.model;
        let formulas = model
            .equations
            .drive
            .iter()
            .flat_map(|drive| drive.formulas());
        for (joint, formula) in Joint::all(model.joints).zip(formulas) {
            let [_, force] = of_joint(model, joint);
            self.expect(
                &format!("the torque `{}`", joint.name("tau")),
                formula,
                force,
            );
        }
    }

    fn intermediates(&mut self) {
        let model = self.model;
        for (name, formula) in &model.equations.lets {
            let unit = self.of(formula);
            self.names.insert(name.clone(), unit);
        }
    }

    fn motion(&mut self) {
        let model = self.model;
        let square = unit("s^2");
        let joints = || Joint::all(model.joints);
        match &model.equations.motion {
            Motion::Accelerations(formulas) => {
                for (joint, formula) in joints().zip(formulas) {
                    let [q, _] = of_joint(model, joint);
                    let name = format!("the acceleration `{}`", joint.name("qdd"));
                    self.expect(&name, formula, q.over(square));
                }
            }
            Motion::MassAndBias { mass, bias } => {
                for (i, row) in joints().zip(mass) {
                    let [_, force] = of_joint(model, i);
                    for (j, formula) in joints().zip(row) {
                        let [q, _] = of_joint(model, j);
                        let name = format!("entry {i}, {j} of `mass`");
                        self.expect(&name, formula, force.times(square).over(q));
                    }
                    self.expect(&format!("entry {i} of `bias`"), &bias[i], force);
                }
            }
            Motion::Tree(bodies) => {
                for formula in &bodies.gravity {
                    self.expect("`gravity`", formula, unit("m/s^2"));
                }
                for body in &bodies.bodies {
                    self.expect("`mass`", &body.mass, unit("kg"));
                    for formula in &body.moment {
                        self.expect("`moment`", formula, unit("kg m"));
                    }
                    for formula in &body.tensor {
                        self.expect("`inertia`", formula, unit("kg m^2"));
                    }
                }
            }
        }
    }

    /// Both may be relative to an inertia: they only have to fit each other.
    fn energy(&mut self) {
        let model = self.model;
        if let Some(energy) = &model.equations.energy
            && let Some(total) = self.of(&energy.total)
        {
            let power = total.over(unit("s"));
            self.expect("`power` beside `total`", &energy.power, power);
        }
    }

    /// An effect in the units of its file, which are those of a joint that turns.
    fn effect(&mut self, line: Option<usize>, effect: &Effect) {
        let motion = [
            ("q", "1"),
            ("qd", "1/s"),
            ("qdd", "1/s^2"),
            ("tau", "N m"),
            ("load", "N m"),
            ("t", "s"),
        ];
        let motion = motion.map(|(name, text)| (name.to_owned(), Some(unit(text))));
        let parameters = effect.parameters.iter();
        let parameters = parameters.map(|p| (p.name.clone(), declared(&p.unit)));
        let measured = self.model.measured.iter();
        let measured = measured.map(|own| (own.name.clone(), declared(&own.unit)));
        let motion = motion.into_iter().chain(measured);
        let states = effect.states.iter();
        let states = states.map(|state| (state.name.clone(), declared(&state.unit)));
        let names: Names = motion.chain(states).chain(parameters).collect();
        for state in &effect.states {
            self.state(line, &effect.name, state, &names);
        }
        let (formula, of_kind) = match &effect.entry {
            Entry::Force(formula)
            | Entry::Torque(formula)
            | Entry::Coupling(formula)
            | Entry::Transmission(formula) => (formula, "N m"),
            Entry::Angle(formula) | Entry::Reading(formula) | Entry::Friction(formula) => {
                (formula, "1")
            }
            Entry::Inertia(formula) => (formula, "kg m^2"),
            Entry::Payload(formula) => (formula, "kg"),
            Entry::Shift(..) | Entry::Command(_) => return,
        };
        self.fit(
            &format!("the formula of {}", effect.name),
            formula,
            line,
            unit(of_kind),
            &names,
        );
    }
}

impl Units<'_> {
    /// The formulas of a state of an effect.
    fn state(&mut self, line: Option<usize>, effect: &str, state: &InternalState, names: &Names) {
        let Some(own) = declared(&state.unit) else {
            return;
        };
        let what = |formula: &str| format!("{formula} of the state `{}` of {effect}", state.name);
        if let Some(rate) = &state.rate {
            self.fit(&what("the rate"), rate, line, own.over(unit("s")), names);
        }
        for end in state.within.iter().flatten() {
            self.fit(&what("an end"), end, line, own, names);
        }
        if let Some(start) = &state.start {
            self.fit(&what("the start"), start, line, own, names);
        }
    }

    /// The unit of a formula of the declared equations, whose misfits are reported.
    fn of(&mut self, formula: &Located<Formula>) -> Option<Unit> {
        let names = std::mem::take(&mut self.names);
        let unit = self.unit(&formula.value, Some(self.model.line(formula.at)), &names);
        self.names = names;
        unit
    }

    /// A formula of the declared equations whose value should have this unit.
    fn expect(&mut self, what: &str, formula: &Located<Formula>, wanted: Unit) {
        let names = std::mem::take(&mut self.names);
        let line = Some(self.model.line(formula.at));
        self.fit(what, &formula.value, line, wanted, &names);
        self.names = names;
    }

    fn fit(
        &mut self,
        what: &str,
        formula: &Formula,
        line: Option<usize>,
        wanted: Unit,
        names: &Names,
    ) {
        if let Some(unit) = self
            .unit(formula, line, names)
            .filter(|unit| *unit != wanted)
        {
            let text = format!(
                "{what} is `{}` [{unit}], but should be in [{wanted}]",
                formula.text()
            );
            self.tell(line, text);
        }
    }

    fn unit(&mut self, formula: &Formula, line: Option<usize>, names: &Names) -> Option<Unit> {
        let (unit, misfits) = formula.unit(&|name| names.get(name).copied().flatten());
        for misfit in misfits {
            self.tell(line, misfit.message);
        }
        unit
    }

    fn tell(&mut self, line: Option<usize>, text: String) {
        self.findings.push(Finding::new(Kind::Units, line, text));
    }
}
