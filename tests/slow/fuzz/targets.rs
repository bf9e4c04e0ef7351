//! The readers, each with its seeds and with the use made of what it accepts.

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;

use residyn::read_model;
use residyn::read_plant;
use residyn::read_standard_log;
use residyn::rng;
use residyn::save_imported;
use residyn_control::control::Task;
use residyn_core::data::{Columns, Log, LogError, Quantity, audit};
use residyn_core::expr::{Graph, Scope, SignForm, parse};
use residyn_core::model::{Dynamics, Library, Model};
use residyn_core::sim::Integrator;
use residyn_experiments::experiment;
use residyn_experiments::experiment::undeclared_effect;
use residyn_formats::{ExportModel, FORMATS, Imported};
use residyn_io::files::content_id;
use residyn_io::read_effect;
use residyn_io::read_rig_log;
use residyn_report::Report;
use residyn_train::recipe::Recipe;
use residyn_train::{Backend, Checkpoint};
use residyn_validation as bench;
use serde_json::Value;

use super::edits::Form;
use super::{Target, packed, seeds};
use crate::support::catalogue::fitted;
use crate::support::exported_models::{CHECKPOINT, exported};
use crate::support::paths::ours;

/// Files shorter than this are used in all ways, including those that take longer than reading \[bytes\].
const SHORT: usize = 8000;
/// Rows of a log that is audited.
const FEW_ROWS: usize = 2000;

fn library() -> &'static Library {
    static LIBRARY: OnceLock<Library> = OnceLock::new();
    LIBRARY.get_or_init(Library::built_in)
}

/// The text of an input, if it is text.
fn text(path: &Path) -> Option<String> {
    String::from_utf8(fs::read(path).unwrap()).ok()
}

/// Every equation at one point; its values need not be finite.
fn evaluate(dynamics: &Dynamics) {
    let program = &dynamics.program;
    program.eval(&vec![0.3; program.inputs().len()]);
}

fn use_model(model: &Model) {
    evaluate(&model.dynamics());
    model.torque_balance().iter().for_each(evaluate);
    let found = model.check(&mut rng(0));
    assert!(found.to_string().len() < 1 << 22, "a short answer");
    if model.text.len() < SHORT {
        let exported = ExportModel::of_system(model, Integrator::RK4, 0.01, Value::Null);
        // An FMU is compiled, which takes a second.
        for format in FORMATS
            .iter()
            .filter(|format| !format.name.starts_with("fm"))
        {
            let _ = (format.files)(&exported, Path::new("model"));
        }
    }
}

fn use_log(log: &Log, columns: &Columns) {
    if log.rows() <= FEW_ROWS {
        assert!(!audit(log, columns).to_string().is_empty());
    }
}

/// Reads a log with the joints that it names, or with those of the rig in the seeds.
fn log_of(path: &Path, driven_by: Quantity) -> Result<Log, LogError> {
    let columns = Columns {
        joint_names: vec!["elbow".into(), "wrist".into()],
        driven_by,
        ..Columns::default()
    };
    let log = read_rig_log(path, 2, &columns)?;
    use_log(&log, &columns);
    Ok(log)
}

fn log(path: &Path) -> bool {
    let standard = read_standard_log(path);
    if let Ok(log) = &standard {
        use_log(log, &Columns::default());
    }
    standard.is_ok()
}

fn recording(path: &Path) -> bool {
    log_of(path, Quantity::Torque).is_ok()
}

/// Copies the files of a folder.
fn copy(from: &Path, to: &Path) {
    fs::create_dir_all(to).unwrap();
    for entry in fs::read_dir(from).unwrap() {
        let entry = entry.unwrap();
        fs::copy(entry.path(), to.join(entry.file_name())).unwrap();
    }
}

fn checkpoint_beside(path: &Path) -> bool {
    let folder = path.parent().unwrap();
    Checkpoint::open(folder, library(), Backend::NdArray).is_ok()
}

fn in_checkpoint(folder: &Path, file: &str) -> PathBuf {
    copy(&ours(CHECKPOINT), folder);
    folder.join(file)
}

/// Files that stand alone.
const ALONE: Target = Target {
    name: "",
    inputs: 0,
    form: Form::Text,
    seeds: Vec::new,
    pack: packed::as_it_is,
    place: |folder| folder.join("input.toml"),
    read: |_| false,
};

