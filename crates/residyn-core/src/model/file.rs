//! A model file, read whole and checked.

use std::collections::HashMap;
use std::path::Path;
use std::sync::Arc;

use super::columns_in_file::columns;
use super::drive::Drive;
use super::effect::Effect;
use super::measured_in_file::measured;
use super::reader::{Document, FileError, Located, Section};
use super::system::{Energy, Equations, Model, Motion, Places};
use super::tables::{ChainTable, EnergyTable, ModelFile};
use super::{effects_in_file, like_in_file, logs_in_file, sections, tree_in_file};
use crate::data::{Columns, Joint, Quantity};
use crate::expr::{Formula, Graph, Scope, parse};

impl Model {
    /// The model in `text`; `path` is for messages.
    ///
    /// # Errors
    /// Unknown or missing key, formula error, unknown effect: with line, column and remedy.
    pub fn from_text(path: &Path, text: &str, library: &[Effect]) -> Result<Self, FileError> {
        Self::from_document(&Document::new(path, text), library)
    }

    fn from_document(document: &Document, library: &[Effect]) -> Result<Self, FileError> {
        let file = ModelFile::of(document.parse()?)?;
        let (top, system) = (file.section, file.system);
        system.check_joints()?;
        system.check_joint_names()?;
        system.check_smoothing_velocity()?;
        let prismatic = system.prismatic()?;
        let like = like_in_file::groups(&system)?;
        let joints = system.joints;
        let driven_by = match file.drive {
            None => Quantity::Torque,
            Some(_) => Quantity::Command,
        };
        let equations = Equations {
            lets: sections::lets(&top)?,
            motion: motion(&top, file.chain, &prismatic)?,
            energy: file
                .energy
                .map(|EnergyTable { total, power, .. }| Energy { total, power }),
            drive: file
                .drive
                .map(|section| Drive::read(&section, joints))
                .transpose()?,
        };
        let effects = effects_in_file::read(&file.effect, joints, library)?;
        let mut places = Places {
            parameters: (file.parameters.0.iter())
                .map(|(_, table)| table.section.at)
                .collect(),
            measured: Vec::new(),
            effects: file.effect.iter().map(|section| section.at).collect(),
        };
        let own = logs_in_file::fitted(&file.parameters)?;
        let parameters = sections::parameters(file.parameters)?;
        let of_formulas = equations.formulas().flat_map(Located::names);
        let of_effects = effects.iter().zip(&places.effects);
        let of_effects =
            of_effects.flat_map(|(own, at)| own.effect.measured().map(move |name| (name, *at)));
        let lets = equations.lets.iter().map(|(name, _)| name.as_str());
        let declared = parameters.iter().map(|own| own.name.as_str()).chain(lets);
        let measured = measured(
            document,
            file.measured,
            of_formulas.chain(of_effects),
            &declared.collect::<Vec<_>>(),
        )?;
        let (measured, measured_at): (Vec<_>, Vec<usize>) = measured.into_iter().unzip();
        places.measured = measured_at;
        let model = Self {
            joints,
            smoothing_velocity: system.smoothing_velocity,
            name: system.name,
            about: system.about.unwrap_or_default(),
            columns: Columns {
                slides: prismatic.clone(),
                torque: file.log.and_then(|log| log.torque),
                ..columns(
                    file.columns,
                    joints,
                    driven_by,
                    &system.joint_names,
                    &measured,
                )?
            },
            like,
            measured,
            joint_names: system.joint_names,
            configurations: logs_in_file::configurations(file.logs, &parameters)?,
            own,
            parameters,
            effects,
            hidden: sections::hidden(file.residual, joints)?,
            sides: sections::sides(file.sensors, joints)?,
            text: document.text.clone(),
            places,
            declaration: sections::declaration(document)?,
            equations: Arc::new(equations),
            prismatic,
        };
        model.check_names(document)?;
        model.check_formulas(document)?;
        for (k, section) in file.effect.iter().enumerate() {
            let (present, rest) = model.effects.split_at(k);
            let check = model.check_effect(&rest[0], present);
            check.map_err(|refused| section.error(refused.to_string()))?;
        }
        Ok(model)
    }

