use super::drive::Drive;
use super::effect::Entry;
use super::fitted::{FittedEffect, PrintedState};
use super::reader::Located;
use super::system::{Model, Motion};
use crate::data::{Joint, Quantity};
use crate::expr::{Formula, latex_name};

impl Model {
    /// The declared equations as lines of a LaTeX `align` environment: drives, intermediates, then the motion. Torques are
    /// those after all effects.
    pub fn latex(&self) -> Vec<String> {
        let mut names = self.input_names();
        let mut lines = self.drive_lines();
        for (name, formula) in &self.equations.lets {
            lines.push(format!(
                "{} &= {}",
                latex_name(name),
                latex(&names, formula)
            ));
            names.push(name.clone());
        }
        let each = |formulas: &[Located<Formula>]| -> Vec<String> {
            formulas
                .iter()
                .map(|formula| latex(&names, formula))
                .collect()
        };
        let column = |stem: &str| -> Vec<String> {
            let joints = Joint::all(self.joints);
            joints.map(|joint| latex_name(&joint.name(stem))).collect()
        };
        match &self.equations.motion {
            Motion::Accelerations(formulas) => {
                let pairs = column("qdd").into_iter().zip(each(formulas));
                lines.extend(pairs.map(|(left, right)| format!("{left} &= {right}")));
            }
            Motion::MassAndBias { mass, bias } => {
                let rows: Vec<String> = mass.iter().map(|row| each(row).join(" & ")).collect();
                lines.push(format!(
                    "{}\\,{} + {} &= {}",
                    matrix(&rows),
                    matrix(&column("qdd")),
                    matrix(&each(bias)),
                    matrix(&column("tau"))
                ));
            }
            Motion::Tree(_) => lines.push(format!(
                "M(q)\\,{} + h(q, \\dot q) &= {}",
                matrix(&column("qdd")),
                matrix(&column("tau"))
            )),
        }
        lines
    }

    /// The drives' torques, if there are any drives.
    fn drive_lines(&self) -> Vec<String> {
        let names = self.drive_names();
        let drives = self.equations.drive.iter().flat_map(Drive::formulas);
        let line = |(joint, formula): (Joint, &Located<Formula>)| {
            format!(
                "{} &= {}",
                latex_name(&joint.name("tau")),
                latex(&names, formula)
            )
        };
        Joint::all(self.joints).zip(drives).map(line).collect()
    }
}

impl FittedEffect {
    /// The effect's formula in the names of its joint and of its parameters, in LaTeX.
    pub fn latex(&self, names: &[String], driven_by: Quantity) -> String {
        match self.program(names) {
            Ok(program) => {
                let state = |PrintedState { name, rate, ends }| {
                    let name = latex_name(&name);
                    let formula = |k| program.latex_formula(k);
                    let within = ends.map(|ends| (ends.map(formula), rate));
                    let within = within.map(|([low, high], rate)| match rate {
                        Some(_) => format!(",\\; {low} \\le {name} \\le {high}"),
                        None => {
                            format!(",\\; {name} \\text{{ beyond }} {low} \\text{{ to }} {high}")
                        }
                    });
                    let rate = rate.map(|k| format!(",\\quad \\dot {{{name}}} = {}", formula(k)));
                    rate.unwrap_or_default() + &within.unwrap_or_default()
                };
                let states = self.printed_states().map(state);
                program.latex_formula(0) + &states.collect::<String>()
            }
            Err(filter) => {
                let driven = latex_name(&self.joint.name(driven_by.key()));
                filter.latex(&driven, &latex_name(&names[0]))
            }
        }
    }

    /// How it enters the equations, in words; `typeset` says how a quantity such as `tau1` is written.
    pub fn enters(&self, typeset: impl Fn(&str) -> String) -> String {
        let of_joint = |stem: &str| typeset(&self.joint.name(stem));
        match &self.effect.entry {
            Entry::Force(_) => format!("added to {}", of_joint("tau")),
            Entry::Torque(_) => format!("in place of {}", of_joint("tau")),
            Entry::Transmission(_) => "passed from the motor to the link".to_owned(),
            Entry::Angle(_) => format!("in place of {}", of_joint("q")),
            Entry::Payload(_) => "a mass on the last body".to_owned(),
            Entry::Coupling(_) => format!(
                "added to {}, and times the ratio to {}",
                of_joint("tau"),
                typeset(&self.joint.next().name("tau"))
            ),
            Entry::Inertia(_) => "added to the joint's own entry of the mass matrix".to_owned(),
            Entry::Friction(_) => "times the friction of the joint".to_owned(),
            Entry::Shift(..) => "added to a parameter".to_owned(),
            Entry::Command(_) => format!("between the command and {}", of_joint("tau")),
            Entry::Reading(_) => format!("what the sensor shows for {}", of_joint("q")),
        }
    }
}

fn matrix(rows: &[String]) -> String {
    format!(
        "\\begin{{pmatrix}} {} \\end{{pmatrix}}",
        rows.join(" \\\\ ")
    )
}

fn latex(names: &[String], formula: &Located<Formula>) -> String {
    let program = formula.value.program(names.iter().map(String::as_str));
    let program = program.expect("formulas were checked when the file was read");
    program.latex_formula(0)
}