#[test]
fn formula() {
    let read = |path: &Path| {
        let Some(formula) = text(path).and_then(|text| parse(&text).ok()) else {
            return false;
        };
        let mut names = formula.names();
        names.sort_unstable();
        names.dedup();
        names.truncate(50);
        let Ok(program) = formula.program(names.iter().copied()) else {
            return false;
        };
        program.eval(&vec![0.3; names.len()]);
        assert!(!program.text(&["a"]).is_empty() && !program.latex(&["a"]).is_empty());
        let mut graph = Graph::new();
        let inputs: Vec<_> = names.iter().map(|name| graph.input(name)).collect();
        let mut scope = Scope::new(SignForm::Smooth { width: 0.1 });
        names
            .iter()
            .zip(&inputs)
            .for_each(|(name, node)| scope.bind(name, *node));
        let output = scope.lower(&mut graph, &formula).unwrap();
        let one = graph.constant(1.0);
        let slopes = graph.gradient(&[output], &[one], &inputs);
        graph.finish(&slopes).eval(&vec![0.3; names.len()]);
        true
    };
    Target {
        name: "formula",
        inputs: 20_000,
        seeds: seeds::formulas,
        read,
        ..ALONE
    }
    .run();
}

#[test]
fn model() {
    let read = |path: &Path| {
        let model = read_model(path, library());
        model.as_ref().is_ok_and(|model| {
            use_model(model);
            true
        })
    };
    Target {
        name: "model",
        inputs: 2000,
        seeds: seeds::models,
        read,
        ..ALONE
    }
    .run();
}

#[test]
fn effect() {
    let read = |path: &Path| {
        let Ok(effect) = read_effect(path) else {
            return false;
        };
        for system in ["pendulum", "acrobot"] {
            let system = read_model(system, library()).unwrap();
            let typical: Vec<f64> = effect.parameters.iter().map(|p| p.typical).collect();
            let fitted = fitted(&effect, 0, &typical);
            if system.can_carry(&effect, fitted.joint).is_ok() {
                evaluate(&system.with_effects(vec![fitted]).dynamics());
            }
        }
        true
    };
    Target {
        name: "effect",
        inputs: 3000,
        seeds: seeds::effects,
        read,
        ..ALONE
    }
    .run();
}

#[test]
fn recipe() {
    let read = |path: &Path| Recipe::read(path).is_ok();
    Target {
        name: "recipe",
        inputs: 3000,
        seeds: seeds::recipes,
        read,
        ..ALONE
    }
    .run();
}

#[test]
fn task() {
    let read = |path: &Path| {
        let Ok(task) = Task::read(path) else {
            return false;
        };
        task.objective();
        task.goal_formula();
        task.draw_start(&mut rng(0));
        true
    };
    Target {
        name: "task",
        inputs: 3000,
        seeds: seeds::tasks,
        read,
        ..ALONE
    }
    .run();
}

#[test]
fn plant() {
    let read = |path: &Path| {
        let Ok(plant) = read_plant(path, library()) else {
            return false;
        };
        evaluate(&plant.dynamics());
        // Two steps, if they are short.
        let length = 2.0 / plant.sensor.rate_hz;
        if length < 0.1
            && let Ok(short) = plant.lasting(length)
        {
            let _ = short.record(&mut rng(0));
        }
        true
    };
    Target {
        name: "plant",
        inputs: 2000,
        seeds: seeds::plants,
        read,
        ..ALONE
    }
    .run();
}

#[test]
fn experiment() {
    let read = |path: &Path| {
        experiment::Config::read(path).is_ok() || undeclared_effect::Experiment::read(path).is_ok()
    };
    Target {
        name: "experiment",
        inputs: 3000,
        seeds: seeds::experiments,
        read,
        ..ALONE
    }
    .run();
}

#[test]
fn bench() {
    let read = |path: &Path| bench::read(path).is_ok() || bench::rigs::read(path).is_ok();
    Target {
        name: "bench",
        inputs: 2000,
        seeds: seeds::benches,
        read,
        ..ALONE
    }
    .run();
}

/// Robot descriptions in a format.
fn robot(name: &'static str, inputs: u64, seeds: fn() -> Vec<Vec<u8>>, read: fn(&Path) -> bool) {
    let place = |folder: &Path| folder.join("arm.xml");
    Target {
        name,
        inputs,
        seeds,
        place,
        read,
        ..ALONE
    }
    .run();
}

fn robot_is_read(format: &str, path: &Path) -> bool {
    let model = seeds::robots(format).model(path, None, None);
    model.is_ok_and(|(model, _)| {
        evaluate(&model.dynamics());
        true
    })
}

#[test]
fn urdf() {
    robot("urdf", 3000, seeds::urdf, |path| {
        robot_is_read("urdf", path)
    });
}

#[test]
fn mjcf() {
    robot("mjcf", 3000, seeds::mjcf, |path| {
        robot_is_read("mjcf", path)
    });
}

#[test]
fn manifest() {
    let place = |folder: &Path| in_checkpoint(folder, "checkpoint.json");
    Target {
        name: "manifest",
        inputs: 2000,
        seeds: seeds::manifests,
        place,
        read: checkpoint_beside,
        ..ALONE
    }
    .run();
}

#[test]
fn weights() {
    let place = |folder: &Path| in_checkpoint(folder, "weights.safetensors");
    Target {
        name: "weights",
        inputs: 2000,
        form: Form::Bytes,
        seeds: seeds::weights,
        place,
        read: checkpoint_beside,
        ..ALONE
    }
    .run();
}

