//! Bad input gives one clear error that names the place and the remedy, exit status 2, and no half-written files.

use crate::support::tables::{rows, says_words};
use crate::support::{Scratch, says};

const GOOD: &str = "time,q1,qd1,tau1\n0,0.1,0,0\n0.01,0.1,0,0\n0.02,0.1,0,0\n";

/// The message with which closing the loop of a model on `log.csv` is refused; it must not create a folder.
fn refused(scratch: &Scratch, model: &str) -> String {
    let message = scratch.refuses(&format!(
        "closeloop --model {model} --train log.csv --out out"
    ));
    assert!(!scratch.has("out"), "a folder was left behind");
    message
}

/// Contents of a log, and words of the message.
const LOGS: &str = r#"
                                                                 | log.csv ... empty
time,q1,qd1,tau1\n                                               | log.csv ... row
time,q1,qd1,tau1\n0,0.1,0,0\n                                    | log.csv ... 1 row(s) ... at least two
time,q1,velocity,tau1\n0,1,2,3\n1,1,2,3\n                        | log.csv ... qd1 ... [columns]
time,q1,qd1,tau1\n0,abc,0,0\n1,0,0,0\n                           | log.csv, line 2 ... q1 ... "abc" is not a number
time,q1,qd1,tau1\n0,NaN,0,0\n1,0,0,0\n                           | log.csv, line 2 ... q1 ... NaN
time,q1,qd1,tau1\n0,0,0,0\n0,0,0,0\n                             | log.csv, line 3 ... time
time,q1,q2,qd1,qd2,tau1,tau2\n0,0,0,0,0,0,0\n1,0,0,0,0,0,0\n     | log.csv ... joint
time,q1,qd1,tau1\n0,0,0\n1,0,0,0\n                               | log.csv, line 2
time,q1,qd1,tau1\n0,0.1,0,0\n0.01,0.1,0,0\n0.02,0.1,0,0\n        | too short ... --test
"#;

#[test]
fn a_log_that_cannot_be_read_is_refused_with_its_place() {
    let scratch = Scratch::new();
    for [contents, words] in rows(LOGS) {
        scratch.file("log.csv", contents);
        says_words(&refused(&scratch, "pendulum"), &words);
    }
}

