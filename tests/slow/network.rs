//! The residual network on motion unlike its training data.

use std::path::Path;

use serde_json::Value;

use crate::support::{evaluated, succeeds, text};

/// Angle-dependent friction on one side of the turn: no effect of the library matches it, and a network trained on slow
/// motion extrapolates it arbitrarily where the pendulum swings higher and faster.
const ROUGH: &str = r#"
[effect]
name = "rough_side"
about = "friction on one side only, and not the same everywhere"
force = "-size * sign(qd) * (1 + sin(3*q)) * where(q > 0, 1.0, 0.0)"
[parameters]
size = { unit = "N m", typical = 0.3 }
"#;

/// Record the pendulum, driven by this torque (root mean square, N m).
fn record(folder: &Path, name: &str, torque: f64, seed: usize) -> String {
    let plant = folder.join(format!("{name}.toml"));
    let rig = format!(
        "model = \"pendulum\"\nparameters = {{ C_g = -17.4, C_i = 4.6 }}\n\
         sensor = {{ rate_hz = 100, position_noise = 5e-4, position_step = 0.0 }}\n\
         excitation = {{ amplitude = [{torque}], band_hz = [0.15, 1.5], tones = 8 }}\n\
         recording = {{ logs = 1, duration_s = 12, start = [0, 0] }}\n"
    );
    std::fs::write(&plant, rig).unwrap();
    let log = folder.join(format!("{name}{seed}.csv"));
    let (effects, seed) = (folder.join("effects"), seed.to_string());
    let rig = ["--plant", text(&plant), "--effects", text(&effects)];
    let rest = [
        "--effect",
        "rough_side=0.3",
        "--seed",
        &seed,
        "--out",
        text(&log),
    ];
    succeeds(&[&["simulate"], &rig[..], &rest].concat());
    text(&log).to_owned()
}

#[test]
fn it_helps_on_motion_like_its_own_and_does_no_harm_on_other_motion() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    std::fs::create_dir(folder.join("effects")).unwrap();
    std::fs::write(folder.join("effects/rough.toml"), ROUGH).unwrap();
    let slow: Vec<String> = (1..5).map(|k| record(folder, "slow", 0.9, k)).collect();
    let fast = record(folder, "fast", 2.2, 5);
    let out = folder.join("report");
    let [a, b, c, test] = [0, 1, 2, 3].map(|k| slow[k].as_str());
    let given = ["--model", "pendulum", "--train", a, b, c, "--test", test];
    let json = succeeds(&[&["closeloop", "--json", "--out", text(&out)], &given[..]].concat());
    let report: Value = serde_json::from_str(&json).unwrap();
    assert_eq!(report["network"]["used"], true, "{}", report["network"]);
    // The errors are those of the two written models.
    let (model, checkpoint) = (out.join("model.toml"), out.join("checkpoint"));
    let after = |log: &str| evaluated(&["--model", text(&model)], log);
    let hybrid = |log: &str| evaluated(&["--checkpoint", text(&checkpoint)], log);
    let share = hybrid(test) / after(test);
    assert!(share < 0.5, "{share}");
    let share = hybrid(&fast) / after(&fast);
    assert!(share < 1.02, "{share}");
}
