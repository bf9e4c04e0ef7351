//! The torques that commands lead to on a rig that is not driven by torques: a servo with position targets, a motor
//! under voltage.

use std::sync::Arc;

use super::Parameter;
use super::assemble::lower;
use super::reader::{FileError, Located, Section};
use super::system::{Equations, Model};
use crate::data::{Joint, Log, Measured, Quantity, Smooth};
use crate::expr::{Formula, Graph, Node, Program, Scope, is_of_torque};
use crate::lanes::Row;

/// The torque of each joint's drive, as formulas in the commands `cmd1..cmdn`, the measured motion `q1..`, `qd1..`, the
/// further measured columns, time `t` and the parameters of the model.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Drive(Vec<Located<Formula>>);

impl Drive {
    /// The table `[drive]`: one formula per joint, `tau1` to `taun`.
    pub fn read(section: &Section<'_>, joints: usize) -> Result<Self, FileError> {
        let names: Vec<String> = Joint::all(joints).map(|joint| joint.name("tau")).collect();
        section.only(&names.iter().map(String::as_str).collect::<Vec<_>>())?;
        let formula = |name: &String| {
            section.read::<Option<_>>(name)?.ok_or_else(|| {
                let command = name.replace("tau", Quantity::Command.key());
                section.error(format!(
                    "`{name}` is missing in [drive]; a joint whose command is its torque has {name} = \"{command}\""
                ))
            })
        };
        let formulas = names.iter().map(formula);
        formulas.collect::<Result<_, _>>().map(Self)
    }

    pub fn formulas(&self) -> &[Located<Formula>] {
        &self.0
    }

    /// The drives of these joints alone, in the names of joints that are numbered from 1.
    pub fn limb(&self, joints: &[Joint]) -> Self {
        let renamed = |name: &str| {
            let stems = ["q", "qd", Quantity::Command.key()];
            let mut named = stems.iter().flat_map(|stem| {
                let pair =
                    move |(k, joint): (usize, &Joint)| (joint.name(stem), Joint::at(k).name(stem));
                joints.iter().enumerate().map(pair)
            });
            named.find(|(whole, _)| whole == name).map(|(_, own)| own)
        };
        let own = joints.iter().map(|joint| {
            let Located { value, at } = &self.0[*joint];
            Located {
                value: value.renamed(&renamed),
                at: *at,
            }
        });
        Self(own.collect())
    }

    /// The torques, in a scope that has the names they may mention.
    pub fn torques(&self, graph: &mut Graph, scope: &Scope) -> Vec<Node> {
        let formulas = self.0.iter();
        formulas
            .map(|formula| lower(scope, graph, &formula.value))
            .collect()
    }
}

impl Model {
    /// What the rig is driven by: torques, or commands that `[drive]` turns into torques.
    pub fn driven_by(&self) -> Quantity {
        match self.equations.drive {
            None => Quantity::Torque,
            Some(_) => Quantity::Command,
        }
    }

    /// The parameters that this joint's drive mentions and no other joint's does.
    pub fn drive_parameters(&self, joint: Joint) -> Vec<&Parameter> {
        let Some(drive) = &self.equations.drive else {
            return Vec::new();
        };
        let mentions = |of: Joint, name: &str| drive.0[of].value.names().contains(&name);
        let is_own = |parameter: &&Parameter| {
            let mut joints = Joint::all(self.joints);
            joints.all(|other| mentions(other, &parameter.name) == (other == joint))
        };
        self.parameters.iter().filter(is_own).collect()
    }

    /// Whether commands drive the joints by laws without a free parameter: the torques that they ask for are known.
    pub fn knows_law(&self) -> bool {
        self.equations.drive.is_some() && self.free_of_law().is_empty()
    }

    /// The free parameters of the laws by which commands drive the joints.
    pub fn free_of_law(&self) -> Vec<usize> {
        let mut of_law = self.of_law();
        of_law.retain(|k| !self.parameters[*k].fixed);
        of_law
    }

    /// The parameters of these laws.
    fn of_law(&self) -> Vec<usize> {
        let laws = self.equations.drive.iter().flat_map(Drive::formulas);
        let names: Vec<&str> = laws.flat_map(|law| law.value.names()).collect();
        let all = 0..self.parameters.len();
        all.filter(|k| names.contains(&self.parameters[*k].name.as_str()))
            .collect()
    }

    /// Whether the file gives this log another load than the others: a mass, a force or a torque with a value of its own, or
    /// an effect that fits hold and that has one.
    pub fn has_known_load(&self, log: &Log) -> bool {
        let (values, of_law) = (self.values(), self.of_law());
        let all = self.all_parameters();
        let is_held = |k: usize| match self.parameters.get(k) {
            Some(declared) => !declared.per_log && !of_law.contains(&k),
            None => (0..self.effects.len())
                .any(|e| self.effects[e].fixed && self.place_of(e).contains(&k)),
        };
        (0..values.len()).any(|k| {
            let is_other = || self.value_of(k, Some(log)) != values[k];
            is_of_torque(&all[k].unit) && is_held(k) && is_other()
        })
    }