/// An optimiser's state, with the checkpoint's description giving its hash.
#[test]
fn optimizer() {
    let place = |folder: &Path| in_checkpoint(folder, "optimizer.bpk");
    let read = |path: &Path| {
        let described = path.with_file_name("checkpoint.json");
        let mut json: Value = serde_json::from_slice(&fs::read(&described).unwrap()).unwrap();
        json["optimizer"] = content_id(&fs::read(path).unwrap()).into();
        fs::write(&described, json.to_string()).unwrap();
        let folder = path.parent().unwrap();
        let (checkpoint, declared, _) =
            Checkpoint::open(folder, library(), Backend::NdArray).unwrap();
        let device = Backend::NdArray.device();
        checkpoint.training(&declared.dynamics(), &device).is_ok()
    };
    Target {
        name: "optimizer",
        inputs: 2000,
        form: Form::Bytes,
        seeds: seeds::optimizers,
        place,
        read,
        ..ALONE
    }
    .run();
}

#[test]
fn tensors() {
    let place = |folder: &Path| in_checkpoint(folder, "weights.safetensors");
    let pack = packed::tensors;
    Target {
        name: "tensors",
        inputs: 2000,
        seeds: seeds::tensors,
        pack,
        place,
        read: checkpoint_beside,
        ..ALONE
    }
    .run();
}

#[test]
fn description() {
    let place = |folder: &Path| {
        copy(exported(), folder);
        folder.join("model.json")
    };
    let read = |path: &Path| {
        let imported = Imported::read(path, library().effects());
        imported.is_ok_and(|imported| {
            let _ = save_imported(&path.with_file_name("out"), imported, 0, Backend::NdArray);
            true
        })
    };
    Target {
        name: "description",
        inputs: 1000,
        seeds: seeds::descriptions,
        place,
        read,
        ..ALONE
    }
    .run();
}

#[test]
fn report() {
    let place = |folder: &Path| folder.join("report.json");
    let read = |path: &Path| {
        let folder = path.parent().unwrap();
        let report = Report::read(folder);
        report.is_ok_and(|report| {
            report.write_readable(folder).unwrap();
            true
        })
    };
    Target {
        name: "report",
        inputs: 300,
        seeds: seeds::reports,
        place,
        read,
        ..ALONE
    }
    .run();
}

/// Logs of a format.
const LOG: Target = Target {
    form: Form::Bytes,
    place: |folder| folder.join("run"),
    read: log,
    ..ALONE
};

#[test]
fn csv() {
    Target {
        name: "csv",
        inputs: 2000,
        form: Form::Text,
        seeds: seeds::csv,
        ..LOG
    }
    .run();
}

#[test]
fn gzip() {
    Target {
        name: "gzip",
        inputs: 1000,
        form: Form::Text,
        seeds: seeds::csv,
        pack: packed::gzip,
        ..LOG
    }
    .run();
}

#[test]
fn npz() {
    Target {
        name: "npz",
        inputs: 2000,
        seeds: seeds::npz,
        ..LOG
    }
    .run();
}

#[test]
fn npy() {
    Target {
        name: "npy",
        inputs: 2000,
        form: Form::Text,
        seeds: seeds::npy,
        pack: packed::npz,
        ..LOG
    }
    .run();
}

#[test]
fn mat() {
    Target {
        name: "mat",
        inputs: 2000,
        seeds: seeds::mat,
        ..LOG
    }
    .run();
}

#[test]
fn packed_mat() {
    Target {
        name: "packed_mat",
        inputs: 2000,
        seeds: seeds::mat,
        pack: packed::mat,
        ..LOG
    }
    .run();
}

#[test]
fn parquet() {
    Target {
        name: "parquet",
        inputs: 2000,
        seeds: seeds::parquet,
        ..LOG
    }
    .run();
}

#[test]
fn lerobot() {
    let place = |folder: &Path| {
        let data = folder.join("data/chunk-000");
        fs::create_dir_all(&data).unwrap();
        fs::copy(seeds::episodes(), data.join("file-000.parquet")).unwrap();
        fs::create_dir(folder.join("meta")).unwrap();
        folder.join("meta/info.json")
    };
    let read = |path: &Path| log_of(path.ancestors().nth(2).unwrap(), Quantity::Command).is_ok();
    Target {
        name: "lerobot",
        inputs: 1000,
        form: Form::Text,
        seeds: seeds::lerobot,
        place,
        read,
        ..LOG
    }
    .run();
}

#[test]
fn bag() {
    let place = |folder: &Path| folder.join("run.db3");
    Target {
        name: "bag",
        inputs: 1000,
        seeds: seeds::bags,
        place,
        read: recording,
        ..LOG
    }
    .run();
}

#[test]
fn mcap() {
    Target {
        name: "mcap",
        inputs: 2000,
        seeds: seeds::mcap,
        pack: packed::mcap,
        read: recording,
        ..LOG
    }
    .run();
}
