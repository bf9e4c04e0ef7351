use crate::c::Names;
use crate::{ExportModel, ExportedEffect};
use residyn_core::data::{Joint, Quantity};
use residyn_core::model::CommandFilter;

/// A variable of the model description; its value reference is its position.
pub(super) struct Variable {
    pub name: String,
    pub about: String,
    /// Empty for a pure number.
    pub unit: String,
    pub role: Role,
}

pub(super) enum Role {
    Time,
    Input,
    /// A continuous state with its value at rest; whether it is an output as well.
    State {
        output: bool,
        start: f64,
    },
    /// The derivative of the state at this position.
    Rate {
        state: usize,
    },
    Parameter {
        value: f64,
        bounds: [f64; 2],
    },
}

/// Joints whose torque follows its command with a lag.
pub(super) fn lags(model: &ExportModel) -> Vec<Joint> {
    Joint::all(model.joints())
        .filter(|joint| model.filter(*joint, CommandFilter::Lag).is_some())
        .collect()
}

/// In the order of `unit.h`: time, torques, states, their rates, parameters.
pub(super) fn variables(model: &ExportModel, names: &Names) -> Vec<Variable> {
    let time = Variable {
        name: "time".into(),
        about: "time".into(),
        unit: "s".into(),
        role: Role::Time,
    };
    let torques =
        Joint::all(model.joints()).map(|joint| torque(model, joint, "", "commanded", Role::Input));
    let mut all: Vec<Variable> = [time].into_iter().chain(torques).collect();
    let first = all.len();
    let states = states(model, names);
    let rates: Vec<Variable> = (states.iter().enumerate())
        .map(|(k, state)| rate(state, first + k))
        .collect();
    all.extend(states);
    all.extend(rates);
    all.extend(parameters(model, names));
    all
}

fn states(model: &ExportModel, names: &Names) -> Vec<Variable> {
    let of_joint = |joint: Joint, what: &str, per: &str| Variable {
        name: format!("joint[{joint}].{what}"),
        about: format!("{what} of joint {joint}"),
        unit: format!("{}{per}", model.units(joint)[0]),
        role: at_rest(0.0),
    };
    let positions = Joint::all(model.joints()).map(|joint| of_joint(joint, "position", ""));
    let velocities = Joint::all(model.joints()).map(|joint| of_joint(joint, "velocity", "/s"));
    let lagged = lags(model).into_iter().map(|joint| {
        let role = Role::State {
            output: false,
            start: 0.0,
        };
        torque(model, joint, "lagged_", "that acts after the lag", role)
    });
    let internal = model.internal().map(|(effect, state)| Variable {
        name: format!("{}{}", below(effect, names), names.field(&state.name)),
        about: format!(
            "{} of {} on joint {}",
            state.about, effect.name, effect.joint
        ),
        unit: state.unit.clone(),
        role: at_rest(state.start),
    });
    let of_motion = positions.chain(velocities);
    of_motion.chain(internal).chain(lagged).collect()
}

/// A state that is an output, with its value at rest.
fn at_rest(start: f64) -> Role {
    Role::State {
        output: true,
        start,
    }
}

/// Where the names of an effect's variables begin.
fn below(effect: &ExportedEffect, names: &Names) -> String {
    format!("joint[{}].{}.", effect.joint, names.field(&effect.name))
}

fn torque(model: &ExportModel, joint: Joint, prefix: &str, about: &str, role: Role) -> Variable {
    let what = match model.equations.driven_by() {
        Quantity::Command => "command",
        _ if model.system.prismatic[joint] => "force",
        _ => "torque",
    };
    Variable {
        name: format!("joint[{joint}].{prefix}{what}"),
        about: format!("{what} on joint {joint} {about}"),
        unit: model.units(joint)[1].into(),
        role,
    }
}

fn rate(state: &Variable, place: usize) -> Variable {
    let unit = match (state.unit.as_str(), state.unit.strip_suffix("/s")) {
        ("1", _) => "1/s".to_owned(),
        (_, Some(of)) => format!("{of}/s^2"),
        (unit, None) => format!("{unit}/s"),
    };
    Variable {
        name: format!("der({})", state.name),
        about: format!("rate of the {}", state.about),
        unit,
        role: Role::Rate { state: place },
    }
}

/// Parameters of an effect are named below its joint.
fn parameters(model: &ExportModel, names: &Names) -> impl Iterator<Item = Variable> {
    let place = |name: &str| {
        let effect = model.effect_of(name);
        effect.map_or_else(String::new, |effect| below(effect, names))
    };
    let parameters = model
        .equations
        .parameters
        .iter()
        .zip(model.parameter_notes());
    parameters.map(move |(parameter, about)| Variable {
        name: format!("{}{}", place(&parameter.name), names.field(&parameter.name)),
        about,
        unit: parameter.unit.clone(),
        role: Role::Parameter {
            value: parameter.value,
            bounds: parameter.bounds,
        },
    })
}
