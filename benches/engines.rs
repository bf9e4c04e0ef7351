//! The cost of the engines. `cargo bench` runs all of it; `benches/compare` compares it with JAX and PyTorch.
//!
//! The work matches `benches/peers.py`: the same models and the same numbers of transitions, candidates and steps.

mod demo;
mod search;
mod work;

use std::hint::black_box;
use std::time::Duration;

use criterion::{BenchmarkId, Criterion, criterion_group, criterion_main};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use residyn_control::plan::Start;
use residyn_core::closeloop::{Request, close_loop};
use residyn_core::lanes::{Arch, Element, Simd, Vector, WithSimd};
use residyn_core::model::{Dynamics, Library, MlpSettings, MlpWeights};
use residyn_core::sim::batch::{Rollouts, Rows};

/// One of the two systems on which the published method was tested.
struct Task {
    name: &'static str,
    parameters: &'static [(&'static str, f64)],
    reward: &'static str,
    start: &'static [f64],
    horizon: usize,
}

const TASKS: [Task; 2] = [
    Task {
        name: "pendulum",
        parameters: &[("C_g", 8.0), ("C_i", 2.0)],
        reward: "cos(q1)",
        start: &[std::f64::consts::PI, 0.0],
        horizon: 80,
    },
    Task {
        name: "acrobot",
        parameters: &[("m1", 0.9), ("m2", 1.1)],
        reward: "2 - 1.5 * cos(q1) - cos(q1 + q2)",
        start: &[0.0; 4],
        horizon: 30,
    },
];

impl Task {
    fn equations(&self) -> Dynamics {
        let mut dynamics = work::dynamics(self.name);
        for (name, value) in self.parameters {
            let found = dynamics.parameters.iter_mut().find(|p| p.name == *name);
            found.expect("a parameter of the system").value = *value;
        }
        dynamics
    }

    fn network(&self) -> MlpWeights {
        let joints = self.start.len() / 2;
        work::network(joints, &MlpSettings::for_joints(joints))
    }

    fn rollouts(&self) -> Rollouts {
        work::rollouts(&self.equations(), self.network(), self.reward)
    }
}

/// Epochs per measurement.
const EPOCHS: usize = 1000;

fn train(c: &mut Criterion) {
    for task in &TASKS {
        let mut group = c.benchmark_group(format!("train-{}", task.name));
        group
            .sample_size(10)
            .measurement_time(Duration::from_secs(1));
        for count in [500, 2000, 5000] {
            let equations = task.equations();
            let segments = work::segments(equations.joints, 1, count);
            let training = work::training(&equations, &task.network(), EPOCHS);
            group.bench_function(BenchmarkId::from_parameter(count), |b| {
                b.iter(|| {
                    let mut training = training.clone();
                    let ended =
                        training.run(
                            &segments,
                            None,
                            &mut |_| std::ops::ControlFlow::Continue(()),
                        );
                    black_box(ended.expect("training does not diverge"));
                });
            });
        }
    }
}

fn plan(c: &mut Criterion) {
    for task in &TASKS {
        let rollouts = task.rollouts();
        let planner = search::planner(&rollouts, 300, task.horizon);
        let start = Start::new(task.start, 0.0);
        c.benchmark_group("plan")
            .measurement_time(Duration::from_secs(2))
            .bench_function(BenchmarkId::from_parameter(task.name), |b| {
                planner.with_workers(|| {
                    b.iter(|| {
                        planner.forget();
                        black_box(planner.plan(start.clone()));
                    });
                });
            });
    }
}

/// One block on one core.
fn rollout(c: &mut Criterion) {
    for task in &TASKS {
        let rollouts = task.rollouts();
        let mut block = rollouts.block();
        let start: Vec<f32> = task.start.iter().map(|x| *x as f32).collect();
        let inputs = vec![Rows::splat(0.1); task.horizon * rollouts.joints()];
        let mut returns = Rows::splat(0.0);
        c.bench_function(&format!("rollout/{}", task.name), |b| {
            b.iter(|| block.returns(&start, 0.0, &[], black_box(&inputs), &mut returns));
        });
    }
}

/// Independent sums, enough to hide the latency of a multiply-add.
const SUMS: usize = 12;
/// Multiply-adds per sum.
const ROUNDS: usize = 10_000;

/// Peak multiply-add rate of one core: independent operations on registers only.
struct Peak;

impl WithSimd for Peak {
    type Output = f32;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> f32 {
        let [factor, term] = [0.999, 0.001].map(|x| Vector::<S, f32>::splat(simd, black_box(x)));
        let mut sums = [Vector::splat(simd, 1.0); SUMS];
        for _ in 0..ROUNDS {
            for sum in &mut sums {
                *sum = sum.mul_add(factor, term);
            }
        }
        sums.into_iter().map(Vector::sum).sum()
    }
}

fn peak(c: &mut Criterion) {
    let arch = Arch::new();
    c.bench_function(&format!("peak/{}", SUMS * ROUNDS * lanes(arch)), |b| {
        b.iter(|| black_box(arch.dispatch(Peak)));
    });
}

/// Numbers in a register.
fn lanes(arch: Arch) -> usize {
    struct Lanes;
    impl WithSimd for Lanes {
        type Output = usize;

        fn with_simd<S: Simd>(self, _: S) -> usize {
            f32::lanes::<S>()
        }
    }
    arch.dispatch(Lanes)
}

/// The logs of `residyn closeloop` without arguments, from the declared model to the named effect.
fn identify(c: &mut Criterion) {
    let library = Library::built_in();
    let mut rng = ChaCha8Rng::seed_from_u64(0);
    let split = demo::recorded(&demo::rig(&library), &mut rng);
    let system = library.model("pendulum").expect("a built-in system");
    let mut group = c.benchmark_group("identify");
    group.sample_size(10).bench_function("demo", |b| {
        b.iter(|| {
            let request = Request::new(&system, &library, split.clone());
            black_box(close_loop(request, &mut rng.clone(), &()).expect("a model"));
        });
    });
}

criterion_group!(engines, peak, rollout, train, plan, identify);
criterion_main!(engines);
