//! Effects with memory and effects of the sensor: how they change a torque or an angle, how sensitive the motion is to
//! them, and that they are found.

use std::f64::consts::{FRAC_PI_2, PI};

use residyn_core::data::{Log, Quantity};
use residyn_core::expr::SignForm;
use residyn_core::identify::{Shooting, cut, fit, uncertainty};
use residyn_core::lanes::Row;
use residyn_core::model::{Dynamics, FittedEffect};
use residyn_core::sim::{Commands, Hold, Sensors, StepTorque, with_own_angles};

use rand::RngExt;

use crate::support::catalogue::{self, assert_all_near, assert_near, dynamics, rng, system};
use crate::support::logs::{add_noise, simulate};
use crate::support::reports::{error, estimate, names};
use crate::support::{Scratch, says};

const DELAY_S: f64 = 0.0073;
const LAG_S: f64 = 0.015;

fn effect(name: &str, value: f64) -> FittedEffect {
    catalogue::effect(name, 0, &[value])
}

/// A mass of 1 with these filters: acceleration equals torque.
fn drive(effects: &[FittedEffect]) -> Dynamics {
    dynamics(&system("drive"), effects, SignForm::Exact)
}

/// Twenty torques, held for 3 to 15 ms each.
fn history() -> (Vec<f64>, Vec<f64>) {
    let mut rng = rng(11);
    let mut time = vec![100.0];
    for _ in 1..20 {
        time.push(time[time.len() - 1] + rng.random_range(0.003..0.015));
    }
    let tau = time.iter().map(|_| rng.random_range(-2.0..2.0)).collect();
    (time, tau)
}

/// Mean torque of the first joint over each part, and its slopes with respect to the filters' parameters.
fn means(model: &Dynamics, from: f64, to: f64, parts: usize) -> (Vec<f64>, Vec<f64>) {
    let (time, tau) = history();
    let tau = [tau];
    let commands = Commands::new(model, &time, &tau);
    let (held, ends) = ([Row([f64::NAN])], [from, to].map(|time| Row([time])));
    let torque = StepTorque::new(&Hold::between([&commands], &held, ends, parts));
    let first = |lanes: Vec<Row<f64, 1>>| lanes.into_iter().map(|lane| lane[0]).collect();
    (first(torque.given), first(torque.slopes))
}

/// The filtered torque in steps of 1 us, averaged over each part.
fn stepped(delay: f64, lag: f64, from: f64, to: f64, parts: usize) -> Vec<f64> {
    let (time, tau) = history();
    let held = |t: f64| tau[time.partition_point(|row| *row <= t).max(1) - 1];
    let h = 1e-6;
    let (mut now, mut output) = (time[0] - 1e-3, tau[0]);
    let (mut sums, mut counts) = (vec![0.0; parts], vec![0.0; parts]);
    while now < to {
        let command = held(now + 0.5 * h - delay);
        // Exact over a step in which the command is held.
        let share = if lag > 0.0 {
            1.0 - (-h / lag).exp()
        } else {
            1.0
        };
        let next = output + share * (command - output);
        let middle = if lag > 0.0 {
            0.5 * (output + next)
        } else {
            next
        };
        if now + 0.5 * h > from {
            let part = ((now + 0.5 * h - from) / (to - from) * parts as f64) as usize;
            sums[part.min(parts - 1)] += middle;
            counts[part.min(parts - 1)] += 1.0;
        }
        (now, output) = (now + h, next);
    }
    sums.iter()
        .zip(counts)
        .map(|(sum, count)| sum / count)
        .collect()
}

#[test]
fn mean_torques_match_those_of_fine_steps() {
    for (delay, lag) in [(DELAY_S, 0.0), (0.0, LAG_S), (DELAY_S, LAG_S), (0.02, 1e-5)] {
        let model = drive(&[effect("actuator_delay", delay), effect("actuator_lag", lag)]);
        for (from, to, parts) in [
            (100.001, 100.013, 6),
            (100.0, 100.002, 1),
            (100.07, 100.09, 3),
        ] {
            let found = means(&model, from, to, parts).0;
            let wanted = stepped(delay, lag, from, to, parts);
            // Jumps of up to 4 N m fall within steps of 1 us, in parts of 2 ms and more.
            assert_all_near(&found, &wanted, 4e-3, &format!("{delay} {lag} {from}"));
        }
    }
}

