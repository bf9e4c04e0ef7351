//! How the engines' cost grows with the size of the work. `benches/growth` runs this and draws the result.
//!
//! Prints one JSON object per measurement: what was done, which size was varied, its value, the time, and the process's
//! peak memory so far.

mod search;
mod work;

use std::ops::ControlFlow;
use std::path::Path;
use std::time::Instant;

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use residyn::read_plant;
use residyn_control::plan::Start;
use residyn_core::identify::{Shooting, cut, fit};
use residyn_core::model::{Dynamics, Library, MlpSettings, MlpWeights, Model};
use residyn_train::Progress;

/// Each time is the best of this many runs.
const REPEATS: usize = 5;

/// One piece of work; one size is varied at a time.
#[derive(Clone, Copy)]
struct Work {
    joints: usize,
    width: usize,
    /// Training.
    transitions: usize,
    steps: usize,
    /// Planning.
    population: usize,
    horizon: usize,
}

const WORK: Work = Work {
    joints: 1,
    width: 16,
    transitions: 2000,
    steps: 1,
    population: 300,
    horizon: 80,
};

impl Work {
    fn network(&self) -> MlpWeights {
        let settings = MlpSettings {
            hidden: vec![self.width; 3],
            ..MlpSettings::for_joints(self.joints)
        };
        work::network(self.joints, &settings)
    }

    /// Seconds of one epoch.
    fn epoch(&self) -> f64 {
        let segments = work::segments(self.joints, self.steps, self.transitions / self.steps);
        let epochs = (200_000 / self.transitions).clamp(3, 100);
        let begin = work::training(&chain(self.joints), &self.network(), epochs);
        best(|| {
            let mut training = begin.clone();
            // From one epoch to the next: neither the first epoch nor recording at the ends counts.
            let (mut last, mut shortest) = (None::<Instant>, f64::INFINITY);
            let mut observe = |_: &Progress| {
                let now = Instant::now();
                if let Some(last) = last.replace(now) {
                    shortest = shortest.min(now.duration_since(last).as_secs_f64());
                }
                ControlFlow::Continue(())
            };
            training
                .run(&segments, None, &mut observe)
                .expect("training does not diverge");
            shortest
        })
    }

    /// Seconds of one decision.
    fn decision(&self) -> f64 {
        let rollouts = work::rollouts(&chain(self.joints), self.network(), "cos(q1)");
        let planner = search::planner(&rollouts, self.population, self.horizon);
        let start = Start::new(&vec![0.1; 2 * self.joints], 0.0);
        planner.with_workers(|| {
            best(|| {
                planner.forget();
                seconds(|| drop(planner.plan(start.clone())))
            })
        })
    }
}

/// Links of equal length with a point mass each, angles from the vertical: M(q) qdd + b = tau.
fn chain(joints: usize) -> Dynamics {
    let row = |count: usize, entry: &dyn Fn(usize) -> String| {
        (0..count).map(entry).collect::<Vec<_>>().join(", ")
    };
    let carried = |i: usize, j: usize| joints - i.max(j);
    let mass = row(joints, &|i| {
        let entry = |j: usize| format!("\"{} * m * cos(q{} - q{})\"", carried(i, j), i + 1, j + 1);
        format!("[{}]", row(joints, &entry))
    });
    let bias = row(joints, &|i| {
        let centrifugal = (0..joints).map(|j| {
            let (k, i, j) = (carried(i, j), i + 1, j + 1);
            format!("{k} * m * sin(q{i} - q{j}) * qd{j}^2 + ")
        });
        let sum: String = centrifugal.collect();
        format!("\"{sum}{} * m * g * sin(q{})\"", joints - i, i + 1)
    });
    let text = format!(
        "[system]\nname = \"chain\"\njoints = {joints}\n[parameters]\nm = {{ value = 1.0, unit = \"kg\" }}\n\
         g = {{ value = 9.8, unit = \"m/s^2\" }}\n[dynamics]\nmass = [{mass}]\nbias = [{bias}]\n"
    );
    let system = Model::from_text(Path::new("chain.toml"), &text, &[]).expect("a model file");
    system.dynamics()
}

