//! What clients of exported models predict, compared with the program's own predictions.

use std::io::Write;
use std::path::PathBuf;

use residyn_formats::{ClientError, ExportModel, Format, Predictions, Samples};
use tempfile::TempDir;

use super::catalogue::rng;
use super::clients::not_in_a_quick_run;

/// A client's predictions; `None`, said loudly, if the client is not on this machine.
pub fn predictions(
    name: &str,
    predict: impl FnOnce() -> Result<Predictions, ClientError>,
) -> Option<Predictions> {
    not_in_a_quick_run();
    match predict() {
        Ok(predictions) => Some(predictions),
        Err(ClientError::Unavailable(reason)) => {
            let required = std::env::var_os("RESIDYN_PYTHON").is_some();
            assert!(!required, "{name}: {reason}");
            // Not eprintln!, which the test harness swallows.
            let _ = writeln!(std::io::stderr(), "SKIPPED {name}: {reason}; run tests/run");
            None
        }
        Err(ClientError::Failed(said) | ClientError::NotFinite(said)) => panic!("{name}: {said}"),
    }
}

/// Steps, derivatives and the rollout are all there and match the program's own.
pub fn agree(name: &str, own: &Predictions, theirs: &Predictions, tolerance: f64) {
    let difference = own.difference(theirs);
    for (what, difference) in [
        ("step", difference.next),
        ("derivative", difference.derivative),
        ("rollout", difference.rollout),
    ] {
        let difference = difference.unwrap_or_else(|| panic!("{name}: no prediction of a {what}"));
        assert!(difference <= tolerance, "{name}, {what}: {difference:e}");
    }
}

pub fn expected(model: &ExportModel) -> (Samples, Predictions) {
    let samples = model.samples(&mut rng(1)).unwrap();
    let own = model.predict(&samples).unwrap();
    (samples, own)
}

/// A model written in a format to its own folder.
pub fn written(format: &Format, name: &str, model: &ExportModel) -> (TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(name.replace(' ', "_"));
    let path = path.with_extension(format.extension);
    format.write(model, &path).unwrap();
    (folder, path)
}

/// Every model in one format, as the format's client predicts it.
pub fn client_agrees(format: &Format, models: &[(impl AsRef<str>, ExportModel)]) {
    for (name, model) in models {
        let name = name.as_ref();
        let (_folder, path) = written(format, name, model);
        let (samples, own) = expected(model);
        let name = format!("{name} as {}", format.name);
        if let Some(theirs) = predictions(&name, || format.predict(&path, &samples)) {
            agree(&name, &own, &theirs, format.tolerance);
        }
    }
}
