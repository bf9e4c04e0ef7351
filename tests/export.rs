//! Exported models, read by their users' programs.

use std::path::Path;

use residyn_control::control::Task;
use residyn_core::model::Model;
use residyn_core::sim::Integrator;
use residyn_formats::{Client, ExportModel, FORMATS, PythonClient, find};
use serde_json::{Value, json};

use crate::support::catalogue::{USER_EFFECT, rng, system};
use crate::support::clients::client;
use crate::support::predictions::{agree, client_agrees, expected, predictions, written};
use crate::support::{exported_models, refuses, residyn, succeeds, text};

/// The reader of descriptions that docs/export.md shows.
const DESCRIPTION: PythonClient = PythonClient {
    name: "description.py",
    script: include_str!("../docs/clients/description.py"),
    packages: "numpy safetensors",
};

#[test]
fn an_exported_description_imports_as_a_checkpoint() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| text(&folder.path().join(name)).to_owned();
    let checkpoint = Path::new(env!("CARGO_MANIFEST_DIR")).join("checkpoints/acrobot-sim");
    let first = [
        "export",
        "--checkpoint",
        text(&checkpoint),
        "--format",
        "json",
        "--out",
    ];
    let printed = succeeds(&[&first[..], &[&at("a.json"), "--json"]].concat());
    let printed: Value = serde_json::from_str(&printed).unwrap();
    assert_eq!(printed["difference"]["rollout"], 0.0);
    succeeds(&["import", "--file", &at("a.json"), "--out", &at("back")]);
    let again = [
        "export",
        "--checkpoint",
        &at("back"),
        "--format",
        "json",
        "--out",
    ];
    succeeds(&[&again[..], &[&at("b.json")]].concat());
    let weights = |name: &str| std::fs::read(at(name)).unwrap();
    assert!(weights("a.safetensors") == weights("b.safetensors"));
    let description = |name: &str| -> Value { serde_json::from_slice(&weights(name)).unwrap() };
    let (before, after) = (description("a.json"), description("b.json"));
    for key in [
        "prior",
        "residual",
        "integrator",
        "step_s",
        "model_toml",
        "equations",
    ] {
        assert_eq!(before[key], after[key], "{key}");
    }
}

#[test]
fn errors_in_imported_files_name_a_remedy() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| text(&folder.path().join(name)).to_owned();
    succeeds(&[
        "export",
        "--model",
        "pendulum",
        "--format",
        "json",
        "--out",
        &at("m.json"),
    ]);
    let message = |change: &dyn Fn(&mut Value)| {
        let mut json: Value =
            serde_json::from_slice(&std::fs::read(at("m.json")).unwrap()).unwrap();
        change(&mut json);
        std::fs::write(at("n.json"), json.to_string()).unwrap();
        let message = refuses(&["import", "--file", &at("n.json"), "--out", &at("back")]);
        assert!(
            !folder.path().join("back").exists(),
            "something was written"
        );
        message.replace(&at(""), "")
    };
    assert_eq!(
        message(&|json| json["residyn_model"] = json!(2)),
        "error: n.json has format 2, this program reads 1; use the residyn that wrote it (0.1.0)\n"
    );
    let missing = message(&|json| json["weights"] = json!("gone.safetensors"));
    assert!(
        missing.starts_with("error: gone.safetensors cannot be read: "),
        "{missing}"
    );
    let other = message(&|json| json["parameters"][0]["name"] = json!("C_h"));
    assert!(
        other.contains("there is no tensor `parameters.C_h`"),
        "{other}"
    );
    let model =
        message(&|json| json["model_toml"] = json!("[system]\nname = \"pendulum\"\njoint = 1\n"));
    assert!(
        model.contains("unknown key `joint`") && model.contains("line 3"),
        "{model}"
    );
    std::fs::write(at("n.json"), "{").unwrap();
    let message = refuses(&["import", "--file", &at("n.json"), "--out", &at("back")]);
    assert!(message.contains("line 1 column 1"), "{message}");
}

