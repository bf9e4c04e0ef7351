//! The catalogue of systems and effects, random points, comparisons.

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use residyn::with_effects_in;
use residyn_core::data::Joint;
use residyn_core::expr::{Graph, Program, SignForm};
use residyn_core::lanes::Row;
use residyn_core::model::{ActsOn, Dynamics, Effect, Entry, FittedEffect, Library, Model};

pub fn rng(seed: u64) -> ChaCha8Rng {
    ChaCha8Rng::seed_from_u64(seed)
}

pub fn system(name: &str) -> Model {
    Library::built_in().model(name).unwrap()
}

pub fn all_systems() -> Vec<Model> {
    Library::system_names().iter().map(|n| system(n)).collect()
}

/// An effect on a joint (counted from 0) with these values.
pub fn fitted(effect: &Effect, joint: usize, values: &[f64]) -> FittedEffect {
    assert_eq!(effect.parameters.len(), values.len());
    FittedEffect {
        effect: effect.clone(),
        joint: Joint::at(joint),
        values: values.iter().map(|value| (*value, None)).collect(),
        own: Vec::new(),
        fixed: false,
        status: None,
    }
}

/// A built-in effect on a joint (counted from 0) with these values.
pub fn effect(name: &str, joint: usize, values: &[f64]) -> FittedEffect {
    fitted(Library::built_in().effect(name).unwrap(), joint, values)
}

/// Uses the same form of the sign on every joint.
pub fn dynamics(system: &Model, effects: &[FittedEffect], sign: SignForm) -> Dynamics {
    let width = match sign {
        SignForm::Exact => 0.0,
        SignForm::Smooth { width } => width,
    };
    let model = system.with_effects(effects.to_vec());
    model
        .with_smoothing_velocities(vec![width; system.joints])
        .dynamics()
}

/// Whether the effect can act on that joint.
pub fn can_act(system: &Model, effect: &Effect, joint: usize) -> bool {
    let inertia = matches!(effect.entry, Entry::Inertia(_) | Entry::Coupling(_));
    let slides = &system.prismatic;
    let alone = joint + 1 == system.joints || slides[joint] != slides[joint + 1];
    !(inertia && !system.has_mass_matrix()
        || effect.acts_on == ActsOn::First && joint > 0
        || effect.acts_on == ActsOn::Turning && slides[joint]
        || effect.is_coupling() && alone
        || matches!(effect.entry, Entry::Payload(_)))
}

/// An effect as a user would write it in a folder of effects.
pub const USER_EFFECT: &str = r#"
[effect]
name = "eddy_brake"
about = "eddy currents: strongest at a certain speed"
force = "-2 * T_m * qd / (v_m + qd^2 / v_m)"

[parameters]
T_m = { unit = "N m", typical = 0.3, positive = true }
v_m = { unit = "rad/s", typical = 2.0, bounds = [0.01, 100] }
"#;

/// The built-in library with [`USER_EFFECT`] read from a folder.
pub fn library_with_user_effect() -> Library {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("eddy_brake.toml"), USER_EFFECT).unwrap();
    with_effects_in(folder.path(), Library::built_in()).unwrap()
}

/// A model of the catalog: a system alone, or with one effect on one joint.
pub struct Case {
    pub name: String,
    pub dynamics: Dynamics,
}

/// Every system alone and with every effect (and every probe shape) on every joint on which the effect can act.
pub fn catalog(sign: SignForm) -> Vec<Case> {
    let library = library_with_user_effect();
    let mut cases = Vec::new();
    for system in all_systems() {
        cases.push(Case {
            name: system.name.clone(),
            dynamics: dynamics(&system, &[], sign),
        });
        for effect in library.effects().iter().chain(library.probes()) {
            let joints = (0..system.joints).filter(|j| can_act(&system, effect, *j));
            cases.extend(joints.map(|joint| {
                let typical: Vec<f64> = effect.parameters.iter().map(|p| p.typical).collect();
                let effects = [fitted(effect, joint, &typical)];
                Case {
                    name: format!(
                        "{} with {} on joint {}",
                        system.name,
                        effect.name,
                        Joint::at(joint)
                    ),
                    dynamics: dynamics(&system, &effects, sign),
                }
            }));
        }
    }
    cases
}

