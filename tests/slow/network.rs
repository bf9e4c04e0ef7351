//! The residual network on motion unlike its training data.

use crate::support::Scratch;

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

/// A pendulum that is driven by this torque (root mean square, N m).
fn rig(torque: f64) -> String {
    format!(
        "model = \"pendulum\"\nparameters = {{ C_g = -17.4, C_i = 4.6 }}\n\
         sensor = {{ rate_hz = 100, position_noise = 5e-4, position_step = 0.0 }}\n\
         excitation = {{ amplitude = [{torque}], band_hz = [0.15, 1.5], tones = 8 }}\n\
         recording = {{ logs = 1, duration_s = 12, start = [0, 0] }}\n"
    )
}

#[test]
fn it_helps_on_motion_like_its_own_and_does_no_harm_on_other_motion() {
    let scratch = Scratch::new();
    std::fs::create_dir(scratch.path("effects")).unwrap();
    scratch.file("effects/rough.toml", ROUGH);
    scratch.file("slow.toml", rig(0.9));
    scratch.file("fast.toml", rig(2.2));
    let hidden = "--effects effects --effect rough_side=0.3";
    scratch.simulates(&format!("slow.toml {hidden}"), &[1, 2, 3, 4]);
    scratch.simulates(&format!("fast.toml {hidden}"), &[5]);
    let logs = "--train run1.csv run2.csv run3.csv --test run4.csv";
    let report = scratch.json(&format!("closeloop --model pendulum {logs} --out report"));
    assert_eq!(report["network"]["used"], true, "{}", report["network"]);
    // The errors are those of the two written models.
    let share = |log: &str| {
        let models = [
            "--checkpoint report/checkpoint",
            "--model report/model.toml",
        ];
        let [hybrid, after] =
            models.map(|model| scratch.evaluated(&format!("{model} --test {log}")));
        hybrid / after
    };
    let (like, unlike) = (share("run4.csv"), share("run5.csv"));
    assert!(like < 0.5, "{like}");
    assert!(unlike < 1.02, "{unlike}");
}