    /// Parameters and intermediates must not take the names of states, torques, measured columns or each other.
    fn check_names(&self, document: &Document) -> Result<(), FileError> {
        let mut taken: Vec<String> = self.input_names();
        taken.truncate(taken.len() - self.parameters.len());
        taken.extend(Joint::all(self.joints).map(|joint| joint.name(Quantity::Command.key())));
        let parameters = self.parameters.iter().map(|parameter| &parameter.name);
        let parameters = parameters.zip(self.places.parameters.iter().copied());
        let lets = self.equations.lets.iter();
        let lets = lets.map(|(name, formula)| (name, formula.at));
        for (name, at) in parameters.chain(lets) {
            let fault = if !parse(name).is_ok_and(|formula| formula.is_name(name)) {
                "cannot be used in formulas; use letters, digits and _"
            } else if taken.contains(name) {
                "is taken; choose another"
            } else {
                taken.push(name.clone());
                continue;
            };
            return Err(document.error(at, format!("the name `{name}` {fault}")));
        }
        Ok(())
    }

    /// Lower every formula once, so that a wrong name is reported here, with its place.
    fn check_formulas(&self, document: &Document) -> Result<(), FileError> {
        let mut graph = Graph::new();
        let mut names = self.input_names();
        if matches!(self.equations.motion, Motion::Tree(_)) {
            // The inertia of a body does not change as it moves.
            names.drain(..names.len() - self.parameters.len());
        }
        let mut scope = Scope::of_inputs(&mut graph, names.iter().map(String::as_str));
        let mut lower = |scope: &Scope, formula: &Located<Formula>| {
            scope
                .lower(&mut graph, &formula.value)
                .map_err(|error| document.formula_error(formula.at, &error))
        };
        let lets = &self.equations.lets;
        for (k, (name, formula)) in lets.iter().enumerate() {
            let mut later = lets[k..].iter().map(|(later, _)| later.as_str());
            if let Some(later) = later.find(|later| formula.value.names().contains(later)) {
                let message = match circle(lets, name, later) {
                    Some(circle) => format!(
                        "`{name}` is defined in terms of itself: {circle}; write one of these without the next"
                    ),
                    None => {
                        format!("`{name}` uses `{later}`, which is defined after it; move it up")
                    }
                };
                return Err(document.error(formula.at, message));
            }
            let node = lower(&scope, formula)?;
            scope.bind(name, node);
        }
        let energy = self
            .equations
            .energy
            .iter()
            .flat_map(|energy| [&energy.total, &energy.power]);
        for formula in self.equations.motion.formulas().chain(energy) {
            lower(&scope, formula)?;
        }
        let names = self.drive_names();
        let mut drives = self.equations.drive.iter().flat_map(Drive::formulas);
        drives.try_for_each(|Located { value, at }| {
            document.check_names(*at, value, names.iter().map(String::as_str))
        })
    }
}

/// `a -> b -> a`: how the intermediate `name` uses itself by way of `next`, if it does.
fn circle(lets: &[(String, Located<Formula>)], name: &str, next: &str) -> Option<String> {
    let mut users = HashMap::from([(next, name)]);
    let mut open = vec![next];
    while let Some(at) = open.pop() {
        if at == name {
            let back = std::iter::successors(Some(users[name]), |at| Some(users[at]));
            let mut between: Vec<&str> = back.take_while(|at| *at != name).collect();
            between.reverse();
            return Some([&[name], between.as_slice(), &[name]].concat().join(" -> "));
        }
        let formula = lets.iter().find(|(own, _)| own == at);
        for used in formula.map_or_else(Vec::new, |(_, formula)| formula.value.names()) {
            users.entry(used).or_insert_with(|| {
                open.push(used);
                at
            });
        }
    }
    None
}

/// Equations of motion given by formulas, or those of a chain of bodies.
fn motion(
    top: &Section<'_>,
    chain: Option<ChainTable<'_>>,
    prismatic: &[bool],
) -> Result<Motion, FileError> {
    let Some(chain) = chain else {
        return sections::motion(&top.read("dynamics")?, prismatic.len());
    };
    if let Some(dynamics) = top.read::<Option<Section<'_>>>("dynamics")? {
        dynamics.only(&["let"])?;
    }
    let bodies = tree_in_file::bodies(chain, prismatic)?;
    Ok(Motion::Tree(Box::new(bodies)))
}
