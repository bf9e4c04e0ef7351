//! One piece of work, again and again, for a count of the instructions that it takes: `benches/instructions` runs this
//! under valgrind. Nothing here depends on time, on addresses or on the number of cores.
//!
//!     instructions WORK TIMES

use std::hint::black_box;
use std::ops::ControlFlow;
use std::path::Path;

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use residyn::data::Log;
use residyn::identify::{Shooting, cut, predicted_cost};
use residyn::model::{Dynamics, InputScaling, LastLayer, Library, MlpSettings, MlpWeights, Model};
use residyn::plan::Objective;
use residyn::plant::Plant;
use residyn::sim::Integrator;
use residyn::sim::batch::{Rollouts, Rows};
use residyn::train::{Backend, FitSettings, HybridModel, Segments, Training};

const STEP_S: f64 = 0.02;
/// Steps of a rollout.
const HORIZON: usize = 30;
/// Transitions of a training epoch.
const TRANSITIONS: usize = 512;
/// Length of a window of the Gauss-Newton step, s.
const WINDOW_S: f64 = 0.5;
/// Standard deviation of the sensor, rad.
const NOISE: f64 = 1e-3;

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [work, times] = arguments.as_slice() else {
        panic!("usage: instructions WORK TIMES");
    };
    let times = times.parse().expect("a number of times");
    match work.as_str() {
        "rollout-pendulum" => rollout("pendulum", "cos(q1)", times),
        "rollout-acrobot" => rollout("acrobot", "2 - 1.5 * cos(q1) - cos(q1 + q2)", times),
        "epoch-pendulum" => epochs("pendulum", times),
        "epoch-acrobot" => epochs("acrobot", times),
        "gauss-newton-step" => gauss_newton_steps(times),
        "parse" => parse(times),
        other => panic!("unknown work {other}"),
    }
}

fn system(name: &str) -> Model {
    let system = Library::built_in().model(Path::new(name));
    system.expect("a built-in system")
}

fn dynamics(name: &str) -> Dynamics {
    let system = system(name);
    system.dynamics()
}

/// The published network for so many joints.
fn network(joints: usize) -> MlpWeights {
    let settings = MlpSettings::for_joints(joints);
    let scaling = InputScaling::identity(settings.angles.features(joints));
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    MlpWeights::new(joints, &settings, scaling, LastLayer::Random, &mut rng)
}

/// Rollouts of one block of candidates.
fn rollout(name: &str, reward: &str, times: usize) {
    let dynamics = dynamics(name);
    let objective = Objective::new(reward, dynamics.joints).expect("a formula");
    let rollouts = Rollouts::new(
        &dynamics,
        &[network(dynamics.joints)],
        objective.program(),
        Integrator::default(),
        STEP_S,
    );
    let mut block = rollouts.block();
    let start = vec![0.1; 2 * dynamics.joints];
    let inputs = vec![Rows::splat(0.1); HORIZON * dynamics.joints];
    let mut returns = Rows::splat(0.0);
    for _ in 0..times {
        block.returns(&start, 0.0, &[], black_box(&inputs), &mut returns);
        black_box(&returns);
    }
}

/// Transitions between random states.
fn transitions(joints: usize) -> Segments {
    let mut rng = ChaCha8Rng::seed_from_u64(2);
    let mut draw =
        |count: usize| -> Vec<f64> { (0..count).map(|_| rng.random_range(-3.0..3.0)).collect() };
    let mut segments = Segments::new(joints, 1);
    for _ in 0..TRANSITIONS {
        let (states, inputs) = (draw(4 * joints), draw(2 * joints));
        segments
            .push_trajectory(&[0.0, STEP_S], &states, &inputs, 1)
            .expect("two rows are a transition");
    }
    segments
}

/// Epochs of one training.
fn epochs(name: &str, times: usize) {
    let dynamics = dynamics(name);
    let segments = transitions(dynamics.joints);
    let model = HybridModel::physics(&dynamics, &Backend::NdArray.device())
        .and_then(|model| model.with_residual(&network(dynamics.joints)))
        .expect("a model of this system");
    let settings = FitSettings {
        epochs: times,
        record_every: times.try_into().expect("at least once"),
        ..FitSettings::default()
    };
    let training = Training::new(model, settings, ChaCha8Rng::seed_from_u64(3));
    let mut training = training.expect("settings in range");
    let ended = training.run(&segments, None, &mut |_| ControlFlow::Continue(()));
    black_box(ended.expect("training does not diverge"));
}

/// A swing with a torque, recorded without noise.
fn log() -> Log {
    let rig = Plant::read(Path::new("pendulum"), &Library::built_in()).expect("a built-in rig");
    let log = rig.record(&mut ChaCha8Rng::seed_from_u64(4));
    log.expect("a rig that does not diverge")
}

/// The linearisation of all windows and the step that it gives.
fn gauss_newton_steps(times: usize) {
    let (dynamics, logs) = (dynamics("pendulum"), [log()]);
    let shooting = Shooting::new(&logs, cut(&logs, WINDOW_S), &[NOISE]);
    let locals = shooting.initial_locals(0);
    let free: Vec<usize> = (0..dynamics.parameters.len()).collect();
    for _ in 0..times {
        let cost = predicted_cost(&shooting, &dynamics, &free, &locals, 1.0);
        black_box(cost.expect("a model that does not diverge"));
    }
}

/// The file of a system, from text to program.
fn parse(times: usize) {
    for _ in 0..times {
        black_box(dynamics(black_box("acrobot")));
    }
}