/// Seconds to fit the pendulum to logs of this length.
fn identification(duration_s: f64) -> f64 {
    let library = Library::built_in();
    let mut rig = read_plant(Path::new("pendulum"), &library).expect("a built-in system");
    rig.recording.duration_s = duration_s;
    let log = rig
        .record(&mut ChaCha8Rng::seed_from_u64(5))
        .expect("a log");
    let dynamics = work::dynamics("pendulum");
    let logs = [log];
    let shooting = Shooting::new(&logs, cut(&logs, 0.5), &[1e-3]);
    let active = [0, 1];
    best(|| {
        seconds(|| {
            let states = shooting.initial_start_states(0);
            let fitted = fit(&shooting, &dynamics, &active, states, None);
            drop(fitted.expect("a model that stays finite"));
        })
    })
}

fn seconds(work: impl FnOnce()) -> f64 {
    let begin = Instant::now();
    work();
    begin.elapsed().as_secs_f64()
}

fn best(mut measure: impl FnMut() -> f64) -> f64 {
    (0..REPEATS)
        .map(|_| measure())
        .fold(f64::INFINITY, f64::min)
}

/// Peak memory of this process so far, in MiB; `None` if the system does not report it.
fn memory_mib() -> Option<f64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find(|line| line.starts_with("VmHWM:"))?;
    let kib: f64 = line.split_whitespace().nth(1)?.parse().ok()?;
    Some(kib / 1024.0)
}

fn tell(work: &str, size: &str, value: usize, seconds: f64) {
    let line = serde_json::json!({
        "work": work, "size": size, "value": value, "seconds": seconds, "memory_mib": memory_mib(),
    });
    println!("{line}");
}

/// Measure one kind of work over a range of one size.
fn sweep(work: &str, size: &str, values: &[usize], seconds: impl Fn(usize) -> f64) {
    for &value in values {
        tell(work, size, value, seconds(value));
    }
}

const JOINTS: &[usize] = &[1, 2, 3, 4, 6];
const WIDTHS: &[usize] = &[8, 16, 32, 64, 128];
const TRANSITIONS: &[usize] = &[500, 1000, 2000, 5000, 10_000, 100_000, 1_000_000];
const STEPS: &[usize] = &[1, 2, 5, 10, 20];
const HORIZONS: &[usize] = &[10, 20, 40, 80, 160, 320];
const POPULATIONS: &[usize] = &[32, 100, 300, 1000, 3000, 10_000];
const DURATIONS: &[usize] = &[10, 20, 40, 80, 160, 320];

fn main() {
    let w = WORK;
    let layer = "neurons of a layer";
    sweep("epoch", "transitions", TRANSITIONS, |transitions| {
        Work { transitions, ..w }.epoch()
    });
    sweep("epoch", "steps of a segment", STEPS, |steps| {
        Work { steps, ..w }.epoch()
    });
    sweep("epoch", "joints", JOINTS, |joints| {
        Work { joints, ..w }.epoch()
    });
    sweep("decision", "joints", JOINTS, |joints| {
        Work { joints, ..w }.decision()
    });
    sweep("epoch", layer, WIDTHS, |width| Work { width, ..w }.epoch());
    sweep("decision", layer, WIDTHS, |width| {
        Work { width, ..w }.decision()
    });
    sweep("decision", "horizon", HORIZONS, |horizon| {
        Work { horizon, ..w }.decision()
    });
    sweep("decision", "population", POPULATIONS, |population| {
        Work { population, ..w }.decision()
    });
    sweep("identification", "seconds of log", DURATIONS, |seconds| {
        identification(seconds as f64)
    });
}