#[test]
fn a_refused_export_writes_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let out = text(&folder.path().join("m.json")).to_owned();
    let export = |more: &[&str]| refuses(&[&["export", "--out", &out], more].concat());
    let unknown = export(&["--model", "pendulum", "--format", "onyx"]);
    assert!(unknown.contains("did you mean `onnx`?"), "{unknown}");
    let step = export(&["--model", "pendulum", "--format", "json", "--step", "0"]);
    assert!(
        step.contains("--step 0: a step is a number of seconds above zero"),
        "{step}"
    );
    let integrator = export(&[
        "--model",
        "pendulum",
        "--format",
        "json",
        "--integrator",
        "fine:0",
    ]);
    assert!(integrator.contains("fine:N"), "{integrator}");
    let same = export(&["--model", "pendulum", "--format", "safetensors"]);
    assert!(same.contains("both would be"), "{same}");
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
}

#[test]
fn the_folder_of_an_export_is_made() {
    let folder = tempfile::tempdir().unwrap();
    let export = |out: &Path| {
        let out = text(out);
        [
            "export", "--model", "pendulum", "--format", "json", "--out", out,
        ]
        .map(str::to_owned)
    };
    let run = |out: &Path| residyn(&export(out).each_ref().map(String::as_str));
    let deep = folder.path().join("made/for/it/m.json");
    assert_eq!(run(&deep).status.code(), Some(0));
    assert!(deep.is_file());
    // A file stands where a folder is needed.
    let nowhere = run(&deep.join("below/m.json"));
    assert_eq!(nowhere.status.code(), Some(2));
    let said = String::from_utf8(nowhere.stderr).unwrap();
    assert!(said.contains("below: cannot be written"), "{said}");
}

#[test]
fn sensor_effects_are_listed_as_not_carried() {
    let effects = r#"
[[effect]]
name = "sensor_offset"
joint = 1
q_z = 0.01

[[effect]]
name = "backlash"
joint = 1
delta = 0.005
driven = 1
"#;
    let system = exported_models::system("pendulum", effects);
    let model = ExportModel::of_system(&system, Integrator::RK4, 0.01, Value::Null);
    for name in ["c", "fmu", "onnx", "python", "mjcf", "urdf"] {
        let limits = (find(name).unwrap().not_carried)(&model);
        for piece in ["measured positions", "per-log values of q_z1"] {
            let said = limits.iter().any(|limit| limit.starts_with(piece));
            assert!(said, "{name}: {piece:?} is not in {limits:?}");
        }
    }
}

#[test]
fn a_description_needs_no_effect_files_to_be_read() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| text(&folder.path().join(name)).to_owned();
    std::fs::create_dir(at("effects")).unwrap();
    std::fs::write(at("effects/eddy_brake.toml"), USER_EFFECT).unwrap();
    let effect = "[[effect]]\nname = \"eddy_brake\"\njoint = 1\nT_m = 0.3\nv_m = 2.0\n";
    std::fs::write(
        at("braked.toml"),
        format!("{}\n{effect}", system("pendulum").text),
    )
    .unwrap();
    let export = [
        "export",
        "--model",
        &at("braked.toml"),
        "--effects",
        &at("effects"),
    ];
    let json = ["--format", "json", "--out", &at("braked.json"), "--json"];
    let printed = succeeds(&[&export[..], &json].concat());
    let printed: Value = serde_json::from_str(&printed).unwrap();
    for what in ["next", "derivative", "rollout"] {
        let difference = printed["difference"][what].as_f64().unwrap();
        assert!(difference < 1e-12, "{what}: {difference:e}");
    }
    let import = [
        "import",
        "--file",
        &at("braked.json"),
        "--out",
        &at("braked"),
    ];
    let unknown = refuses(&import);
    assert!(unknown.contains("unknown effect `eddy_brake`"), "{unknown}");
    succeeds(&[&import[..], &["--effects", &at("effects")]].concat());
}

mod slow {
    use super::*;

    /// Checks for a new format without a test of its own.
    #[test]
    fn every_format_is_read_by_its_client_and_documented() {
        let pendulum = exported_models::all().swap_remove(0);
        let guide = include_str!("../docs/export.md");
        for format in FORMATS {
            if !matches!(format.client, Client::None(_)) {
                client_agrees(format, std::slice::from_ref(&pendulum));
            }
            let mut headings = guide.lines().filter_map(|line| line.strip_prefix("## "));
            let has_section = headings.any(|heading| heading.split(' ').any(|w| w == format.name));
            assert!(
                has_section,
                "docs/export.md has no section on {}",
                format.name
            );
        }
    }

    #[test]
    fn onnxruntime_predicts_the_same() {
        client_agrees(find("onnx").unwrap(), &exported_models::all());
    }