#[test]
fn without_delay_and_lag_the_command_acts() {
    let model = drive(&[effect("actuator_delay", 0.0), effect("actuator_lag", 0.0)]);
    let (time, tau) = history();
    for row in 0..time.len() - 1 {
        for mean in means(&model, time[row], time[row + 1], 4).0 {
            assert_near(mean, tau[row], 1e-12, "held torque");
        }
    }
}

#[test]
fn a_step_of_no_length_changes_nothing() {
    let model = drive(&[effect("actuator_delay", 0.0), effect("actuator_lag", 0.0)]);
    let (mean, slopes) = means(&model, 100.0, 100.0, 2);
    assert!(mean.iter().chain(&slopes).all(|x| *x == 0.0));
}

#[test]
fn slopes_are_those_of_the_mean_torque() {
    for (delay, lag) in [(DELAY_S, LAG_S), (0.0, 0.0), (0.0, LAG_S), (DELAY_S, 0.0)] {
        let at = |delay: f64, lag: f64| {
            drive(&[effect("actuator_delay", delay), effect("actuator_lag", lag)])
        };
        // One row ends within the parts, and the step begins at another.
        let (time, _) = history();
        let (from, to) = (time[4], time[5] + 0.002);
        let mean = |delay, lag| means(&at(delay, lag), from, to, 4).0;
        let slopes = means(&at(delay, lag), from, to, 4).1;
        let step = 1e-7;
        let now = mean(delay, lag);
        for (k, moved) in [mean(delay + step, lag), mean(delay, lag + step)]
            .iter()
            .enumerate()
        {
            for part in 0..4 {
                let wanted = (moved[part] - now[part]) / step;
                // The slopes are up to 4 N m / 3 ms, and change over the step by step / lag at most.
                let what = format!("filter {k}, part {part} at {delay}, {lag}");
                assert!(
                    (slopes[2 * part + k] - wanted).abs() < 0.02 * wanted.abs().max(1.0),
                    "{what}: {} {wanted}",
                    slopes[2 * part + k]
                );
            }
        }
    }
}

fn pendulum(effects: &[FittedEffect]) -> Dynamics {
    dynamics(&system("pendulum"), effects, SignForm::Exact)
}

/// Two logs of 15 s with noise of 1 mrad.
fn logs(model: &Dynamics) -> Vec<Log> {
    let log = |seed| {
        let mut log = simulate(model, &[3.0, 0.0], 1.5, 1500, seed);
        add_noise(&mut log, 1e-3, 50 + seed);
        log
    };
    vec![log(1), log(2)]
}

#[test]
fn fitted_delay_and_lag_lie_within_their_intervals() {
    for (name, truth) in [("actuator_delay", DELAY_S), ("actuator_lag", LAG_S)] {
        let rig = pendulum(&[effect(name, truth)]);
        let logs = logs(&rig);
        let shooting = Shooting::new(&logs, cut(&logs, 0.5), &[1e-3]);
        let model = pendulum(&[effect(name, 0.0)]);
        let start = model.with_values([14.0, 3.3, 0.0]);
        let start_states = shooting.initial_start_states(0);
        let (found, fit) = fit(&shooting, &start, &[0, 1, 2], start_states, None).unwrap();
        let uncertainty = uncertainty(&shooting, &fit);
        for (i, wanted) in [15.0, 3.0, truth].into_iter().enumerate() {
            let (value, half) = (found.common[i], uncertainty.half_width(i));
            assert!(
                (value - wanted).abs() < half,
                "{name}: {value} +- {half}, wanted {wanted}"
            );
        }
        // 3000 rows of 1 mrad determine a time to a fraction of a millisecond.
        assert!(
            uncertainty.half_width(2) < 1e-3,
            "{name}: {}",
            uncertainty.half_width(2)
        );
    }
}

