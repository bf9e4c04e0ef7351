//! Figures for docs/excite.md: `cargo test --release -p residyn-excite --test excite figures -- --ignored --nocapture`.

use std::time::Instant;

use crate::support::{arm_limits, chain, joint, limits, model};
use residyn_core::model::Model;
use residyn_excite::{Design, Designer, Limits, Settings, design, log_condition};

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

/// A design beside random motions (the median of fifty, and the best of as many as fit into the same time) and beside five
/// harmonics with the least condition number.
#[test]
#[ignore = "minutes"]
fn beside_others() {
    for (name, model, limits, duration_s) in rigs() {
        let usual = Settings::default();
        let start = Instant::now();
        let found = design(&model, &[], &limits, duration_s, &usual, 1, &|_| ()).unwrap();
        let time_s = start.elapsed().as_secs_f64();
        print(name, &found, time_s);
        let designer = Designer::new(&model, &[], &limits, duration_s, &usual).unwrap();
        let random = |seed| designer.random(seed).unwrap();
        let mut motions: Vec<Design> = (0..50).map(random).collect();
        let start = Instant::now();
        designer.best_random(0..100).unwrap();
        let each_s = start.elapsed().as_secs_f64() / 100.0;
        let tried = (time_s / each_s) as u64;
        let start = Instant::now();
        let best = designer.best_random(0..tried.max(1)).unwrap();
        let random_s = start.elapsed().as_secs_f64();
        print(&format!("  best of {tried} random ones"), &best, random_s);
        motions.sort_by(|a, b| a.relative_intervals().total_cmp(&b.relative_intervals()));
        print("  median of 50 random ones by intervals", &motions[25], 0.0);
        let five = Settings {
            harmonics: 5,
            criterion: log_condition,
            ..usual
        };
        let start = Instant::now();
        let found = design(&model, &[], &limits, duration_s, &five, 1, &|_| ()).unwrap();
        print(
            "  five harmonics, least condition",
            &found,
            start.elapsed().as_secs_f64(),
        );
    }
}

/// What more harmonics, starts or steps are worth.
#[test]
#[ignore = "minutes"]
fn effort() {
    for (name, model, limits, duration_s) in rigs() {
        for (harmonics, starts, steps) in
            [(15, 12, 100), (25, 12, 100), (15, 48, 100), (15, 12, 400)]
        {
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
