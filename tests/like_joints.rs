//! Joints that are built alike: what a model file may say of them, and what they share.

use serde_json::Value;

use crate::support::tables::effects;
use crate::support::{Scratch, says};

/// Two pendulums side by side on one base, each on a position loop whose gains are known.
fn twins(like: &str, parameters: &str) -> String {
    let link = |number: usize, place: f64| {
        format!(
            "[[chain.link]]\njoint = {number}\nparent = 0\norigin = [0.0, {place:?}, 0.0]\naxis = [0.0, 1.0, 0.0]\n\
             across = [1.0, 0.0, 0.0]\nmass = \"m_{number}\"\nmoment = [\"mx_{number}\", \"0\", \"0\"]\n\
             inertia = [\"0.2*J_{number}\", \"0\", \"0\", \"J_{number}\", \"0\", \"J_{number}\"]\n"
        )
    };
    format!(
        "[system]\nname = \"twins\"\njoints = 2\njoint_names = [\"left\", \"right\"]\n{like}\n\
         [parameters]\n{parameters}\n\
         [drive]\ntau1 = \"kp*(cmd1 - q1) - kd*qd1\"\ntau2 = \"kp*(cmd2 - q2) - kd*qd2\"\n\
         [chain]\ngravity = [\"0\", \"0\", \"-9.81\"]\n{}{}",
        link(1, 0.2),
        link(2, -0.2)
    )
}

const LIKE: &str = "like = [[\"left\", \"right\"]]";

const PARAMETERS: &str = r#"
m_1 = { value = 0.8, unit = "kg", fixed = true }
m_2 = { value = 0.8, unit = "kg", fixed = true }
mx_1 = { value = 0.12, unit = "kg m" }
mx_2 = { value = 0.12, unit = "kg m" }
J_1 = { value = 0.03, unit = "kg m^2", positive = true }
J_2 = { value = 0.03, unit = "kg m^2", positive = true }
kp = { value = 20.0, unit = "N m/rad", fixed = true }
kd = { value = 0.6, unit = "N m s/rad", fixed = true }
"#;

/// The right one is worn.
const HIDDEN: &str = "
coulomb_friction | 1 | F_c = 0.2
coulomb_friction | 2 | F_c = 0.36
viscous_friction | 1 | b = 0.15
viscous_friction | 2 | b = 0.15
actuator_delay   | 1 | d = 0.012
actuator_delay   | 2 | d = 0.012
";

const MOVED: &str = "
sensor = { rate_hz = 200, position_noise = 1e-4, position_step = 0 }
excitation = { amplitude = [0.5, 0.5], band_hz = [0.1, 3.0], tones = 8 }
recording = { logs = 1, duration_s = 12, start = [0, 0, 0, 0] }
";

fn recorded(scratch: &Scratch) {
    let built = twins("", PARAMETERS) + &effects(HIDDEN);
    scratch.file("built.toml", built);
    scratch.file("plant.toml", format!("model = \"built.toml\"\n{MOVED}"));
    for seed in 1..=3 {
        scratch.succeeds(&format!(
            "simulate --plant plant.toml --out run{seed}.csv --seed {seed}"
        ));
    }
}

/// Value and 95 % interval of the first parameter of an effect on each joint.
fn on_both(report: &Value, name: &str) -> [[f64; 3]; 2] {
    [1, 2].map(|joint| {
        let effects = report["effects"].as_array().unwrap().iter();
        let own = effects.filter(|effect| effect["name"] == name && effect["joint"] == joint);
        let own: Vec<&Value> = own.collect();
        assert_eq!(own.len(), 1, "{name} {joint}: {report:#}");
        let parameter = &own[0]["parameters"][0];
        let of = |value: &Value| value.as_f64().unwrap();
        [
            of(&parameter["value"]),
            of(&parameter["ci95"][0]),
            of(&parameter["ci95"][1]),
        ]
    })
}

fn holds([_, low, high]: [f64; 3], truth: f64) -> bool {
    low <= truth && truth <= high
}

#[test]
fn groups_that_cannot_be_are_refused_with_their_place() {
    let scratch = Scratch::new();
    for (like, words) in [
        (
            "like = [[\"left\", \"rihgt\"]]",
            "line 5, column 18: there is no joint `rihgt`; the joints are left, right",
        ),
        (
            "like = [[\"left\"]]",
            "line 5, column 10: `left` is alone in its group",
        ),
        (
            "like = [[\"left\", \"right\", 1]]",
            "line 5, column 27: joint `1` is in two groups, or twice in one",
        ),
        (
            "like = [\"left\"]",
            "line 5, column 9: `like` must be a list of",
        ),
    ] {
        scratch.file("twins.toml", twins(like, PARAMETERS));
        let message = scratch.refuses("check twins.toml");
        says(&message, &[words]);
    }
    // By numbers, where joints have no names, too.
    scratch.file("twins.toml", twins("like = [[1, 2]]", PARAMETERS));
    scratch.succeeds("check twins.toml");
}

mod slow {
    use super::*;

    #[test]
    fn joints_that_are_declared_alike_share_what_the_logs_do_not_tell_apart() {
        let scratch = Scratch::new();
        recorded(&scratch);
        scratch.file("alike.toml", twins(LIKE, PARAMETERS));
        scratch.file("free.toml", twins("like = []", PARAMETERS));
        let found = |model: &str, errors: &str| {
            scratch.json(&format!(
                "closeloop --model {model} --train run1.csv run2.csv --test run3.csv {errors} --out {model}.out"
            ))
        };
        let free = found("free.toml", "--errors torque");
        for errors in ["", "--errors torque"] {
            let alike = found("alike.toml", errors);
            for (name, truth) in [("viscous_friction", 0.15), ("actuator_delay", 0.012)] {
                let [left, right] = on_both(&alike, name);
                assert_eq!(left, right, "{name} is shared");
                assert!(holds(left, truth), "{name}: {left:?}");
                let [alone, other] = on_both(&free, name);
                assert_ne!(
                    alone[0].to_bits(),
                    other[0].to_bits(),
                    "{name} is not shared by default"
                );
            }
            // One is worn, and that is a finding.
            for (own, truth) in on_both(&alike, "coulomb_friction")
                .into_iter()
                .zip([0.2, 0.36])
            {
                assert!(holds(own, truth), "{own:?}, not {truth}");
            }
            let differences = alike["differences"].as_array().unwrap();
            assert!(
                differences
                    .iter()
                    .any(|difference| difference.to_string().contains("coulomb_friction")),
                "{differences:?}"
            );
        }
        assert!(scratch.read("alike.toml.out/model.toml").contains(LIKE));
    }
}
