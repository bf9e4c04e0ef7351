//! Further measured columns of logs in formulas: a supply voltage in a drive, a temperature in an effect.

use std::fmt::Write as _;

use residyn::{Library, Log, Model, read_log, read_model, rng};
use residyn_core::closeloop::{Declared, Problem, Settings, unexplained};
use residyn_core::sim::metric::{assess, torque_error};

use crate::support::tables::{rows, says_words};
use crate::support::{Scratch, says};

/// A motor under a duty cycle of its supply voltage.
const MOTOR: &str = r#"
[system]
name = "motor"
joints = 1
[measured]
u_volts = "V"
[drive]
tau1 = "k_t*(u_volts*cmd1 - k_e*qd1)/R"
[parameters]
k_t = { value = 0.3, unit = "N m/A", positive = true }
k_e = { value = 0.3, unit = "V s/rad", fixed = true }
R = { value = 2.0, unit = "Ohm", fixed = true }
J = { value = 0.02, unit = "kg m^2", fixed = true }
[dynamics]
mass = [["J"]]
bias = ["0"]
"#;
const TORQUE_CONSTANT: f64 = 0.33;
/// N m
const FRICTION: f64 = 0.05;

/// A joint under torques.
const JOINT: &str = r#"
[system]
name = "joint"
joints = 1
[measured]
u_temp = "K"
[parameters]
J = { value = 0.02, unit = "kg m^2", fixed = true }
[dynamics]
mass = [["J"]]
bias = ["0"]
"#;
const WARM: &str = r#"
[effect]
name = "warm_friction"
about = "viscous friction of grease that warms up"
force = "-b * exp(-c*(u_temp - 293)) * qd"
contains = ["viscous_friction"]
[parameters]
b = { unit = "N m s/rad", typical = 0.05, positive = true }
c = { unit = "1/K", typical = 0.01, bounds = [0, 1], start = 0.01 }
"#;
const DAMPING: f64 = 0.06;
/// 1/K
const FADING: f64 = 0.03;

/// One row of a log: what is commanded, and what the further column reads.
type Given = [f64; 2];

/// A log of a rig at rest with a row every 10 ms, integrated apart from the library's own steppers, in steps of a tenth of
/// a millisecond; `acceleration` is that of the speed, of what is given, which is held over each row, and of the row's time.
fn log(
    header: &str,
    seconds: f64,
    given: impl Fn(f64) -> Given,
    acceleration: impl Fn(f64, Given, f64) -> f64,
) -> String {
    let (mut q, mut qd) = (0.0_f64, 0.0_f64);
    let mut text = format!("{header}\n");
    let mut row = 0;
    while 0.01 * f64::from(row) < seconds {
        let time = 0.01 * f64::from(row);
        let held = given(time);
        // Noise of a tenth of a milliradian that any order of rows draws alike.
        let noise = 1e-4 * (f64::from(row) * 12.9898).sin() * 1.4;
        let [driven, column] = held;
        writeln!(text, "{time},{:?},{qd:?},{driven:?},{column:?}", q + noise).unwrap();
        for _ in 0..100 {
            let step = 1e-4;
            let middle = qd + 0.5 * step * acceleration(qd, held, time);
            let slope = acceleration(middle, held, time);
            q += step * (qd + 0.5 * step * slope);
            qd += step * slope;
        }
        row += 1;
    }
    text
}

fn tones(time: f64, number: f64) -> f64 {
    let tone = |hz: f64, phase: f64| (std::f64::consts::TAU * hz * time + phase * number).sin();
    0.4 * tone(0.31, 1.0) + 0.3 * tone(0.83, 2.0) + 0.2 * tone(1.9, 3.0)
}

/// A battery that runs down from 14 V, and sags and recovers.
fn volts(time: f64, number: f64) -> f64 {
    14.0 - 0.15 * time + 2.0 * (0.9 * time + number).sin()
}

fn motor_log(header: &str, number: f64) -> String {
    log(
        header,
        20.0,
        |time| [tones(time, number), volts(time, number)],
        |qd, given, _| motor(qd, given),
    )
}

/// The acceleration of the motor as it is.
fn motor(qd: f64, [duty, volts]: Given) -> f64 {
    let torque = TORQUE_CONSTANT * (volts * duty - 0.3 * qd) / 2.0;
    (torque - FRICTION * (qd / 2e-3).tanh()) / 0.02
}

/// Grease that warms by 40 K within a log.
fn joint_log(number: f64) -> String {
    log(
        "time,q1,qd1,tau1,u_temp",
        30.0,
        |time| [1.2 * tones(time, number), 293.0 + 40.0 * time / 30.0],
        |qd, [torque, temp], _| {
            let friction = DAMPING * (-FADING * (temp - 293.0)).exp() * qd;
            (torque - friction) / 0.02
        },
    )
}

