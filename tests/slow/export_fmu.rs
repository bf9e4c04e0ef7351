//! The FMU in FMPy: its predictions, and that a simulator can do with it what the standard promises.

use std::io::{Cursor, Read};
use std::process::Command;

use residyn_formats::{ExportModel, Format, find};
use serde_json::{Value, json};
use zip::ZipArchive;

use crate::support::catalogue::rng;
use crate::support::clients::{client, succeeds, there_are};
use crate::support::exported_models;
use crate::support::predictions::predictions;
use crate::support::{Scratch, says};

fn model(name: &str) -> ExportModel {
    let mut models = exported_models::all().into_iter();
    models.find(|(known, _)| *known == name).unwrap().1
}

/// The formats of both standards.
fn formats() -> [&'static Format; 2] {
    ["fmu", "fmu2"].map(|name| find(name).unwrap())
}

/// All items in each format.
fn each<T: Clone>(all: Vec<T>) -> impl Iterator<Item = (T, &'static Format)> {
    let all = all.into_iter();
    all.flat_map(|one| formats().map(|format| (one.clone(), format)))
}

#[test]
fn a_simulator_predicts_what_the_program_does() {
    let folder = tempfile::tempdir().unwrap();
    for ((name, model), format) in each(exported_models::all()) {
        let name = &format!("{name} as {}", format.name);
        let path = folder.path().join("model.fmu");
        format.write(&model, &path).unwrap();
        let samples = model.samples(&mut rng(3)).unwrap();
        let own = model.predict(&samples).unwrap();
        let Some(theirs) = predictions(name, || format.predict(&path, &samples)) else {
            continue;
        };
        let difference = own.difference(&theirs);
        assert!(difference.pointwise() <= 1e-9, "{name} {difference:?}");
        assert!(difference.rollout.unwrap() <= 1e-9, "{name} {difference:?}");
        assert_eq!(
            difference.derivative.is_some(),
            model.equations.filters.is_empty(),
            "{name}"
        );
    }
}

/// An independent solver may differ by the step's own error and by the error of straight lines through a delay.
#[test]
fn a_simulator_can_tune_save_and_differentiate_a_unit() {
    let (dry, stribeck) = (
        "joint[1].coulomb_friction.F_c1",
        "joint[1].stribeck_friction.F_s1",
    );
    let cases = vec![
        ("pendulum_effects", dry, 0.05, 2e-3),
        ("acrobot_effects", stribeck, 0.3, 2e-3),
        ("cartpole_hybrid", "m_p", 0.2, 1e-4),
    ];
    for ((name, parameter, tuned, solver_tolerance), format) in each(cases) {
        let model = model(name);
        let samples = model.samples(&mut rng(5)).unwrap();
        let own = parameter.rsplit('.').next().unwrap();
        let mut other = model.clone();
        let mut parameters = other.equations.parameters.iter_mut();
        let changed = parameters.find(|parameter| parameter.name == own).unwrap();
        let (value, unit) = (changed.value, changed.unit.clone());
        changed.value = tuned;
        let case = json!({
            "samples": samples, "parameter": parameter, "value": value, "unit": unit,
            "other_value": tuned, "other_rollout": other.predict(&samples).unwrap().rollout,
            "solver_tolerance": solver_tolerance,
        });
        let scratch = Scratch::new();
        let path = scratch.path("model.fmu");
        format.write(&model, &path).unwrap();
        scratch.file("case.json", case.to_string());
        client("simulator.py", &[&path, &scratch.path("case.json")]);
    }
}

/// Names and bytes of the unit's files.
fn unpacked(model: &ExportModel, format: &Format) -> Vec<(String, Vec<u8>)> {
    let files = (format.files)(model, "model.fmu".as_ref()).unwrap();
    let mut archive = ZipArchive::new(Cursor::new(&files[0].bytes)).unwrap();
    let mut unpacked = Vec::new();
    for k in 0..archive.len() {
        let mut file = archive.by_index(k).unwrap();
        let mut bytes = Vec::new();
        file.read_to_end(&mut bytes).unwrap();
        unpacked.push((file.name().unwrap().into_owned(), bytes));
    }
    unpacked
}

#[test]
fn no_compiler_warns_of_its_sources() {
    if !there_are(&["cc"]) {
        return;
    }
    for ((name, model), format) in each(exported_models::all()) {
        let folder = tempfile::tempdir().unwrap();
        for (file, bytes) in unpacked(&model, format) {
            if let Some(file) = file.strip_prefix("sources/") {
                std::fs::write(folder.path().join(file), bytes).unwrap();
            }
        }
        let mut command = Command::new("cc");
        command.args([
            "-std=c99",
            "-fsyntax-only",
            "-Wall",
            "-Wextra",
            "-Werror",
            "-pedantic",
        ]);
        let source = match format.name {
            "fmu2" => "fmi2.c",
            _ => "fmi3.c",
        };
        succeeds(command.arg(folder.path().join(source)), name);
    }
}

#[test]
fn the_description_names_units_effects_and_intervals() {
    let model = model("pendulum_effects");
    for format in formats() {
        let (file, text) = unpacked(&model, format).remove(0);
        assert_eq!(file, "modelDescription.xml");
        let text = String::from_utf8(text).unwrap();
        let xml = roxmltree::Document::parse(&text).unwrap();
        // FMI 2.0 gives the value in a nested element.
        let said = |name: &str, attribute: &str| {
            let mut nodes = xml.descendants();
            let named = nodes.find(|node| node.attribute("name") == Some(name));
            let mut below = named.unwrap().descendants();
            below.find_map(|node| node.attribute(attribute))
        };
        assert_eq!(
            said("joint[1].coulomb_friction.F_c1", "start"),
            Some("0.16")
        );
        let about = said("joint[1].coulomb_friction.F_c1", "description").unwrap();
        assert!(
            about.contains("-F_c1 * sign(qd1)") && about.contains("0.15 to 0.17"),
            "{about}"
        );
        let exponents = ["kg", "m", "s"].map(|unit| said("N m", unit));
        assert_eq!(exponents, [Some("1"), Some("2"), Some("-2")]);
        assert_eq!(said("joint[1].lagged_torque", "unit"), Some("N m"));
        let limits = (format.not_carried)(&model);
        assert!(
            limits.iter().any(|limit| limit.contains("delay")),
            "{limits:?}"
        );
    }
}

#[test]
fn without_a_compiler_a_unit_holds_its_sources() {
    for format in formats() {
        let scratch = Scratch::new();
        let given = format!("--model acrobot --format {} --out acrobot.fmu", format.name);
        let mut export = scratch.command(&format!("export --json {given}"));
        let run = export.env("CC", "no-such-compiler").output().unwrap();
        let errors = String::from_utf8_lossy(&run.stderr);
        assert_eq!(run.status.code(), Some(0), "{errors}");
        let said: Value = serde_json::from_slice(&run.stdout).unwrap();
        let limit = said["not_carried"][0].as_str().unwrap();
        says(limit, &["source", "CC"]);
        says(said["not_measured"].as_str().unwrap(), &["CC"]);
        let file = std::fs::File::open(scratch.path("acrobot.fmu")).unwrap();
        let archive = ZipArchive::new(file).unwrap();
        let names: Vec<_> = archive.file_names().flatten().collect();
        let has = |begins: &str| names.iter().any(|name| name.starts_with(begins));
        assert!(has("sources/unit.h") && !has("binaries/"), "{names:?}");
    }
}

#[test]
fn the_same_model_is_the_same_unit() {
    let model = model("pendulum");
    for format in formats() {
        assert!(unpacked(&model, format) == unpacked(&model, format));
    }
}
