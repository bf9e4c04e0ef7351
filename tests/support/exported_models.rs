//! One model of each kind that can be exported: equations, effects, filters of the command, networks; one joint and
//! two.

use std::path::Path;
use std::sync::OnceLock;

use rand_chacha::ChaCha8Rng;
use residyn::exported_task;
use residyn_core::model::{
    Angles, InputScaling, LastLayer, Library, MlpSettings, MlpWeights, Model, ModelWeights,
    ResidualOn,
};
use residyn_core::sim::{Integrator, SCHEMES};
use residyn_formats::ExportModel;
use serde_json::json;

use super::Scratch;
use super::catalogue::rng;

/// Friction, and a command that is delayed by a fraction of a step and then lagged.
const PENDULUM_EFFECTS: &str = r#"
[[effect]]
name = "coulomb_friction"
joint = 1
F_c = { value = 0.16, ci95 = [0.15, 0.17] }

[[effect]]
name = "actuator_delay"
joint = 1
d = 0.013

[[effect]]
name = "actuator_lag"
joint = 1
T = 0.02
"#;

/// A delay on one joint, a lag on the other.
const ACROBOT_EFFECTS: &str = r#"
[[effect]]
name = "actuator_delay"
joint = 1
d = 0.025

[[effect]]
name = "actuator_lag"
joint = 2
T = 0.01

[[effect]]
name = "stribeck_friction"
joint = 1
F_c = 0.1
F_s = 0.15
v_s = 0.2

[[effect]]
name = "actuator_saturation"
joint = 2
m = 4.0
"#;

/// Friction that gives before it slips.
const GIVING: &str = r#"
[[effect]]
name = "presliding"
joint = 1
F_c = 0.12
sigma_0 = 5.0
"#;

/// A motor behind a soft spring.
const ELASTIC: &str = r#"
[[effect]]
name = "joint_elasticity"
joint = 1
k = 20.0
d = 0.3
J_m = 0.05
sensor = 0
friction = 1
"#;

/// A motor with play.
const LOOSE: &str = r#"
[[effect]]
name = "motor_backlash"
joint = 1
delta = 0.04
k = 200
zeta = 0.5
J_m = 0.05
sensor = 1
friction = 0
"#;

/// A winding that heats up and friction that gives on one joint, friction that falls as it warms up on the other.
const WARMING: &str = r#"
[[effect]]
name = "winding_heat"
joint = 1
a = 0.2
T = 3.0

[[effect]]
name = "lugre_friction"
joint = 1
F_c = 0.12
F_s = 0.16
v_s = 0.3
sigma_0 = 5.0
sigma_1 = 0.05

[[effect]]
name = "coulomb_friction"
joint = 2
F_c = 0.1

[[effect]]
name = "thermal_friction"
joint = 2
a = 0.3
T = 8.0
"#;

/// All models, by name.
pub fn all() -> Vec<(&'static str, ExportModel)> {
    let fine = Integrator::fine(4.try_into().unwrap());
    let (euler, rk4) = (Integrator::SEMI_IMPLICIT_EULER, Integrator::RK4);
    let [pendulum, acrobot, cartpole, motor] =
        ["pendulum", "acrobot", "cartpole", "motor"].map(|name| system(name, ""));
    let friction = system("pendulum", PENDULUM_EFFECTS);
    let late = system("acrobot", ACROBOT_EFFECTS);
    let servo = system("servo", PENDULUM_EFFECTS);
    let [giving, elastic] = [GIVING, ELASTIC].map(|effects| system("pendulum", effects));
    let warming = system("acrobot", WARMING);
    let mut random = rng(7);
    let forces =
        [Angles::Raw, Angles::SinCos].map(|angles| settings(angles, ResidualOn::Accelerations));
    let rates = settings(Angles::SinCos, ResidualOn::Derivative);
    let mut small = |joints, settings: &MlpSettings| network(joints, settings, &mut random);
    let [a, b, c] = [small(1, &rates), small(2, &forces[0]), small(2, &forces[1])];
    let [d, e] = [small(1, &forces[1]), small(2, &rates)];
    let f = small(1, &forces[1]);
    let mut models = vec![
        ("pendulum", physics(&pendulum, euler, 0.02)),
        ("pendulum_effects", physics(&friction, rk4, 0.01)),
        ("pendulum_hybrid", hybrid(&friction, a, euler, 0.02)),
        ("pendulum_data", data_driven(&pendulum, d, rk4, 0.02)),
        ("acrobot", physics(&acrobot, fine, 0.02)),
        ("acrobot_effects", physics(&late, fine, 0.01)),
        ("acrobot_hybrid", hybrid(&late, c, euler, 0.01)),
        ("acrobot_data", data_driven(&acrobot, e, fine, 0.02)),
        ("cartpole", physics(&cartpole, rk4, 0.02)),
        ("servo", physics(&servo, rk4, 0.01)),
        ("motor", physics(&motor, rk4, 0.01)),
        ("cartpole_hybrid", hybrid(&cartpole, b, rk4, 0.02)),
        ("pendulum_elastic", physics(&elastic, rk4, 0.01)),
        ("pendulum_giving", hybrid(&giving, f, euler, 0.01)),
        ("acrobot_warming", physics(&warming, rk4, 0.01)),
    ];
    models.extend(SCHEMES.map(|scheme| {
        let integrator = Integrator::of(scheme);
        (scheme.name, physics(&acrobot, integrator, 0.02))
    }));
    models
}