    #[test]
    fn a_python_module_predicts_the_same() {
        client_agrees(find("python").unwrap(), &exported_models::all());
    }

    #[test]
    fn a_description_is_read_back_to_the_same_model() {
        client_agrees(find("json").unwrap(), &exported_models::all());
        client_agrees(find("safetensors").unwrap(), &exported_models::all());
    }

    #[test]
    fn a_description_can_be_rebuilt_with_numpy() {
        for (name, model) in exported_models::all() {
            let (_folder, path) = written(find("json").unwrap(), name, &model);
            let (samples, own) = expected(&model);
            if let Some(theirs) = predictions(name, || DESCRIPTION.ask(&path, &samples)) {
                agree(name, &own, &theirs, 1e-9);
            }
        }
    }

    #[test]
    fn onnx_files_pass_the_checker_and_hold_metadata() {
        for (name, model) in exported_models::all() {
            let (folder, path) = written(find("onnx").unwrap(), name, &model);
            let parameters = model.equations.parameters.iter();
            let parameters: Vec<Value> = parameters
                .map(|p| json!([p.name, p.value, p.unit]))
                .collect();
            let expected =
                json!({"system": model.name(), "step_s": model.step_s, "parameters": parameters});
            let file = folder.path().join("expected.json");
            std::fs::write(&file, expected.to_string()).unwrap();
            client("onnx_checker.py", &[&path, &file]);
        }
    }

    #[test]
    fn the_environment_of_a_module_works_in_gymnasium() {
        for (name, model) in exported_models::all() {
            let Some(task) = Task::of_system(model.name()) else {
                continue;
            };
            let (folder, path) = written(find("python").unwrap(), name, &model);
            let samples = model.samples(&mut rng(1)).unwrap();
            let objective = task.objective();
            let points = samples.states.iter().zip(&samples.torques);
            let rewards: Vec<f64> = points
                .map(|(state, tau)| objective.value(state, tau, 0.0))
                .collect();
            let expected =
                json!({"states": samples.states, "torques": samples.torques, "rewards": rewards});
            let file = folder.path().join("expected.json");
            std::fs::write(&file, expected.to_string()).unwrap();
            client("environment.py", &[&path, &file]);
        }
    }

    #[test]
    fn latex_is_parsed_and_holds_equations_values_and_intervals() {
        for (name, model) in exported_models::all() {
            let (folder, path) = written(find("latex").unwrap(), name, &model);
            let mut pieces = Vec::new();
            let mut environments = vec!["document"];
            if model.prior.is_none() {
                environments.extend(["align*", "tabular"]);
            }
            if name == "pendulum_effects" {
                environments.push("itemize");
                pieces.extend([
                    r"\ddot{q}_{1} &= C_{g} \,\sin\left(q_{1}\right) + C_{i} \,\tau_{1}",
                    r"-F_{\mathrm{c1}} \,\operatorname{sign}\left(\dot{q}_{1}\right)",
                    r"$F_{\mathrm{c1}}$ & $0.160$ & $\mathrm{N\,m}$ & $0.150$ to $0.170$",
                    r"$C_{i}$ & $3$ & $\mathrm{1/(kg\,m^{2})}$ & not fitted",
                ]);
            }
            let expected = folder.path().join("expected.json");
            let json = json!({"environments": environments, "pieces": pieces});
            std::fs::write(&expected, json.to_string()).unwrap();
            client("latex.py", &[&path, &expected]);
        }
    }

    #[test]
    fn unusual_names_and_units_give_a_valid_module() {
        let text = "[system]\nname = 'a \"\"\" \\ b'\nabout = \"two\\nlines \\\"\\\"\\\"\"\njoints = 1\n[parameters]\n\
                lambda = { value = -2.0, unit = \"N\\nm\" }\n[dynamics.let]\np = \"q1 + 1\"\n\
                [dynamics]\nqdd1 = \"lambda * p + tau1\"\n";
        let system = Model::from_text(Path::new("odd.toml"), text, &[]).unwrap();
        let model = ExportModel::of_system(&system, Integrator::RK4, 0.01, json!("\"\"\"\n\\"));
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("odd.module");
        let format = find("python").unwrap();
        format.write(&model, &path).unwrap();
        let (samples, own) = expected(&model);
        if let Some(theirs) = predictions("odd", || format.predict(&path, &samples)) {
            agree("odd", &own, &theirs, format.tolerance);
        }
    }
}
