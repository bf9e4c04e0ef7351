//! Figures for docs/excite.md: `cargo test --release -p residyn-excite --test figures -- --ignored --nocapture`.

mod support;

use std::time::Instant;

use residyn_core::model::Model;
use residyn_excite::{Design, Limits, Settings, design, random_motion};
use support::{arm_limits, chain, joint, limits, model};

fn rigs() -> Vec<(&'static str, Model, Limits, f64)> {
    vec![
        (
            "pendulum",
            model("pendulum"),
            limits(vec![joint([-1.0, 1.0], 8.0)]),
            10.0,
        ),
        ("acrobot", model("acrobot"), arm_limits(2, 60.0), 10.0),
        (
            "arm of six (servo)",
            model("configs/bench/robot-arm.toml"),
            arm_limits(6, 40.0),
            10.0,
        ),
        (
            "arm of seven",
            model("configs/bench/arm-seven.toml"),
            arm_limits(7, 150.0),
            10.0,
        ),
        ("chain of twelve", chain(12), arm_limits(12, 400.0), 10.0),
    ]
}

#[test]
#[ignore = "minutes"]
fn time() {
    for (name, model, limits, duration_s) in rigs() {
        let start = Instant::now();
        let found = design(
            &model,
            &[],
            &limits,
            duration_s,
            &Settings::default(),
            1,
            &|_| (),
        );
        let time_s = start.elapsed().as_secs_f64();
        match found {
            Ok(found) => {
                print(name, &found, time_s);
            }
            Err(error) => println!("{name}: {error}"),
        }
        for seed in 0..3 {
            let start = Instant::now();
            match random_motion(&model, &[], &limits, duration_s, &Settings::default(), seed) {
                Ok(found) => print("  random", &found, start.elapsed().as_secs_f64()),
                Err(error) => println!("{name}: {error}"),
            }
        }
    }
}

/// What more harmonics, starts or steps are worth.
#[test]
#[ignore = "minutes"]
fn effort() {
    for (name, model, limits, duration_s) in rigs() {
        for (harmonics, starts, steps) in [
            (10, 8, 50),
            (6, 8, 50),
            (15, 8, 50),
            (20, 8, 50),
            (10, 32, 50),
            (10, 8, 200),
        ] {
            let settings = Settings {
                harmonics,
                starts,
                steps,
                ..Settings::default()
            };
            let start = Instant::now();
            let found = design(&model, &[], &limits, duration_s, &settings, 1, &|_| ()).unwrap();
            let time_s = start.elapsed().as_secs_f64();
            println!("{harmonics} harmonics, {starts} starts, {steps} steps");
            print(name, &found, time_s);
        }
    }
}

fn print(name: &str, found: &Design, time_s: f64) {
    let most = found.uses.iter().map(|one| one.share).fold(0.0, f64::max);
    println!(
        "{name}: {} sums of {:?}, log det {:.2}, condition {:.1}, sum of relative intervals {:.4}, most of a limit {most:.4}, {time_s:.2} s, {:?}",
        found.expected.len(),
        found.compared,
        found.log_determinant,
        found.condition,
        found.relative_intervals(),
        found.harmonics
    );
}