/// A text of the pendulum's model file, what stands there instead, and words of the message.
const MODELS: &str = r#"
C_g * sin         | C_q * sin          | model.toml, line 11, column 8 ... unknown name `C_q` ... `C_g` ... ^^^
sin(q1)           | sinus(q1)          | line 11 ... unknown function `sinus` ... `sin`
sin(q1) +         | sin(q1 +           | line 11 ... never closed
sin(q1) +         | (2 sin(q1)) +      | line 11 ... expected an operator, or `)`, found `s`
[dynamics]        | [dynamics.let]\na = "2 * b"\nb = "q1"\n\n[dynamics] | line 11 ... `a` uses `b`, which is defined after it; move it up
value = 15.0      | vlaue = 15.0       | line 7 ... unknown key `vlaue` ... `value`
joints = 1        | joints = 1.5       | line 4 ... whole number
joints = 1        | joints = "one"     | line 4 ... a number
[dynamics]        | [dynamik]          | unknown key `dynamik` ... `dynamics`
name = "pendulum" | name = pendulum    | line 2
positive = true   | bounds = [5, 6]    | line 8 ... outside its bounds
C_i = {           | tau1 = {           | the name `tau1` is taken
"#;

#[test]
fn errors_in_model_files_name_line_column_and_a_similar_name() {
    let scratch = Scratch::new();
    scratch.file("log.csv", GOOD);
    for [from, to, words] in rows(MODELS) {
        scratch.model("model.toml", &from, &to);
        says_words(&refused(&scratch, "model.toml"), &words);
    }
}

/// An effect in the pendulum's model file, and words of the message.
const EFFECTS: &str = r#"
name = "coulom_friction"\njoint = 1\nF_c = 0.1                   | unknown effect `coulom_friction` ... `coulomb_friction`
name = "coulomb_friction"\njoint = 2\nF_c = 0.1                  | `joint` must be a number from 1 to 1
name = "coulomb_friction"\njoint = 1\nFc = 0.1                   | unknown key `Fc` ... `F_c`
name = "rotor_inertia"\njoint = 1\nJ = 0.1                       | line 13 ... `rotor_inertia` needs a model that gives `mass` and `bias`
name = "viscous_friction"\njoint = 1\nb = -1                     | b = -1 is outside 0 to inf
name = "viscous_friction"\njoint = 1\nb = 1\n[[effect]]\nname = "viscous_friction"\njoint = 1\nb = 1 | already acts on joint 1
name = "actuator_delay"\njoint = 1\nd = 0.2                      | d = 0.2 is outside 0 to 0.1
name = "viscous_friction"\njoint = 1\nb = { value = 1, logs = { a = 1 } } | line 16, column 5 ... `b` has one value in all logs ... `fixed = true`
name = "sensor_offset"\njoint = 1\nq_z = { value = 0, logs = { a = 3 } }  | line 13 ... q_z = 3 is outside -0.5 to 0.5
"#;

#[test]
fn an_effect_that_cannot_act_is_refused() {
    let scratch = Scratch::new();
    scratch.file("log.csv", GOOD);
    for [effect, words] in rows(EFFECTS) {
        let with = format!("[[effect]]\n{effect}\n\n[energy]");
        scratch.model("model.toml", "[energy]", &with);
        says_words(&refused(&scratch, "model.toml"), &words);
    }
}

#[test]
fn per_takes_no_value_but_log() {
    let scratch = Scratch::new();
    let contents = "[effect]\nname = \"zero\"\nabout = \"zero\"\nangle = \"q - z\"\n\n[parameters]\n\
                z = { unit = \"rad\", typical = 0.1, per = \"week\" }\n";
    scratch.file("zero.toml", contents);
    let words = "zero.toml, line 7, column 42 ... `per` must be \"log\" ... \"week\"";
    says_words(&scratch.refuses("list effects --effects ."), words);
}

/// Commands, and words of their messages.
const COMMANDS: &str = r#"
closeloop --model pendulun --train log.csv                        | pendulun ... acrobot, cartpole, drive, motor, pendulum, servo
evaluate --model pendulum --test nowhere.csv                      | nowhere.csv
evaluate --model pendulum --test log.csv --leave-out other.csv@0-1 | other.csv ... log.csv
evaluate --model pendulum --test log.csv --leave-out log.csv@3-1  | 3 ... 1
evaluate --model pendulum --test log.csv --leave-out log.csv      | @
evaluate --checkpoint nowhere --test log.csv                      | nowhere
evaluate --checkpoint damaged --test log.csv                      | checkpoint.json
simulate --plant pendulum --out x.csv --effect coulomb=0.1        | unknown effect `coulomb` ... `coulomb_friction`
simulate --plant pendulum --out x.csv --effect coulomb_friction.F_d=0.1 | no parameter `F_d` ... `F_c`
simulate --plant pendulum --out x.csv --effect coulomb_friction@3=0.1   | `joint` must be from 1 to 1
simulate --plant pendulum --out x.csv --effect coulomb_friction=much    | "much" is not a number
control --model pendulum --plant nope                             | one of the plants ... pendulum-real
closeloop --out a-file/report                                     | a-file ... --out
closeloop --out a-file                                            | is a file ... --out
simulate --plant pendulum --out a-file/report/log.csv             | a-file
report .                                                          | report.json ... residyn closeloop
report nonsense                                                   | line 2 column
report old                                                        | it has schema 1 ... reads schema 2 ... make the report again
"#;

#[test]
fn what_is_named_wrongly_or_cannot_be_used_is_said_with_a_remedy() {
    let scratch = Scratch::new();
    for folder in ["damaged", "nonsense", "old"] {
        std::fs::create_dir(scratch.path(folder)).unwrap();
    }
    let report = include_str!("golden/small_pendulum/report.json");
    assert!(report.contains("\"schema\": 2"));
    let old = report.replace("\"schema\": 2", "\"schema\": 1");
    for (name, contents) in [
        ("log.csv", GOOD),
        ("a-file", ""),
        ("damaged/checkpoint.json", "{ not json"),
        ("nonsense/report.json", "{\"schema\": 1,\n nonsense}"),
        ("old/report.json", &old),
    ] {
        scratch.file(name, contents);
    }
    let there = scratch.count();
    for [line, words] in rows(COMMANDS) {
        says_words(&scratch.refuses(&line), &words);
    }
    assert_eq!(scratch.count(), there, "something was written");
    assert!(!scratch.has("nonsense/report.html"));
}

#[test]
fn a_rig_that_diverges_is_reported() {
    let scratch = Scratch::new();
    scratch.moving_by("model.toml", "C_g * sin(q1) + C_i * tau1 + exp(abs(q1))^4");
    let message = scratch.ends_without("simulate --plant model.toml --out log.csv");
    says(&message, &["diverges"]);
    assert!(!scratch.has("log.csv"));
}

#[test]
fn an_error_states_its_cause_once() {
    let scratch = Scratch::new();
    for command in ["train", "experiment physics-prior"] {
        let message = scratch.refuses(&format!("{command} --config none.toml --out out"));
        assert_eq!(message.matches("No such file").count(), 1, "{message}");
        says(&message, &["none.toml", "--config"]);
        assert!(!scratch.has("out"), "a folder was left behind");
    }
}
