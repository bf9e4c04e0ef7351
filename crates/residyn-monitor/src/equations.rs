//! The residual of the generalised forces and its regressors, as one program.

use residyn_core::data::Joint;
use residyn_core::expr::{Graph, Node, Tape};
use residyn_core::lanes::Row;
use residyn_core::model::{Dynamics, FittedEffect, Library, Model};

use super::grid::Sample;
use super::hypothesis::Hypothesis;
use super::{Kind, MonitorError, Settings};

/// Samples that are evaluated side by side: one AVX-512 register or two AVX2 registers of f64.
pub(crate) const LANES: usize = 8;

/// 95 % intervals of normal distributions are this many standard deviations wide.
const INTERVAL: f64 = 3.92;

/// An encoder's zero is known within this before any data, rad (or m).
const ZERO_PRIOR: f64 = 0.05;

/// The residual of each joint and the derivatives by which hypotheses change it.
pub(crate) struct Equations {
    tape: Tape<f64, LANES>,
    pub joints: usize,
    /// Whether directions and accelerations are inputs (a torque balance), or accelerations are compared.
    is_balance: bool,
    /// The hypotheses that change the residual of each joint.
    pub columns_of: Vec<Vec<usize>>,
}

/// Compiles a model with all that may change in it.
pub(crate) fn compile(
    model: &Model,
    settings: &Settings,
) -> Result<(Equations, Vec<Hypothesis>), MonitorError> {
    let extended = with_candidates(model, settings);
    let (compiled, is_balance) = match extended.smoothed_torque_balance() {
        Some(balance) => (balance, true),
        None => (extended.dynamics(), false),
    };
    let mut stateful = model.effects.iter();
    if let Some(effect) = stateful.find(|effect| !effect.effect.states.is_empty()) {
        return Err(MonitorError::InternalStates {
            model: model.name.clone(),
            effect: effect.label(),
        });
    }
    let values = compiled.values();
    let first = compiled.program.inputs().len() - values.len();
    let mut graph = Graph::new();
    let names = compiled.program.inputs().iter();
    let inputs: Vec<Node> = names.map(|name| graph.input(name)).collect();
    let outputs = graph.append(&compiled.program, &inputs);
    let joints = model.joints;
    // Positive where more torque, or acceleration, is there than the model explains.
    let residuals: Vec<Node> = match is_balance {
        true => outputs,
        false => outputs[joints..2 * joints].to_vec(),
    };
    let parameters: Vec<usize> = (0..values.len()).collect();
    let wrt: Vec<Node> = parameters.iter().map(|k| inputs[first + k]).collect();
    let slopes = graph.jacobian(&residuals, &wrt);
    let rows_of = |k: usize| -> Vec<usize> {
        (0..joints)
            .filter(|j| !graph.is_zero(slopes[*j][k]))
            .collect()
    };
    let candidates = candidates(model, &extended, &compiled, rows_of);
    if !(candidates.iter()).any(|(_, candidate)| candidate.kind != Kind::EncoderZero) {
        return Err(MonitorError::NothingFree {
            model: model.name.clone(),
        });
    }
    let mut all = residuals;
    let mut columns_of = Vec::new();
    for of_joint in &slopes {
        let own = candidates.iter().enumerate();
        let own = own.filter(|(_, (k, _))| !graph.is_zero(of_joint[*k]));
        columns_of.push(
            own.map(|(column, (k, _))| {
                all.push(of_joint[*k]);
                column
            })
            .collect(),
        );
    }
    let equations = Equations {
        tape: graph.finish(&all).tape_at(first, &values),
        joints,
        is_balance,
        columns_of,
    };
    Ok((
        equations,
        candidates.into_iter().map(|(_, own)| own).collect(),
    ))
}

/// The model with a zero of each encoder and a load at each tip, none of which is there.
fn with_candidates(model: &Model, settings: &Settings) -> Model {
    let library = Library::built_in();
    let mut effects = model.effects.clone();
    let mut add = |mut effect: FittedEffect, values: &[f64]| {
        for (value, given) in effect.values.iter_mut().zip(values) {
            value.0 = *given;
        }
        if model.check_effect(&effect, &effects).is_ok() {
            effects.push(effect);
        }
    };
    for joint in Joint::all(model.joints) {
        if let Ok(offset) = library.effect("sensor_offset") {
            add(FittedEffect::absent(offset, joint), &[]);
        }
        if let Ok(payload) = library.effect("payload") {
            let [x, y, z] = settings
                .payload_at
                .unwrap_or_else(|| centre_of_mass(model, joint));
            add(FittedEffect::absent(payload, joint), &[0.0, x, y, z]);
        }
    }
    model.with_effects(effects)
}

