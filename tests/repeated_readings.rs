//! Logs of a bus that answers with its last readings in some rows.

use std::path::Path;

use residyn_core::data::{Columns, Log, audit};
use residyn_core::model::Library;
use residyn_core::rng;
use residyn_io::plant_from_text;

/// A pendulum with dry friction, with noise on the encoder.
const RIG: &str = r#"
model = "pendulum"
sensor = { rate_hz = 100, position_noise = 2e-4, position_step = 3.8e-4 }
excitation = { amplitude = [1.5], band_hz = [0.1, 1.5], tones = 6 }
recording = { logs = 4, duration_s = 15, start = [0, 0] }
[[effect]]
name = "coulomb_friction"
joint = 1
F_c = 0.1
"#;

fn recorded() -> Vec<Log> {
    let plant = plant_from_text(Path::new("rig.toml"), RIG, &Library::built_in()).unwrap();
    let rng = &mut rng(1);
    (0..plant.recording.logs)
        .map(|_| plant.record(rng).unwrap())
        .collect()
}

/// The log with readings that are those of the row before, in a tenth of its rows.
fn repeating(log: &Log) -> Log {
    let mut log = log.clone();
    let rows = (1..log.rows()).filter(|row| row * 7919 % 101 < 10);
    for row in rows {
        for channel in log.q.iter_mut().chain(&mut log.qd) {
            channel[row] = channel[row - 1];
        }
    }
    log
}

fn said(log: &Log) -> Vec<String> {
    let findings = audit(log, &Columns::default()).findings;
    findings.iter().map(ToString::to_string).collect()
}

#[test]
fn repeated_readings_are_said_and_pass_for_nothing_else() {
    for log in recorded() {
        let clean = said(&log);
        let repeated = said(&repeating(&log));
        let says = |text: &&String| text.contains("repeat the row before");
        assert!(!clean.iter().any(|text| says(&text)), "{clean:?}");
        assert_eq!(repeated.iter().filter(says).count(), 1, "{repeated:?}");
        assert_eq!(repeated.len(), clean.len() + 1, "{clean:?} {repeated:?}");
    }
}

mod slow {
    use residyn_core::closeloop::{Request, Verdict, close_loop};

    use super::*;

    #[test]
    fn repeated_readings_change_no_name() {
        let library = Library::built_in();
        let model = library.model("pendulum").unwrap();
        let logs = recorded().iter().map(repeating).collect();
        let request = Request::of(&model, &library, logs);
        let outcome = close_loop(request, &mut rng(0), &()).unwrap();
        let findings = outcome.effects.findings.iter();
        let found: Vec<&str> = findings.map(|f| f.effect.effect.name.as_str()).collect();
        assert_eq!(found, ["coulomb_friction"]);
        assert_eq!(outcome.verdict, Verdict::Explained, "{}", outcome.reason);
    }
}