/// Model, logs of it and the effect that they show.
fn scratch() -> Scratch {
    let scratch = Scratch::new();
    scratch.file("motor.toml", MOTOR);
    scratch.file("joint.toml", JOINT);
    std::fs::create_dir(scratch.path("effects")).unwrap();
    scratch.file("effects/warm.toml", WARM);
    scratch
}

const STANDARD: &str = "time,q1,qd1,cmd1,u_volts";

/// The motor as it is: with its torque constant and its friction.
fn true_motor() -> String {
    let as_built = MOTOR.replace(
        "value = 0.3, unit = \"N m/A\"",
        "value = 0.33, unit = \"N m/A\"",
    );
    format!("{as_built}\n[[effect]]\nname = \"coulomb_friction\"\njoint = 1\nF_c = {FRICTION}\n")
}

#[test]
fn a_drive_follows_the_supply_from_row_to_row() {
    let scratch = scratch();
    scratch.file("true.toml", true_motor());
    scratch.file("run.csv", motor_log(STANDARD, 1.0));
    let constant = true_motor().replace("u_volts*cmd1", "12.5*cmd1");
    scratch.file("constant.toml", constant);
    let library = Library::built_in();
    let errors = ["true", "constant"].map(|name| {
        let model = read_model(scratch.path(&format!("{name}.toml")), &library).unwrap();
        let log = read_log(scratch.path("run.csv"), &model).unwrap();
        assert_eq!(log.measured[0].name, "u_volts");
        assert_eq!(log.measured[0].values.len(), log.rows());
        let motion = assess(&model.dynamics(), std::slice::from_ref(&log), &[0.5]).position_rms();
        let torques = torque_error(&model, &[log]).unwrap().relative;
        [motion, torques]
    });
    let [[motion, torques], [motion_at_constant, torques_at_constant]] = errors;
    assert!(
        motion < 2e-3 && motion < 0.02 * motion_at_constant,
        "{errors:?}"
    );
    assert!(
        torques < 0.02 && torques < 0.2 * torques_at_constant,
        "{errors:?}"
    );
}

/// The command waits, and the supply does not.
#[test]
fn a_delay_holds_back_the_command_alone() {
    let scratch = scratch();
    let late = "\n[[effect]]\nname = \"actuator_delay\"\njoint = 1\nd = 0.02\n";
    scratch.file("late.toml", true_motor() + late);
    // Two rows, before which the duty cycle was that of the first.
    let logged = log(
        STANDARD,
        20.0,
        |time| [tones(time, 1.0), volts(time, 1.0)],
        |qd, _, time| motor(qd, [tones((time - 0.02).max(0.0), 1.0), volts(time, 1.0)]),
    );
    scratch.file("run.csv", logged);
    let model = read_model(scratch.path("late.toml"), &Library::built_in()).unwrap();
    let log = read_log(scratch.path("run.csv"), &model).unwrap();
    let prompt = model.with_effects(vec![model.effects[0].clone()]);
    let error = |model: &Model| {
        assess(&model.dynamics(), std::slice::from_ref(&log), &[0.5]).position_rms()
    };
    assert!(error(&model) < 2e-3, "{}", error(&model));
    assert!(error(&prompt) > 5.0 * error(&model), "{}", error(&prompt));
}

#[test]
fn a_written_log_has_its_measured_columns() {
    let scratch = scratch();
    scratch.file("run.csv", motor_log(STANDARD, 1.0));
    let model = read_model(scratch.path("motor.toml"), &Library::built_in()).unwrap();
    let log = read_log(scratch.path("run.csv"), &model).unwrap();
    residyn::write_log(&log, scratch.path("again.csv")).unwrap();
    let again = read_log(scratch.path("again.csv"), &model).unwrap();
    assert_eq!((&again.measured, &again.tau), (&log.measured, &log.tau));
}

#[test]
fn a_log_without_the_column_is_refused() {
    let scratch = scratch();
    let log = motor_log("time,q1,qd1,cmd1,vbus", 1.0);
    scratch.file("run.csv", log);
    for command in ["closeloop --train", "evaluate --test", "audit"] {
        let (command, flag) = command.split_once(' ').unwrap_or((command, ""));
        let said = scratch.refuses(&format!("{command} --model motor.toml {flag} run.csv"));
        says(
            &said,
            &[
                "run.csv, line 1: there is no column \"u_volts\"; the header has",
                "Rename it, or name it under [columns] in the model file: u_volts = \"NAME\"",
            ],
        );
    }
}