#[test]
fn independent_transitions_are_refused_for_a_rig_with_delay() {
    let scratch = Scratch::new();
    let late = "[[effect]]\nname = \"actuator_delay\"\njoint = 1\nd = 0.01\n\n[energy]";
    scratch.model("late.toml", "[energy]", late);
    let plant = ["plant = \"pendulum-real\"", "plant = \"late.toml\""];
    scratch.changed("smoke/train-pendulum.toml", plant[0], plant[1]);
    let message = scratch.refuses("train --config train-pendulum.toml --out out");
    says(&message, &["effect with memory", "residyn simulate"]);
}

/// The error message for an effect file with this in place of the delay's line.
fn refused(from: &str, to: &str) -> String {
    let delay = include_str!("../models/effects/actuator_delay.toml");
    assert!(delay.contains(from));
    let file = std::path::Path::new("own.toml");
    residyn_core::model::Effect::from_text(file, &delay.replace(from, to))
        .unwrap_err()
        .to_string()
}

#[test]
fn an_invalid_filter_is_refused_with_its_line() {
    let kind = refused("\"delay\"", "\"late\"");
    assert!(
        kind.contains("line 4") && kind.contains("\"delay\" or \"lag\""),
        "{kind}"
    );
    for (from, to) in [("\"s\"", "\"ms\""), ("bounds = [0,", "bounds = [-1,")] {
        let time = refused(from, to);
        assert!(
            time.contains("line 4") && time.contains("one parameter"),
            "{time}"
        );
    }
    let both = refused("confused_with", "force = \"-d\"\nconfused_with");
    assert!(
        both.contains(
            "one of force, torque, angle, inertia, friction, command, reading, coupling, payload and transmission"
        ),
        "{both}"
    );
}

#[test]
fn expressions_of_filters_state_what_they_do_to_the_command() {
    let message =
        |name: &str, own: &str| effect(name, 0.01).expression(&[own.to_owned()], Quantity::Torque);
    assert_eq!(message("actuator_delay", "d1"), "tau1(t - d1)");
    assert_eq!(
        message("actuator_lag", "T1"),
        "T1 * d(tau1)/dt + tau1 = commanded"
    );
}

fn backlash(delta: f64, driven: f64) -> FittedEffect {
    catalogue::effect("backlash", 0, &[delta, driven])
}

#[test]
fn play_separates_the_measured_angle_from_the_links() {
    for (driven, [v, tau], ahead) in [
        (1.0, [2.0, 0.5], 0.01),
        (1.0, [2.0, -0.5], -0.01),
        (0.0, [2.0, -0.5], -0.01),
        (0.0, [-2.0, -0.5], 0.01),
    ] {
        let model = pendulum(&[backlash(0.02, driven)]);
        let mut sensors = Sensors::<1>::new(&model);
        let mut state = [Row([0.7]), Row([v])];
        let shown = sensors.show(&state, || vec![Row([tau])], Row([0.0]))[0][0];
        assert_near(shown, 0.7 + ahead, 1e-12, "angle shown");
        state[0][0] = shown;
        sensors.correct(&mut state, || vec![Row([tau])], Row([0.0]));
        assert_near(state[0][0], 0.7, 1e-12, "angle of the link");
        // The link itself moves as it would without play.
        let inputs = [&[0.7, v, tau, 0.0], model.values().as_slice()].concat();
        assert_near(
            model.program.eval(&inputs)[1],
            15.0 * 0.7_f64.sin() + 3.0 * tau,
            1e-12,
            "link",
        );
    }
}

#[test]
fn a_disc_off_its_axis_reads_ahead_and_behind() {
    let disc = catalogue::effect("encoder_eccentricity", 0, &[0.02, -0.01]);
    let model = pendulum(&[disc]);
    let mut sensors = Sensors::<1>::new(&model);
    for (angle, ahead) in [(0.0, -0.01), (FRAC_PI_2, 0.02), (PI, 0.01)] {
        let state = [Row([angle]), Row([0.0])];
        let shown = sensors.show(&state, || vec![Row([0.0])], Row([0.0]))[0][0];
        assert_near(shown, angle + ahead, 1e-12, "angle shown");
    }
}

