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
use crate::support::tables::rows;
use crate::support::{Scratch, exported_models, says};

/// The reader of descriptions that docs/export.md shows.
const DESCRIPTION: PythonClient = PythonClient {
    name: "description.py",
    script: include_str!("../docs/clients/description.py"),
    packages: "numpy safetensors",
};

#[test]
fn an_exported_description_imports_as_a_checkpoint() {
    let scratch = Scratch::new();
    let export = |checkpoint: &str, out: &str| {
        let given = format!("--checkpoint {checkpoint} --format json --out {out}");
        scratch.json(&format!("export {given}"))
    };
    let printed = export("$REPO/checkpoints/acrobot-sim", "a.json");
    assert_eq!(printed["difference"]["rollout"], 0.0);
    scratch.succeeds("import --file a.json --out back");
    export("back", "b.json");
    let weights = |name: &str| std::fs::read(scratch.path(name)).unwrap();
    assert!(weights("a.safetensors") == weights("b.safetensors"));
    let [before, after] = ["a.json", "b.json"].map(|name| scratch.read_json(name));
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
    let scratch = Scratch::new();
    scratch.succeeds("export --model pendulum --format json --out m.json");
    let import = || {
        let message = scratch.refuses("import --file n.json --out back");
        assert!(!scratch.has("back"), "something was written");
        message
    };
    let message = |change: &dyn Fn(&mut Value)| {
        let mut json = scratch.read_json("m.json");
        change(&mut json);
        scratch.file("n.json", json.to_string());
        import()
    };
    assert_eq!(
        message(&|json| json["residyn_model"] = json!(2)),
        "error: n.json has format 2, this program reads 1; use the residyn that wrote it (0.1.0)\n"
    );
    let missing = message(&|json| json["weights"] = json!("gone.safetensors"));
    says(&missing, &["error: gone.safetensors cannot be read: "]);
    let other = message(&|json| json["parameters"][0]["name"] = json!("C_h"));
    says(&other, &["there is no tensor `parameters.C_h`"]);
    let wrong = "[system]\nname = \"pendulum\"\njoint = 1\n";
    let model = message(&|json| json["model_toml"] = json!(wrong));
    says(&model, &["unknown key `joint`", "line 3"]);
    scratch.file("n.json", "{");
    says(&import(), &["line 1 column 1"]);
}

/// Arguments of an export, and words of the message.
const REFUSED: &str = "
--model pendulum --format onyx                                 | did you mean `onnx`?
--model pendulum --format json --step 0                        | --step 0: a step is a number of seconds above zero
--model pendulum --format json --integrator fine:0             | fine:N
--model pendulum --format safetensors                          | both would be
";

#[test]
fn a_refused_export_writes_nothing() {
    let scratch = Scratch::new();
    for [given, words] in rows(REFUSED) {
        let message = scratch.refuses(&format!("export --out m.json {given}"));
        says(&message, &[&words]);
    }
    assert_eq!(scratch.count(), 0);
}

#[test]
fn the_folder_of_an_export_is_made() {
    let scratch = Scratch::new();
    let export = "export --model pendulum --format json --out";
    scratch.succeeds(&format!("{export} made/for/it/m.json"));
    assert!(scratch.path("made/for/it/m.json").is_file());
    // A file stands where a folder is needed.
    let message = scratch.refuses(&format!("{export} made/for/it/m.json/below/m.json"));
    says(&message, &["below: cannot be written"]);
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
    let scratch = Scratch::new();
    std::fs::create_dir(scratch.path("effects")).unwrap();
    scratch.file("effects/eddy_brake.toml", USER_EFFECT);
    let effect = "[[effect]]\nname = \"eddy_brake\"\njoint = 1\nT_m = 0.3\nv_m = 2.0\n";
    let braked = format!("{}\n{effect}", system("pendulum").text);
    scratch.file("braked.toml", braked);
    let given = "--model braked.toml --effects effects --format json --out braked.json";
    let printed = scratch.json(&format!("export {given}"));
    for what in ["next", "derivative", "rollout"] {
        let difference = printed["difference"][what].as_f64().unwrap();
        assert!(difference < 1e-12, "{what}: {difference:e}");
    }
    let import = "import --file braked.json --out braked";
    let unknown = scratch.refuses(import);
    says(&unknown, &["unknown effect `eddy_brake`"]);
    scratch.succeeds(&format!("{import} --effects effects"));
}

mod slow {
    use super::*;

    /// A client compares a written file with what is expected of it.
    fn expects(script: &str, folder: &Path, path: &Path, expected: &Value) {
        let file = folder.join("expected.json");
        std::fs::write(&file, expected.to_string()).unwrap();
        client(script, &[path, &file]);
    }

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
    fn clients_predict_the_same_from_models_of_every_kind() {
        for format in ["onnx", "python", "json", "safetensors"] {
            client_agrees(find(format).unwrap(), &exported_models::all());
        }
    }

    #[test]
    fn play_is_exported_in_double_precision() {
        for format in ["c", "fmu", "python", "json"] {
            client_agrees(find(format).unwrap(), &[exported_models::loose()]);
        }
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
            expects("onnx_checker.py", folder.path(), &path, &expected);
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
                .map(|(state, tau)| objective.value(&state[..2 * model.joints()], tau, 0.0))
                .collect();
            let expected =
                json!({"states": samples.states, "torques": samples.torques, "rewards": rewards});
            expects("environment.py", folder.path(), &path, &expected);
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
            let expected = json!({"environments": environments, "pieces": pieces});
            expects("latex.py", folder.path(), &path, &expected);
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