    /// The names that formulas of `[drive]` may use.
    pub(super) fn drive_names(&self) -> Vec<String> {
        self.names_under(Quantity::Command)
    }

    /// The drives' torques along a log (`[joint][row]`, N m or N), at the declared values of that log, before any effect;
    /// the log's own torques if it holds torques.
    pub fn drive_torques(&self, log: &Log) -> Vec<Vec<f64>> {
        let channels = log.q.iter().chain(&log.qd).chain(&log.tau);
        self.drive_torques_along(log, channels, &log.measured, &log.time)
    }

    /// The log, smoothed, with the same torques in place of its commands.
    pub fn with_drive_torques(&self, log: &Log, smooth: Smooth) -> Smooth {
        let channels = smooth.q.iter().chain(&smooth.qd).chain(&smooth.tau);
        let tau = self.drive_torques_along(log, channels, &smooth.measured, &smooth.time);
        Smooth { tau, ..smooth }
    }

    /// The same along positions, velocities, commands, further measured columns and time of a log.
    fn drive_torques_along<'l>(
        &self,
        log: &Log,
        of_joints: impl Iterator<Item = &'l Vec<f64>>,
        measured: &'l [Measured],
        time: &'l Vec<f64>,
    ) -> Vec<Vec<f64>> {
        let Some(program) = self.drive_program() else {
            return of_joints.skip(2 * self.joints).cloned().collect();
        };
        let measured = Measured::named(measured, self.measured_names());
        let channels: Vec<&Vec<f64>> = of_joints.chain(measured).chain([time]).collect();
        let rows = time.len();
        let mut torques = vec![Vec::with_capacity(rows); self.joints];
        let values = self.declared_values_in(log);
        let mut tape = program.tape_at::<f64, 1>(channels.len(), &values);
        for row in 0..rows {
            for (slot, channel) in tape.moving().iter_mut().zip(&channels) {
                *slot = Row([channel[row]]);
            }
            tape.run();
            for (joint, torques) in torques.iter_mut().enumerate() {
                torques.push(tape.output(joint)[0]);
            }
        }
        torques
    }

    /// The same equations, driven by torques.
    pub fn without_drive(&self) -> Self {
        let equations = Equations {
            drive: None,
            ..(*self.equations).clone()
        };
        Self {
            equations: Arc::new(equations),
            ..self.clone()
        }
    }

    /// The drives' torques as a program of state, command, further measured columns, time and parameters.
    pub fn drive_program(&self) -> Option<Program> {
        let drive = self.equations.drive.as_ref()?;
        let mut graph = Graph::new();
        let names = self.drive_names();
        let scope = Scope::of_inputs(&mut graph, names.iter().map(String::as_str));
        let torques = drive.torques(&mut graph, &scope);
        Some(graph.finish(&torques))
    }
}

#[cfg(test)]
mod tests {
    use crate::data::Joint;
    use crate::model::{Library, Model};

    /// Two joints on position loops of a common stiffness `kp`, declared like this, and their own known damping.
    fn pair(kp: &str) -> Model {
        let text = format!(
            "[system]\nname = \"pair\"\njoints = 2\n[parameters]\nkp = {kp}\nJ = {{ value = 1.0 }}\n\
             kd_1 = {{ value = 1.0, fixed = true }}\nkd_2 = {{ value = 1.0, fixed = true }}\n\
             [drive]\ntau1 = \"kp*(cmd1 - q1) - kd_1*qd1\"\ntau2 = \"kp*(cmd2 - q2) - kd_2*qd2\"\n\
             [dynamics]\nqdd1 = \"tau1/J\"\nqdd2 = \"tau2/J\"\n"
        );
        let library = Library::built_in();
        library.model_from_text("pair.toml", &text).unwrap()
    }

    #[test]
    fn constants_of_one_drive_belong_to_its_joint() {
        let model = pair("{ value = 1.0 }");
        let names = |joint: usize| -> Vec<&str> {
            let own = model.drive_parameters(Joint::at(joint)).into_iter();
            own.map(|parameter| parameter.name.as_str()).collect()
        };
        assert_eq!([names(0), names(1)], [["kd_1"], ["kd_2"]]);
    }

    #[test]
    fn laws_without_free_gains_are_known() {
        assert!(pair("{ value = 1.0, fixed = true }").knows_law());
        assert!(!pair("{ value = 1.0 }").knows_law());
        let pendulum = Library::built_in().model("pendulum").unwrap();
        assert!(!pendulum.knows_law(), "torques drive it");
    }
}
