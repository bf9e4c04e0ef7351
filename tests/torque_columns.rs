//! What a torque column holds: commands held from row to row, a sensor's readings, or means.

use residyn_core::data::TorqueColumn;
use residyn_core::model::Library;

#[test]
fn the_model_file_says_what_the_torques_are() {
    let library = Library::built_in();
    let text = library.model("pendulum").unwrap().file_text();
    let read = |word: &str| {
        let text = format!("{text}\n[log]\ntorque = \"{word}\"\n");
        library.model_from_text("rig.toml", &text)
    };
    for column in TorqueColumn::ALL {
        let model = read(column.key()).unwrap();
        assert_eq!(model.columns.torque, Some(column));
        let channel = |name: &str| (name.to_owned(), vec![0.0, 0.1, 0.2]);
        let log = model.log_from_columns("run", ["time", "q1", "tau1"].map(channel));
        assert_eq!(log.unwrap().torque, column);
        assert!(
            model
                .file_text()
                .contains(&format!("torque = \"{}\"", column.key()))
        );
    }
    let error = read("average").unwrap_err().to_string();
    assert!(
        error.contains("`torque` must be \"held\" or \"sampled\" or \"mean\", found \"average\""),
        "{error}"
    );
}

mod slow {
    use std::path::Path;

    use residyn_core::closeloop::{Outcome, Request, Verdict, close_loop};
    use residyn_core::data::{Log, TorqueColumn};
    use residyn_core::model::Library;
    use residyn_core::rng;
    use residyn_io::plant_from_text;

    /// A pendulum with dry friction, recorded every millisecond.
    const RIG: &str = r#"
model = "pendulum"
sensor = { rate_hz = 1000, position_noise = 2e-4, position_step = 0.0 }
excitation = { amplitude = [1.5], band_hz = [0.1, 3.0], tones = 8 }
recording = { logs = 4, duration_s = 10, start = [0, 0] }
[[effect]]
name = "coulomb_friction"
joint = 1
F_c = 0.1
"#;

    /// Every tenth row, with torques of this kind.
    fn logged(fine: &Log, column: TorqueColumn) -> Log {
        let every = |channel: &[f64]| channel.iter().copied().step_by(10).collect::<Vec<f64>>();
        let mean = |tau: &[f64]| tau.iter().sum::<f64>() / tau.len() as f64;
        let at = |tau: &[f64], row: usize| match column {
            TorqueColumn::Held => mean(&tau[row..(row + 10).min(tau.len())]),
            TorqueColumn::Mean => mean(&tau[row.saturating_sub(10)..row.max(1)]),
            // The fine torque jumps at the row.
            TorqueColumn::Sampled => mean(&tau[row.saturating_sub(1)..=row]),
        };
        let torques = |tau: &Vec<f64>| (0..tau.len()).step_by(10).map(|row| at(tau, row)).collect();
        Log {
            time: every(&fine.time),
            q: fine.q.iter().map(|q| every(q)).collect(),
            qd: fine.qd.iter().map(|qd| every(qd)).collect(),
            tau: fine.tau.iter().map(torques).collect(),
            ..fine.clone()
        }
    }

    fn answer(fine: &[Log], column: TorqueColumn) -> Outcome {
        let library = Library::built_in();
        let model = library.model("pendulum").unwrap();
        let logs = fine.iter().map(|log| logged(log, column)).collect();
        close_loop(Request::of(&model, &library, logs), &mut rng(0), &()).unwrap()
    }

    #[test]
    fn torques_are_recognised_as_what_they_are_and_nothing_is_named_in_their_place() {
        let plant = plant_from_text(Path::new("rig.toml"), RIG, &Library::built_in()).unwrap();
        let rng = &mut rng(1);
        let fine: Vec<Log> = (0..plant.recording.logs)
            .map(|_| plant.record(rng).unwrap())
            .collect();
        for column in TorqueColumn::ALL {
            let outcome = answer(&fine, column);
            let findings = outcome.effects.findings.iter();
            let found: Vec<&str> = findings.map(|f| f.effect.effect.name.as_str()).collect();
            assert_eq!(found, ["coulomb_friction"], "{column:?}");
            assert_eq!(
                outcome.verdict,
                Verdict::Explained,
                "{column:?}: {}",
                outcome.reason
            );
            // The written model reads such logs in the same way.
            let known = outcome.models.after.model.columns.torque;
            assert_eq!(known.unwrap_or_default(), column);
            let said = outcome.given.audits[0]
                .findings
                .iter()
                .map(ToString::to_string);
            let is_said = said.filter(|text| text.contains("`[log] torque")).count() == 1;
            assert_eq!(is_said, column != TorqueColumn::Held);
        }
    }
}
