//! Python: one module that needs only numpy, with the step, the derivative and the reward, and a gymnasium environment
//! if gymnasium is installed.

mod notation;

use std::collections::BTreeSet;
use std::fmt::Write;
use std::path::Path;

use serde_json::json;

use super::discrete_filter::{Combination, DiscreteFilter};
use super::template::filled;
use super::verify::{Client, PythonClient};
use super::{ExportError, ExportModel, ExportedTask, File, Format};
use notation::{Python, literal};
use residyn_core::data::Joint;
use residyn_core::expr::Program;
use residyn_core::model::{Angles, MlpWeights, ResidualOn};
use residyn_core::sim::Scheme;

pub(super) const FORMAT: Format = Format {
    name: "python",
    about: "a numpy module with the step, the derivative and the reward; an environment if gymnasium is installed",
    extension: "py",
    not_carried,
    files,
    client: Client::Python(PythonClient {
        name: "module.py",
        script: include_str!("../../../../docs/clients/module.py"),
        packages: "numpy",
    }),
    tolerance: 1e-9,
    robots: None,
};

const STEP: &str = include_str!("step.py");
const SEMI_IMPLICIT: &str = include_str!("semi_implicit.py");
const RUNGE_KUTTA: &str = include_str!("runge_kutta.py");
const ENVIRONMENT: &str = include_str!("environment.py");

fn not_carried(model: &ExportModel) -> Vec<String> {
    let mut lost = Vec::new();
    if model.task.is_none() {
        lost.push(format!(
            "a reward and an environment: no built-in task is for `{}`",
            model.name()
        ));
    }
    if !DiscreteFilter::all(model).is_empty() {
        lost.push(format!(
            "other values of delays and lags, and steps other than {} s: the code is written for these",
            model.step_s
        ));
    }
    lost.extend(model.sensors_not_carried());
    lost
}

fn files(model: &ExportModel, path: &Path) -> Result<Vec<File>, ExportError> {
    let about = match &model.task {
        Some(task) => format!(
            "module with step, derivative and the reward of {}",
            task.name
        ),
        None => "module with step and derivative".to_owned(),
    };
    let module = module(model);
    Ok(vec![File::new(path, module, about)])
}

fn module(model: &ExportModel) -> String {
    let mut out = head(model);
    constants(&mut out, model);
    derivative(&mut out, model);
    let begun = match model.internal().next() {
        Some(_) => ", begun=state, length=h",
        None => "",
    };
    out += &filled(&advance(model.integrator.scheme()), &[("BEGUN", &begun)]);
    out += STEP;
    if let Some(task) = &model.task {
        reward(&mut out, task);
        out += ENVIRONMENT;
    }
    out
}

fn head(model: &ExportModel) -> String {
    let n = model.joints();
    let units: Vec<String> = Joint::all(n)
        .map(|joint| format!("joint {joint} in {}", model.units(joint).join(" and ")))
        .collect();
    let about = json!(model.system.about).to_string();
    let provenance = json!(model.provenance().to_string());
    format!(
        "\"\"\"A model of {}: step and derivative for numpy.\n\n\
         A state is {n} position{s}, then the velocities{of_effects}; positions and {driving} are of {}.\n\
         All functions take single rows or any number of them in front.\n\"\"\"\n\n\
         import json\n\n\
         import numpy as np\n\n\
         ABOUT = {about}\n\
         # The program that wrote this module, and the configuration of the run that made the model.\n\
         PROVENANCE = json.loads({provenance})\n",
        plain(model.name()),
        units.join(", "),
        driving = model.driving(),
        of_effects = (model.internal_labels())
            .map(|label| format!(", then {label}"))
            .collect::<String>(),
        s = if n == 1 { "" } else { "s" },
    )
}

/// The step of a scheme.
fn advance(scheme: &Scheme) -> String {
    if scheme.semi_implicit {
        return SEMI_IMPLICIT.to_owned();
    }
    let stages = scheme.stages.iter().map(|stage| {
        let numbers = [stage.time, stage.reach, stage.weight].map(literal);
        format!("({})", numbers.join(", "))
    });
    let stages = stages.collect::<Vec<_>>().join(", ");
    filled(
        RUNGE_KUTTA,
        &[("TITLE", &scheme.title), ("STAGES", &stages)],
    )
}

