//! Simulated machines under watch: `watch SCENARIO FIRST-SEED SEEDS [HOURS] [HEALTHY-S]`. Prints what is alarmed, and the rate of false
//! alarms of healthy machines.

mod machines;

use std::time::Instant;

use machines::{RATE_HZ, adding, arm, joint, model, piece, servo_arm, with_effect};
use residyn_core::plant::Plant;
use residyn_monitor::{Monitor, Rows, Settings};

/// Length of a piece of a simulated log, s, and the pause before the next.
const PIECE_S: f64 = 300.0;
const PAUSE_S: f64 = 1.0;

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let number = |at: usize, usual: f64| {
        arguments
            .get(at)
            .map_or(usual, |text| text.parse().expect("a number"))
    };
    let scenario = arguments.first().map_or("joint", String::as_str);
    let (first, seeds) = (number(1, 1.0) as u64, number(2, 1.0) as u64);
    let hours = number(3, 0.5);
    let mut alarms = 0;
    let mut told = 0;
    let mut disturbances = 0;
    let started = Instant::now();
    for seed in first..first + seeds {
        let (model, at) = scene(scenario);
        let settings = Settings {
            healthy_s: number(4, Settings::default().healthy_s),
            ..Settings::default()
        };
        let mut monitor = Monitor::new(&model, settings).expect("a monitor");
        let mut time = 0.0;
        let mut part = 0;
        while time < 3600.0 * hours {
            let rows = piece(&at(time), time, PIECE_S, seed * 1000 + part);
            for alarm in monitor.update(&rows).expect("good rows") {
                println!("seed {seed}: {:.0} s: {alarm}", alarm.time_s);
                alarms += 1;
            }
            time += PIECE_S + PAUSE_S;
            part += 1;
        }
        let summary = monitor.summary();
        told += summary.followed;
        disturbances += summary.disturbances;
        if seed == first {
            println!("{summary}");
        }
    }
    let watched = hours * seeds as f64;
    println!(
        "{scenario}: {alarms} alarms, {told} followed, {disturbances} disturbances, in {watched:.1} h of {seeds} machine(s), {:.0} s",
        started.elapsed().as_secs_f64()
    );
    if scenario == "speed" {
        speed();
    }
}

type At = Box<dyn Fn(f64) -> Plant>;

/// The model that is watched, and the machine at a time.
fn scene(name: &str) -> (residyn_core::model::Model, At) {
    let after = |healthy: Plant, changed: Plant| -> (residyn_core::model::Model, At) {
        let model = model(&healthy);
        (
            model,
            Box::new(move |time: f64| {
                if time < 600.0 {
                    healthy.clone()
                } else {
                    changed.clone()
                }
            }),
        )
    };
    let ease = |healthy: Plant| after(healthy.clone(), healthy);
    match name {
        "joint" => ease(joint()),
        "arm" => ease(arm()),
        "servo_arm" => ease(servo_arm(2)),
        "arm_friction" => after(
            arm(),
            with_effect(arm(), "coulomb_friction", 1, |level| 1.3 * level),
        ),
        "servo_friction" => after(
            servo_arm(2),
            with_effect(servo_arm(2), "coulomb_friction", 1, |level| 1.3 * level),
        ),
        "payload" => after(
            servo_arm(2),
            adding(
                servo_arm(2),
                "payload",
                1,
                &[("m", 0.8), ("x", 0.15), ("y", 0.0), ("z", 0.0)],
            ),
        ),
        "zero" => after(arm(), adding(arm(), "sensor_offset", 0, &[("q_z", 0.02)])),
        "servo_zero" => after(
            servo_arm(2),
            adding(servo_arm(2), "sensor_offset", 0, &[("q_z", 0.02)]),
        ),
        "spring" => after(
            arm(),
            adding(arm(), "joint_spring", 1, &[("k", 0.5), ("q_0", 0.3)]),
        ),
        "wear" => {
            let healthy = arm();
            let model = model(&healthy);
            let worn = move |time: f64| {
                let share = ((time - 600.0) / 1800.0).clamp(0.0, 1.0);
                with_effect(arm(), "coulomb_friction", 1, |level| {
                    level * (1.0 + 0.3 * share)
                })
            };
            (model, Box::new(worn))
        }
        _ => ease(joint()),
    }
}

/// Rows per second of a seven-joint arm.
fn speed() {
    let plant = servo_arm(7);
    let rows = piece(&plant, 0.0, 60.0, 1);
    let mut monitor = Monitor::new(
        &model(&plant),
        Settings {
            healthy_s: 30.0,
            ..Settings::default()
        },
    )
    .expect("a monitor");
    let mut count = 0;
    let started = Instant::now();
    for round in 0..20 {
        let mut rows = rows.clone();
        rows.time
            .iter_mut()
            .for_each(|time| *time += 61.0 * f64::from(round));
        count += rows.time.len();
        monitor.update(&rows).expect("good rows");
    }
    let taken_s = started.elapsed().as_secs_f64();
    println!(
        "{count} rows of seven joints at {RATE_HZ} Hz in {taken_s:.2} s: {:.0} rows/s",
        count as f64 / taken_s
    );
}
