//! One piece of work, repeated so that its instructions can be counted: `benches/instructions` runs this under
//! valgrind. Nothing here depends on time, on addresses or on the number of cores.
//!
//!     instructions WORK TIMES

mod demo;
mod search;
mod work;

use std::hint::black_box;
use std::ops::ControlFlow;
use std::path::Path;

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use residyn::read_plant;
use residyn_control::plan::Start;
use residyn_core::closeloop::{Fitted, Problem, Request, candidates, fit, prepare, screen, select};
use residyn_core::data::Log;
use residyn_core::identify::{Shooting, cut, predicted_cost};
use residyn_core::model::{Library, MlpSettings, MlpWeights};
use residyn_core::sim::batch::Rows;

use work::{dynamics, rollouts, segments, training};

/// Steps of a rollout.
const HORIZON: usize = 30;
/// Transitions of a training epoch.
const TRANSITIONS: usize = 512;
/// Candidates of a plan: two blocks.
const POPULATION: usize = 64;
/// Length of a window of the Gauss-Newton step, s.
const WINDOW_S: f64 = 0.5;
/// Length of each of the demo's logs, s. Under valgrind, a search of the whole ones takes ten minutes.
const LOG_S: f64 = 2.0;
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
        "plan" => plans(times),
        "gauss-newton-step" => gauss_newton_steps(times),
        "screening-round" => screening_rounds(times),
        "demo-search" => searches(times),
        "parse" => parse(times),
        other => panic!("unknown work {other}"),
    }
}

/// The published network for this number of joints.
fn network(joints: usize) -> MlpWeights {
    work::network(joints, &MlpSettings::for_joints(joints))
}

/// Rollouts of one block of candidates.
fn rollout(name: &str, reward: &str, times: usize) {
    let dynamics = dynamics(name);
    let rollouts = rollouts(&dynamics, network(dynamics.joints), reward);
    let mut block = rollouts.block();
    let start = vec![0.1; 2 * dynamics.joints];
    let inputs = vec![Rows::splat(0.1); HORIZON * dynamics.joints];
    let mut returns = Rows::splat(0.0);
    for _ in 0..times {
        block.returns(&start, 0.0, &[], black_box(&inputs), &mut returns);
        black_box(&returns);
    }
}

/// Decisions of a planner, each from the middle of the bounds.
fn plans(times: usize) {
    let dynamics = dynamics("acrobot");
    let rollouts = rollouts(&dynamics, network(dynamics.joints), "cos(q1)");
    let planner = search::planner(&rollouts, POPULATION, HORIZON);
    let start = Start::new(&vec![0.1; 2 * dynamics.joints], 0.0);
    for _ in 0..times {
        planner.forget();
        black_box(planner.plan(start.clone()));
    }
}

/// Epochs of one training.
fn epochs(name: &str, times: usize) {
    let dynamics = dynamics(name);
    let segments = segments(dynamics.joints, 1, TRANSITIONS);
    let mut training = training(&dynamics, &network(dynamics.joints), times);
    let ended = training.run(&segments, None, &mut |_| ControlFlow::Continue(()));
    black_box(ended.expect("training does not diverge"));
}

/// A swing driven by a torque, recorded without noise.
fn log() -> Log {
    let rig = read_plant(Path::new("pendulum"), &Library::built_in()).expect("a built-in rig");
    let log = rig.record(&mut ChaCha8Rng::seed_from_u64(4));
    log.expect("a rig that does not diverge")
}

/// The linearisation of all windows and the resulting step.
fn gauss_newton_steps(times: usize) {
    let (dynamics, logs) = (dynamics("pendulum"), [log()]);
    let shooting = Shooting::new(&logs, cut(&logs, WINDOW_S), &[NOISE]);
    let start_states = shooting.initial_start_states(0);
    let free: Vec<usize> = (0..dynamics.parameters.len()).collect();
    for _ in 0..times {
        let cost = predicted_cost(&shooting, &dynamics, &free, &start_states, 1.0);
        black_box(cost.expect("a model that does not diverge"));
    }
}

/// Work on the demo's declared model, fitted to short logs of its rig.
fn from_declared(times: usize, work: impl Fn(&Problem<'_>, &Fitted)) {
    let library = Library::built_in();
    let mut rig = demo::rig(&library);
    rig.recording.duration_s = LOG_S;
    let split = demo::recorded(&rig, &mut ChaCha8Rng::seed_from_u64(0));
    let system = library.model("pendulum").expect("a built-in system");
    let prepared = prepare(Request::new(&system, &library, split), &());
    let declared = fit(&prepared, &()).expect("a model that fits");
    for _ in 0..times {
        work(&declared.problem, &declared.fitted);
    }
}

/// The comparison of all effects that the declared model may lack, without a fit.
fn screening_rounds(times: usize) {
    from_declared(times, |problem, declared| {
        let candidates = candidates(problem, &declared.model.effects);
        black_box(screen(problem, declared, &candidates));
    });
}

/// The search for the set of effects that the declared model lacks.
fn searches(times: usize) {
    from_declared(times, |problem, declared| {
        black_box(select(problem, declared, &()));
    });
}

/// A system's file, from text to program.
fn parse(times: usize) {
    for _ in 0..times {
        black_box(dynamics(black_box("acrobot")));
    }
}