#[test]
fn logs_in_memory_without_the_column_are_refused() {
    use residyn::{Channels, Request, close_loop};
    let library = Library::built_in();
    let model = library.model_from_text("joint.toml", JOINT).unwrap();
    let time: Vec<f64> = (0..400).map(|row| 0.01 * f64::from(row)).collect();
    let channels = Channels {
        q: vec![time.iter().map(|t| t.sin()).collect()],
        time,
        ..Channels::default()
    };
    let log = channels.log("run").unwrap();
    let logs = vec![log.clone(), log];
    let refused = close_loop(Request::of(&model, &library, logs), &mut rng(0), &());
    says(
        &refused.err().unwrap().to_string(),
        &["run, arrays: there is no column \"u_temp\""],
    );
}

#[test]
fn another_name_and_unit_are_mapped_under_columns() {
    let scratch = scratch();
    let columns = "[columns]\nu_volts = { column = \"vbus\", unit = \"mV\" }\n";
    scratch.file(
        "motor.toml",
        MOTOR.replace("[drive]", &format!("{columns}[drive]")),
    );
    let log = "time,q1,qd1,cmd1,vbus\n0,0,0,0.1,12000\n0.01,0,0,0.1,12500\n0.02,0,0,0.1,13000\n";
    scratch.file("run.csv", log);
    let model = read_model(scratch.path("motor.toml"), &Library::built_in()).unwrap();
    let log = read_log(scratch.path("run.csv"), &model).unwrap();
    assert_eq!(log.measured[0].name, "u_volts");
    assert_eq!(log.measured[0].values, [12.0, 12.5, 13.0]);
}

#[test]
fn names_that_nothing_declares_are_columns_without_a_unit() {
    let scratch = scratch();
    scratch.file(
        "short.toml",
        MOTOR.replace("[measured]\nu_volts = \"V\"\n", ""),
    );
    scratch.file("run.csv", motor_log(STANDARD, 1.0));
    scratch.succeeds("check short.toml");
    let evaluated = |model: &str| {
        scratch.json(&format!(
            "evaluate --model {model} --test run.csv --horizon 0.5"
        ))["position_rmse"]
            .clone()
    };
    assert_eq!(evaluated("short.toml"), evaluated("motor.toml"));
    let warm = "[[effect]]\nname = \"warm_friction\"\njoint = 1\nb = 1\nc = 1\n[drive]";
    scratch.file("warm.toml", MOTOR.replace("[drive]", warm));
    let said = scratch.refuses("evaluate --model warm.toml --test run.csv --effects effects");
    says(&said, &["there is no column \"u_temp\""]);
}

/// What replaces `[drive]` in the motor's file, and words of the message.
const MISTAKES: &str = r#"
[columns]\nu_volts = { column = "t", unit = "K" }\n[drive] | a column in K does not hold `u_volts`, which is in `V` under [measured]
[columns]\nu_amps = "amps"\n[drive]                        | unknown key `u_amps` in [columns]
volts = "V"\n[drive]                                       | `volts` cannot be a measured column: its name begins with u_
[parameters.u_volts]\nvalue = 1\n[drive]                   | u_volts
"#;

#[test]
fn mistakes_in_the_model_file_are_refused() {
    let scratch = scratch();
    for [wrong, words] in rows(MISTAKES) {
        scratch.file("wrong.toml", MOTOR.replace("[drive]", &wrong));
        let said = scratch.refuses("check wrong.toml --effects effects");
        says_words(&said, &words);
    }
}

/// What replaces the drive's formula, and what `check` says of it.
const UNITS: &str = r#"
k_t*(u_volts - k_e)/R + 0*cmd1 | `u_volts` [V] and `k_e` [N m/A] cannot be added or compared
k_t*u_volts/R^2 + 0*cmd1       | the torque `tau1` is ... [s A^2]
"#;

#[test]
fn units_of_measured_columns_are_checked() {
    let scratch = scratch();
    let drive = "k_t*(u_volts*cmd1 - k_e*qd1)/R";
    scratch.succeeds("check motor.toml");
    for [formula, words] in rows(UNITS) {
        scratch.file("wrong.toml", MOTOR.replace(drive, &formula));
        says_words(&scratch.answers("check wrong.toml"), &words);
    }
    let odd = MOTOR.replace("u_volts = \"V\"", "u_volts = \"furlong\"");
    scratch.file("odd.toml", odd);
    says(
        &scratch.answers("check odd.toml"),
        &["the unit `furlong` of `u_volts` is not a product of SI units"],
    );
}

/// A log of a joint whose grease is warm and cold in turn, other than the time goes.
fn changing_log(number: f64) -> String {
    log(
        "time,q1,qd1,tau1,u_temp,u_note",
        20.0,
        |time| {
            [
                1.2 * tones(time, number),
                313.0 + 20.0 * (0.7 * time + number).sin(),
            ]
        },
        |qd, [torque, temp], _| {
            let friction = DAMPING * (-FADING * (temp - 293.0)).exp() * qd;
            (torque - friction) / 0.02
        },
    )
}