fn constants(out: &mut String, model: &ExportModel) {
    let substeps = model.integrator.substeps();
    let _ = write!(
        out,
        "\nJOINTS = {}\n# How long a torque is held, in s.\nSTEP = {}\nSUBSTEPS = {substeps}\n",
        model.joints(),
        literal(model.step_s)
    );
    *out += "\nPARAMETERS = {\n";
    for p in &model.equations.parameters {
        let interval = p.ci95.map_or_else(String::new, |[low, high]| {
            format!(", 95 % interval {low} to {high}")
        });
        let (name, value) = (json!(p.name), literal(p.value));
        let _ = writeln!(out, "    {name}: {value},  # {}{interval}", unit(&p.unit));
    }
    *out += "}\n";
    if !model.effects.is_empty() {
        *out += "\n# Effects in the equations.\nEFFECTS = [\n";
        for effect in &model.effects {
            let _ = writeln!(out, "    {},", json!(effect));
        }
        *out += "]\n";
    }
    let rest: Vec<String> = model.rest().iter().map(|value| literal(*value)).collect();
    let _ = write!(
        out,
        "\n# The state at rest.\nSTART = np.array([{}])\n",
        rest.join(", ")
    );
    filters(out, model);
    for (name, network) in networks(model) {
        layers(out, &name, network);
    }
}

fn unit(unit: &str) -> String {
    if unit.is_empty() {
        return "1".to_owned();
    }
    plain(unit)
}

/// Text without quotes, backslashes and line breaks, for comments and docstrings.
fn plain(text: &str) -> String {
    text.replace(['"', '\\'], "'")
        .replace(char::is_control, " ")
}

/// The networks, each with the name of its constant.
fn networks(model: &ExportModel) -> impl Iterator<Item = (String, &MlpWeights)> {
    let networks = model.networks();
    networks.map(|(name, network)| (name.to_uppercase(), network))
}

fn filters(out: &mut String, model: &ExportModel) {
    let filters = DiscreteFilter::all(model);
    if filters.is_empty() {
        *out += "\n# Commanded torques act as they are: no delay, no lag.\nFILTERS = []\n";
        return;
    }
    *out += "\n# Delay and lag between commanded torques and those that act. Coefficients are of the lagged torque, of\n\
             # the torque that acts when a step begins, and of the one that replaces it.\nFILTERS = [\n";
    for filter in filters {
        let row = |sum: &Combination| {
            let factors = [sum.lagged, sum.first, sum.then].map(literal);
            format!("[{}]", factors.join(", "))
        };
        let mean: Vec<String> = filter.mean.iter().map(row).collect();
        let _ = writeln!(
            out,
            "    {{\"joint\": {}, \"past\": {}, \"lags\": {}, \"places\": {:?}, \"mean\": [{}], \"end\": {}}},",
            filter.joint.index(),
            filter.past,
            if filter.lags { "True" } else { "False" },
            filter.places,
            mean.join(", "),
            row(&filter.end)
        );
    }
    *out += "]\n";
}

fn layers(out: &mut String, name: &str, network: &MlpWeights) {
    let vector = |numbers: &[f64]| {
        let numbers: Vec<String> = numbers.iter().map(|x| literal(*x)).collect();
        format!("[{}]", numbers.join(", "))
    };
    let scaling = &network.scaling;
    let _ = write!(
        out,
        "\n{name} = {{\n    \"mean\": np.array({}),\n    \"std\": np.array({}),\n    \"layers\": [\n",
        vector(&scaling.mean),
        vector(&scaling.std)
    );
    for layer in &network.layers {
        let rows: Vec<String> = layer.weight.chunks(layer.inputs).map(vector).collect();
        let _ = writeln!(
            out,
            "        (np.array([{}]), np.array({})),",
            rows.join(", "),
            vector(&layer.bias)
        );
    }
    *out += "    ],\n}\n";
}