/// Of the body that a joint moves, in its frame; its origin if the file does not give one body a joint.
fn centre_of_mass(model: &Model, joint: Joint) -> [f64; 3] {
    let bodies = model.inertias();
    if bodies.len() != model.joints {
        return [0.0; 3];
    }
    let part = |k: usize| model.parameters[bodies[joint][k]].value;
    match part(0) > 0.0 {
        true => [1, 2, 3].map(|k| part(k) / part(0)),
        false => [0.0; 3],
    }
}

/// What may change, with the index of its parameter: each free parameter of one joint, the zeros, the loads, and in a model
/// that is no tree of bodies the masses that the outermost joint moves.
fn candidates(
    model: &Model,
    extended: &Model,
    compiled: &Dynamics,
    rows_of: impl Fn(usize) -> Vec<usize>,
) -> Vec<(usize, Hypothesis)> {
    let owners = owners(extended);
    let declared = model.parameters.len();
    let own_effects = model.effects.len();
    let is_tree = !model.inertias().is_empty();
    let mut found = Vec::new();
    for (k, parameter) in compiled.parameters.iter().enumerate() {
        let rows = rows_of(k);
        let Some(outermost) = rows.last().map(|row| Joint::at(*row)) else {
            continue;
        };
        let owner = k.checked_sub(declared).map(|k| owners[k]);
        let effect = owner.map(|(effect, _)| &extended.effects[effect]);
        let is_added = owner.is_some_and(|(effect, _)| effect >= own_effects);
        let is_first = owner.is_some_and(|(_, place)| place == 0);
        let is_named = |name: &str| effect.is_some_and(|effect| effect.effect.name == name);
        let is_mass =
            !is_tree && parameter.unit == "kg" && outermost.next().index() == model.joints;
        let kind = match () {
            () if is_named("sensor_offset") => Kind::EncoderZero,
            // Where a load sits changes nothing while there is none.
            () if is_named("payload") && is_first => Kind::Payload,
            () if parameter.fixed || is_added => continue,
            () if effect.is_some() || rows.len() == 1 => Kind::Parameter,
            () if is_mass => Kind::Payload,
            () => continue,
        };
        let joint = effect.map_or(outermost, |effect| effect.joint);
        let what = effect.map(|effect| effect.effect.name.replace('_', " "));
        found.push((
            k,
            Hypothesis {
                kind,
                joint,
                what: what.unwrap_or_else(|| parameter.name.clone()),
                name: parameter.name.clone(),
                unit: parameter.unit.clone(),
                value: parameter.value,
                bounds: parameter.bounds,
                prior: match (kind, parameter.ci95) {
                    (Kind::EncoderZero, _) => ZERO_PRIOR,
                    (_, Some([low, high])) if high > low => (high - low) / INTERVAL,
                    _ => parameter.scale,
                },
            },
        ));
    }
    found
}

/// For each parameter of an effect, in their order, its effect and its place there.
fn owners(model: &Model) -> Vec<(usize, usize)> {
    let effects = model.effects.iter().enumerate();
    let of_effect = |(index, effect): (usize, &FittedEffect)| {
        (0..effect.values.len())
            .map(move |place| (index, place))
            .collect::<Vec<_>>()
    };
    effects.flat_map(of_effect).collect()
}

impl Equations {
    /// The residual of each joint at samples, and by how much a unit of each of its columns raises it: `see(sample, joint,
    /// residual, regressors)`.
    pub fn over(&mut self, samples: &[Sample], mut see: impl FnMut(usize, usize, f64, &[f64])) {
        let mut regressors = Vec::new();
        for (group, samples) in samples.chunks(LANES).enumerate() {
            let of_lane = |lane: usize| &samples[lane.min(samples.len() - 1)];
            let mut at = 0;
            let slots = self.tape.moving();
            let mut put = |of: fn(&Sample) -> &[f64]| {
                for k in 0..of(of_lane(0)).len() {
                    slots[at] = Row::from_fn(|lane| of(of_lane(lane))[k]);
                    at += 1;
                }
            };
            put(|sample| &sample.q);
            put(|sample| &sample.qd);
            put(|sample| &sample.driven);
            put(|sample| &sample.measured);
            put(|sample| std::slice::from_ref(&sample.time));
            if self.is_balance {
                put(|sample| &sample.qdd);
                put(|sample| &sample.directions);
            }
            self.tape.run();
            let mut next = self.joints;
            for joint in 0..self.joints {
                let columns = next..next + self.columns_of[joint].len();
                next = columns.end;
                for (lane, sample) in samples.iter().enumerate() {
                    let output = self.tape.output(joint)[lane];
                    // Less what the model needs: the residual vanishes at the true values, r + slope * change = 0.
                    let residual = match self.is_balance {
                        true => output,
                        false => output - sample.qdd[joint],
                    };
                    regressors.clear();
                    regressors.extend(columns.clone().map(|k| -self.tape.output(k)[lane]));
                    see(group * LANES + lane, joint, residual, &regressors);
                }
            }
        }
    }
}