#[test]
fn a_residual_that_goes_with_a_column_is_said_to() {
    let scratch = scratch();
    let undeclared = JOINT.replace("[measured]\nu_temp = \"K\"\n", "");
    let viscous = "\n[[effect]]\nname = \"viscous_friction\"\njoint = 1\nb = 0.03\n";
    scratch.file("joint.toml", undeclared + viscous);
    let library = Library::built_in();
    let model = read_model(scratch.path("joint.toml"), &library).unwrap();
    let logs: Vec<Log> = (1..=4)
        .map(|k| {
            // A column that is not made of numbers is left out.
            let text = changing_log(f64::from(k)).replace('\n', ",warm\n");
            let text = text.replacen(",warm", "", 1);
            read_log(scratch.file(&format!("run{k}.csv"), text), &model).unwrap()
        })
        .collect();
    assert!(
        logs[0]
            .notes
            .iter()
            .any(|note| note.contains("\"u_note\" is ignored"))
    );
    let (settings, nothing) = (Settings::default(), Library::empty());
    let problem = Problem::new(&model, &nothing, &logs, &settings);
    let Declared { problem, fitted } = problem.fit_declared().unwrap();
    let left = unexplained(&problem, library.probes(), &fitted, &fitted, &mut rng(0));
    assert_eq!(left.place, "u_temp", "{left:?}");
}

/// Command lines that run a model without a log.
const WITHOUT_LOGS: &str = r#"
simulate --plant motor.toml --out run.csv                    | a simulated rig has no such column
export --model motor.toml --format c --out motor.c           | an exported file has no such column
export --model motor.toml --format json --out motor.json     | an exported file has no such column
control --plant pendulum --model motor.toml                  | a planner has no such column
control --plant motor.toml --model pendulum                  | a simulated rig has no such column
train --config recipe.toml --out trained                     | a trained model has no such column
"#;

#[test]
fn what_runs_without_a_log_refuses_a_model_that_reads_columns() {
    let scratch = scratch();
    scratch.file("run.csv", motor_log(STANDARD, 1.0));
    scratch.file(
        "recipe.toml",
        "model = \"motor.toml\"\nkind = \"physics\"\n[data]\nlogs = [\"run.csv\"]\nstep_s = 0.01\nsteps = 10\n",
    );
    for [line, words] in rows(WITHOUT_LOGS) {
        let said = scratch.refuses(&line);
        says(
            &said,
            &["motor reads the measured column `u_volts` of logs"],
        );
        says_words(&said, &words);
    }
}

mod slow {
    use super::{
        DAMPING, FADING, FRICTION, STANDARD, TORQUE_CONSTANT, joint_log, motor_log, scratch,
    };
    use crate::support::reports::{estimate, names};

    #[test]
    fn friction_is_named_behind_a_drive_on_a_battery() {
        let scratch = scratch();
        for k in 1..=4 {
            scratch.file(&format!("run{k}.csv"), motor_log(STANDARD, f64::from(k)));
        }
        scratch.succeeds(
            "closeloop --model motor.toml --train run1.csv run2.csv run3.csv --test run4.csv --errors motion --out report",
        );
        let report = scratch.read_json("report/report.json");
        assert_eq!(names(&report), ["coulomb_friction"]);
        let [friction, ..] = estimate(&report["effects"][0]["parameters"][0]).unwrap();
        assert!((friction / FRICTION - 1.0).abs() < 0.02, "{friction}");
        let written = scratch.read("report/model.toml");
        assert!(written.contains("[measured]\nu_volts = \"V\""), "{written}");
        let constant = report["parameters"].as_array().unwrap();
        let constant = constant.iter().find(|p| p["name"] == "k_t").unwrap();
        let constant = constant["value"].as_f64().unwrap();
        assert!(
            (constant / TORQUE_CONSTANT - 1.0).abs() < 0.01,
            "{constant}"
        );
        assert!(scratch.evaluated("--model report/model.toml --test run4.csv") < 5e-3);
    }

    #[test]
    fn friction_that_falls_with_temperature_is_found_from_torques() {
        let scratch = scratch();
        for k in 1..=4 {
            scratch.file(&format!("run{k}.csv"), joint_log(f64::from(k)));
        }
        scratch.succeeds(
            "closeloop --model joint.toml --effects effects --train run1.csv run2.csv run3.csv --test run4.csv --errors \
             torque --out report",
        );
        let report = scratch.read_json("report/report.json");
        assert_eq!(names(&report), ["warm_friction"]);
        let value = |k: usize| estimate(&report["effects"][0]["parameters"][k]).unwrap()[0];
        assert!((value(0) / DAMPING - 1.0).abs() < 0.03, "{}", value(0));
        assert!((value(1) / FADING - 1.0).abs() < 0.05, "{}", value(1));
        scratch.succeeds(
            "evaluate --model report/model.toml --effects effects --test run4.csv --torque",
        );
    }
}