/// The right-hand side, networks included.
fn derivative(out: &mut String, model: &ExportModel) {
    let n = model.joints();
    if networks(model).next().is_some() {
        *out += "\n\ndef _network(network, features):\n    \
                 x = (np.stack(np.broadcast_arrays(*features), axis=-1) - network[\"mean\"]) / network[\"std\"]\n    \
                 *hidden, (weight, bias) = network[\"layers\"]\n    \
                 for inner, offset in hidden:\n        x = np.maximum(x @ inner.T + offset, 0.0)\n    \
                 return np.moveaxis(x @ weight.T + bias, -1, 0)\n";
    }
    *out += match model.internal().next() {
        None => {
            "\n\ndef derivative(state, torque, time=0.0, parameters=None):\n    \
             \"\"\"ds/dt: velocities, then accelerations, while `torque` acts.\"\"\"\n"
        }
        Some(_) => {
            "\n\ndef derivative(state, torque, time=0.0, parameters=None, begun=None, length=0.0):\n    \
             \"\"\"ds/dt: velocities, accelerations, then rates of the states of effects, while `torque` acts.\n\n    \
             Within a step of this length from `begun`, these are their mean rates over the step.\n    \"\"\"\n    \
             begun, step_s = state if begun is None else begun, length\n"
        }
    };
    *out += "    p = PARAMETERS if parameters is None else parameters\n";
    let names = |stem: &str| -> Vec<String> { (1..=n).map(|j| format!("{stem}{j}")).collect() };
    let list = |names: &[String]| format!("[{}]", names.join(", "));
    let driven = model.equations.driven_by().key();
    let (q, qd, tau) = (names("q"), names("qd"), names(driven));
    let of_effects = model.internal().map(|(_, state)| state.name.clone());
    let of_effects: Vec<String> = of_effects.collect();
    let before = of_effects.iter().map(|name| format!("{name}_before"));
    let motion = vec!["_".to_owned(); 2 * n];
    let begun: Vec<String> = motion.into_iter().chain(before).collect();
    let state = [q.as_slice(), &qd, &of_effects].concat();
    let mut given = vec![(&state, "state"), (&tau, "torque")];
    if !of_effects.is_empty() {
        given.push((&begun, "begun"));
    }
    for (names, from) in given {
        let _ = writeln!(
            out,
            "    {} = np.moveaxis(np.asarray({from}, float), -1, 0)",
            list(names)
        );
    }
    let of_motion = ["rate_of_q", "rate_of_qd"].map(names).concat();
    let of_effects = of_effects.iter().map(|name| format!("rate_of_{name}"));
    let rates: Vec<String> = of_motion.into_iter().chain(of_effects).collect();
    let parameters = model.equations.parameters.iter().map(|p| p.name.clone());
    statements(out, &model.equations.program, &rates, parameters.collect());
    for (name, network) in networks(model) {
        let mut features: Vec<String> = match network.angles {
            Angles::Raw => q.clone(),
            Angles::SinCos => ["sin", "cos"]
                .iter()
                .flat_map(|f| q.iter().map(move |q| format!("np.{f}({q})")))
                .collect(),
        };
        features.extend(qd.iter().chain(&tau).cloned());
        let _ = writeln!(
            out,
            "    parts = _network({name}, [{}])",
            features.join(", ")
        );
        let first = match network.on {
            ResidualOn::Accelerations => n,
            ResidualOn::Derivative => 0,
        };
        for (k, rate) in rates[first..2 * n].iter().enumerate() {
            let _ = writeln!(out, "    {rate} = {rate} + parts[{k}]");
        }
    }
    let _ = writeln!(
        out,
        "    return np.stack(np.broadcast_arrays({}), axis=-1)",
        rates.join(", ")
    );
}

fn statements(
    out: &mut String,
    program: &Program,
    outputs: &[String],
    parameters: BTreeSet<String>,
) {
    let outputs: Vec<&str> = outputs.iter().map(String::as_str).collect();
    for (left, right) in program.assignments(&Python { parameters }, &outputs) {
        let _ = writeln!(out, "    {left} = {right}");
    }
}

fn reward(out: &mut String, task: &ExportedTask) {
    let n = task.torque.len();
    let names = |stem: &str| -> String {
        let names: Vec<_> = (1..=n).map(|j| format!("{stem}{j}")).collect();
        names.join(", ")
    };
    let _ = write!(
        out,
        "\n\ndef reward(state, torque, time=0.0):\n    \
         \"\"\"Of a step that leads to `state` while `torque` is held: {}.\"\"\"\n    \
         [{}, {}] = np.moveaxis(np.asarray(state, float)[..., :{}], -1, 0)\n    \
         [{}] = np.moveaxis(np.asarray(torque, float), -1, 0)\n",
        task.objective,
        names("q"),
        names("qd"),
        2 * n,
        names("tau"),
    );
    let reward = ["reward".to_owned()];
    statements(out, &task.reward, &reward, BTreeSet::new());
    *out += "    return reward\n";
    let range = |k: usize| -> Vec<f64> { task.torque.iter().map(|range| range[k]).collect() };
    let _ = write!(
        out,
        "\n\n# What the environment is to do: {}.\n\
         TASK = {{\n    \"low\": {:?},\n    \"high\": {:?},\n    \"start\": {:?},\n    \"spread\": {:?},\n    \
         \"steps\": {},\n    \"hold_s\": {:?},\n}}\n",
        task.about,
        range(0),
        range(1),
        task.start,
        task.start_spread,
        task.steps,
        task.step_s
    );
}
