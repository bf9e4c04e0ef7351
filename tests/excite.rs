//! `residyn excite`, and what `residyn audit` says of how well logs excite a model.

use residyn_core::data::Columns;
use residyn_io::read_rig_log;

use crate::support::tables::{rows, says_words};
use crate::support::{Scratch, says};

const LIMITS: &str = "
[[joint]]
angle = [-1.0, 1.0]
speed = 4.0
acceleration = 20.0
torque = 12.0
";

const RIG: &str = "
[system]
name = \"joint\"
joints = 1
[parameters]
J = { value = 1.0 }
[dynamics]
mass = [[\"J\"]]
bias = [\"0\"]
";

#[test]
fn a_motion_within_limits_is_written_with_what_it_will_tell() {
    let scratch = Scratch::new();
    scratch.file("limits.toml", LIMITS);
    let line = "excite --model pendulum --limits limits.toml --duration 4 --out motion.csv";
    let found = scratch.json(&format!("{line} --alternative coulomb_friction=0.2"));
    let intervals = found["design"]["expected"].as_array().unwrap();
    let names: Vec<&str> = (intervals.iter())
        .map(|one| one["parts"][0][0].as_str().unwrap())
        .collect();
    assert_eq!(names, ["C_i", "C_g"]);
    assert!(
        intervals
            .iter()
            .all(|one| one["half_width"].as_f64().unwrap() > 0.0)
    );
    assert!(found["design"]["evidence"][0].as_f64().unwrap() > 100.0);
    let motion = read_rig_log(scratch.path("motion.csv"), 1, &Columns::default()).unwrap();
    assert_eq!(motion.rows(), 401);
    assert!(motion.q[0].iter().all(|q| q.abs() <= 1.0));
    assert!(motion.qd[0][0].abs() < 1e-9 && motion.tau[0].iter().all(|tau| tau.abs() <= 12.0));
    assert!(scratch.read("motion.svg").contains("<svg"));
    let again = scratch.json(&format!("{line} --alternative coulomb_friction=0.2"));
    assert_eq!(again["design"], found["design"]);
}

/// States that a saturating motor cannot hold show nothing, and stop nothing.
#[test]
fn a_motor_that_saturates_late_is_moved_within_what_it_holds() {
    let scratch = Scratch::new();
    scratch.file("limits.toml", LIMITS);
    let effect =
        |name: &str, value: &str| format!("[[effect]]\nname = \"{name}\"\njoint = 1\n{value}\n");
    let late = effect("actuator_delay", "d = 0.01") + &effect("actuator_saturation", "m = 5.0");
    scratch.file("rig.toml", format!("{RIG}{late}"));
    let line = "excite --model rig.toml --limits limits.toml --duration 4 --out motion.csv";
    let found = scratch.json(line);
    let uses = found["design"]["uses"].as_array().unwrap();
    assert!(
        uses.iter().all(|one| one["share"].as_f64().unwrap() <= 1.0),
        "{uses:?}"
    );
}

#[test]
fn limits_that_allow_no_motion_and_mistakes_in_them_are_told() {
    let scratch = Scratch::new();
    let line = "excite --model pendulum --limits limits.toml --duration 4 --out motion.csv";
    for [from, to, words] in rows(
        "torque = 12.0 | torque = -1.0 | limits.toml, line 6, column 10: `torque` is -1; write a number above zero
         speed = 4.0   | spede = 4.0   | limits.toml, line 4 ... spede
         [-1.0, 1.0]   | [1.0, -1.0]   | `angle` is [1, -1]; write [least, greatest]",
    ) {
        scratch.file("limits.toml", LIMITS.replace(&from, &to));
        says_words(&scratch.refuses(line), &words);
    }
    // Upright, and too weak to rest anywhere but there and below.
    scratch.file(
        "limits.toml",
        LIMITS
            .replace("[-1.0, 1.0]", "[0.5, 1.0]")
            .replace("12.0", "0.5"),
    );
    says(
        &scratch.ends_without(line),
        &["no motion: the rig cannot rest"],
    );
    assert!(!scratch.has("motion.csv"));
}

#[test]
fn an_audit_says_what_logs_do_not_tell_of_a_model() {
    let scratch = Scratch::new();
    scratch.answers("simulate --plant acrobot --duration 4 --out run.csv");
    let text = scratch.answers("audit --model acrobot run.csv");
    says(&text, &["excitation:", "sums of parameters are told"]);
}
