//! Real clients read what the program writes: Python with the packages of `tests/clients`.

use residyn_report::EventFile;

use crate::support::clients::client;
use crate::support::demo::demo;
use crate::support::paths::schema_path;

#[test]
fn python_reads_the_weights_of_a_checkpoint() {
    client("weights.py", &[demo()]);
}

#[test]
fn report_matches_its_published_schema() {
    client("report.py", &[demo(), &schema_path()]);
}

#[test]
fn tensorboard_reads_event_files() {
    let scalars = [
        ("loss/training", 0, 1_700_000_000.25, 0.0),
        ("loss/training", 1, 1_700_000_001.5, 1.25e-7),
        ("loss/training", 5_000_000_000, 1_700_000_002.0, -3.5),
        ("Rückgabe", 7, 1_700_000_003.0, f64::from(f32::MAX)),
    ];
    let folder = tempfile::tempdir().unwrap();
    let events = folder.path().join("runs/first");
    let mut file = EventFile::create(&events, 1_700_000_000.0).unwrap();
    for (tag, step, wall_time_s, value) in scalars {
        file.scalar(tag, step, wall_time_s, value).unwrap();
    }
    let expected = folder.path().join("expected.json");
    std::fs::write(&expected, serde_json::to_string(&scalars).unwrap()).unwrap();
    client("events.py", &[&events, &expected]);
}