/// A motor that rattles in its play: in single precision, motions from the same start soon differ.
pub fn loose() -> (&'static str, ExportModel) {
    let system = system("pendulum", LOOSE);
    (
        "pendulum_loose",
        physics(&system, Integrator::fine(4.try_into().unwrap()), 0.01),
    )
}

/// A built-in system with effects appended to its file.
pub fn system(name: &str, effects: &str) -> Model {
    let library = Library::built_in();
    let declared = library.model(name).unwrap();
    Model::from_text(
        Path::new(name),
        &(declared.text + effects),
        library.effects(),
    )
    .unwrap()
}

fn physics(system: &Model, integrator: Integrator, step_s: f64) -> ExportModel {
    ExportModel::of_system(system, integrator, step_s, origin(system))
        .with_task(exported_task(&system.name))
}

fn hybrid(system: &Model, residual: MlpWeights, integrator: Integrator, step: f64) -> ExportModel {
    ExportModel {
        residual: Some(residual),
        ..physics(system, integrator, step)
    }
}

fn data_driven(system: &Model, prior: MlpWeights, by: Integrator, step_s: f64) -> ExportModel {
    let numbers = ModelWeights {
        parameters: Vec::new(),
        prior: Some(prior),
        residual: None,
    };
    ExportModel::new(system, numbers, by, step_s, origin(system))
        .with_task(exported_task(&system.name))
}

fn origin(system: &Model) -> serde_json::Value {
    json!({"config": {"model": system.name}, "seed": 7})
}

fn settings(angles: Angles, on: ResidualOn) -> MlpSettings {
    MlpSettings {
        hidden: vec![8, 6],
        angles,
        on,
    }
}

/// A random network with scaled features and outputs that are small relative to the derivative.
fn network(joints: usize, settings: &MlpSettings, random: &mut ChaCha8Rng) -> MlpWeights {
    let features = settings.angles.features(joints);
    let scaling = InputScaling {
        mean: (0..features).map(|k| 0.125 * k as f64 - 0.25).collect(),
        std: (0..features).map(|k| 1.0 + 0.5 * k as f64).collect(),
    };
    let mut network = MlpWeights::new(joints, settings, scaling, LastLayer::Random, random);
    let last = network.layers.last_mut().unwrap();
    for number in last.weight.iter_mut().chain(&mut last.bias) {
        *number *= 0.25;
    }
    network
}

/// A model that the program exported as JSON, with its weights in a file next to it.
pub fn exported() -> &'static Path {
    static FOLDER: OnceLock<Scratch> = OnceLock::new();
    let folder = FOLDER.get_or_init(|| {
        let scratch = Scratch::new();
        let given = format!("--checkpoint $REPO/{CHECKPOINT} --format json");
        scratch.succeeds(&format!("export {given} --out model.json"));
        scratch
    });
    folder.folder()
}

/// A checkpoint of a hybrid model.
pub const CHECKPOINT: &str = "checkpoints/pendulum-sim";