#[test]
fn fitted_play_lies_within_its_interval() {
    for driven in [0.0, 1.0] {
        let rig = pendulum(&[backlash(0.01, driven)]);
        let logs = logs(&rig);
        let shooting = Shooting::new(&logs, cut(&logs, 0.5), &[1e-3]);
        let model = pendulum(&[backlash(0.0, driven)]);
        let start = model.with_values([14.0, 3.3, 0.0, driven]);
        let start_states = shooting.initial_start_states(0);
        let (found, fit) = fit(&shooting, &start, &[0, 1, 2], start_states, None).unwrap();
        let half = uncertainty(&shooting, &fit).half_width(2);
        let value = found.common[2];
        assert!(
            (value - 0.01).abs() < half && half < 1e-3,
            "{driven}: {value} +- {half}"
        );
    }
}

/// For each row whose angle is off by more than 1 mrad, the rows to the nearest reversal of the motion.
fn distances(log: &Log, truth: &Log) -> Vec<usize> {
    let turns = truth.qd[0].windows(2).enumerate();
    let reversals: Vec<usize> = turns
        .filter(|(_, v)| v[0] * v[1] <= 0.0)
        .map(|(k, _)| k)
        .collect();
    let to_reversal = |row: usize| reversals.iter().map(|at| at.abs_diff(row)).min().unwrap();
    let off = |row: &usize| (log.q[0][*row] - truth.q[0][*row]).abs() > 1e-3;
    (0..truth.rows()).filter(off).map(to_reversal).collect()
}

#[test]
fn the_rigs_own_angles_are_found_behind_play() {
    let truth = simulate(&pendulum(&[]), &[3.0, 0.0], 1.5, 1500, 4);
    for driven in [0.0, 1.0] {
        let model = pendulum(&[backlash(0.01, driven)]);
        let shown = simulate(&model, &[3.0, 0.0], 1.5, 1500, 4);
        assert!(distances(&shown, &truth).len() > 1300);
        let own = with_own_angles(&model, &shown);
        let left = distances(&own, &truth);
        // The torque is logged; reversals of the motion are detected from velocities over 8 rows on either side.
        let reach = if driven > 0.0 { None } else { Some(8) };
        assert!(left.iter().max().copied() <= reach, "{driven}: {left:?}");
    }
}

mod slow {
    use super::*;

    #[test]
    fn closing_the_loop_names_the_effect_with_memory_or_of_the_sensor() {
        for (name, truth) in [
            ("actuator_delay", 0.01),
            ("actuator_lag", 0.02),
            ("backlash", 0.01),
            ("encoder_eccentricity", 0.01),
            ("joint_compliance", 0.01),
        ] {
            let scratch = Scratch::new();
            let plant = format!("pendulum --duration 15 --effect {name}={truth}");
            scratch.simulates(&plant, &[1, 2, 3, 91]);
            let logs = "--train run1.csv run2.csv run3.csv --test run91.csv";
            let line = format!("closeloop --model pendulum {logs} --out report");
            let report = scratch.json(&line);
            assert_eq!(report["verdict"], "explained", "{name}");
            assert_eq!(names(&report), [name]);
            let parameter = &report["effects"][0]["parameters"][0];
            let [_, low, high] = estimate(parameter).unwrap();
            assert!(low < truth && truth < high, "{parameter}");

            // The written model predicts the same when it is read again.
            let read = |model: &str| scratch.evaluated(&format!("{model} --test run91.csv"));
            let fitted = read("--model report/model.toml") / error(&report, "after");
            assert_near(fitted, 1.0, 1e-9, name);
            let hybrid = read("--checkpoint report/checkpoint") / error(&report, "hybrid");
            assert_near(hybrid, 1.0, 1e-4, name);
        }
    }
}