/// Inputs of a program of dynamics: states, torques, time, what describes the step, parameters, all exact in f32.
///
/// Parameters vary by a quarter about their declared or typical values: masses stay positive, and the number of cogs
/// need not be whole.
pub fn point(dynamics: &Dynamics, rng: &mut ChaCha8Rng) -> Vec<f64> {
    let n = dynamics.joints;
    let layout = dynamics.layout();
    let internal = vec![0.02; layout.internal().len()];
    let bounds = [vec![3.0; n], vec![4.0; n], internal, vec![2.0; n]].concat();
    let mut inputs: Vec<f64> = bounds.iter().map(|b| rng.random_range(-b..*b)).collect();
    inputs.push(rng.random_range(0.0..5.0));
    if !layout.internal().is_empty() {
        inputs.extend(inputs[layout.internal()].to_vec());
        inputs.push(rng.random_range(0.001..0.02));
    }
    for parameter in &dynamics.parameters {
        inputs.push(parameter.value * rng.random_range(0.75..1.25));
    }
    inputs.into_iter().map(|x| f64::from(x as f32)).collect()
}

pub fn points(dynamics: &Dynamics, count: usize, seed: u64) -> Vec<Vec<f64>> {
    let mut rng = rng(seed);
    (0..count).map(|_| point(dynamics, &mut rng)).collect()
}

/// The derivatives of the accelerations with respect to every input, `[joint * inputs + input]`.
pub fn jacobian(dynamics: &Dynamics) -> Program {
    let mut graph = Graph::new();
    let names = dynamics.program.inputs();
    let inputs: Vec<_> = names.iter().map(|name| graph.input(name)).collect();
    let outputs = graph.append(&dynamics.program, &inputs);
    let rows = graph.jacobian(&outputs[dynamics.joints..], &inputs);
    graph.finish(&rows.concat())
}

/// The program in f32, 16 points side by side: `[point][output]`.
pub fn in_f32(program: &Program, points: &[Vec<f64>]) -> Vec<Vec<f64>> {
    let mut tape = program.tape::<f32, 16>();
    let mut found = Vec::new();
    for points in points.chunks(16) {
        for (k, slot) in tape.inputs().iter_mut().enumerate() {
            *slot = Row(std::array::from_fn(|lane| {
                points[lane.min(points.len() - 1)][k] as f32
            }));
        }
        tape.run();
        found.extend((0..points.len()).map(|lane| {
            let outputs = 0..program.output_count();
            outputs.map(|o| f64::from(tape.output(o)[lane])).collect()
        }));
    }
    found
}

/// Fails unless the energy `[total, power, d total / d state..]` of a model changes by the power of the torques at each
/// point, within this share of the terms that cancel.
#[track_caller]
pub fn assert_energy_balanced(model: &Dynamics, energy: &Program, points: &[Vec<f64>], share: f64) {
    for point in points {
        let (rates, energy) = (model.program.eval(point), energy.eval(point));
        let (power, slopes) = (energy[1], &energy[2..]);
        let parts: Vec<f64> = slopes.iter().zip(&rates).map(|(s, r)| s * r).collect();
        let change: f64 = parts.iter().sum();
        let size: f64 = parts.iter().map(|part| part.abs()).sum();
        assert!(
            (change - power).abs() <= share * size,
            "{}: {change} or {power} of {size}",
            model.name
        );
    }
}

/// The k-th entry of every point.
pub fn column(points: &[Vec<f64>], k: usize) -> Vec<f64> {
    points.iter().map(|point| point[k]).collect()
}

/// Fails unless `found` is within `share` of `wanted`, or of 1 if that is smaller.
#[track_caller]
pub fn assert_near(found: f64, wanted: f64, share: f64, what: &str) {
    let off = (found - wanted).abs() / wanted.abs().max(1.0);
    assert!(
        off <= share,
        "{what}: found {found}, wanted {wanted}, off by {off:e}"
    );
}

/// Fails unless each number is near the wanted one, as in [`assert_near`].
#[track_caller]
pub fn assert_all_near(found: &[f64], wanted: &[f64], share: f64, what: &str) {
    assert_eq!(found.len(), wanted.len(), "{what}");
    for (found, wanted) in found.iter().zip(wanted) {
        assert_near(*found, *wanted, share, what);
    }
}
