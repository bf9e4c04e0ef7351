//! The readers, each with its seeds and with the use made of what it accepts.

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;

use rand_chacha::ChaCha8Rng;
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
use crate::support::copy_files;
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

fn checkpoint_beside(path: &Path) -> bool {
    let folder = path.parent().unwrap();
    Checkpoint::open(folder, library(), Backend::NdArray).is_ok()
}

fn in_checkpoint(folder: &Path, file: &str) -> PathBuf {
    copy_files(&ours(CHECKPOINT), folder);
    folder.join(file)
}

impl Target {
    /// Files of text that stand alone.
    fn alone(
        name: &'static str,
        inputs: u64,
        seeds: fn() -> Vec<Vec<u8>>,
        read: fn(&Path) -> bool,
    ) -> Self {
        Self {
            name,
            inputs,
            form: Form::Text,
            seeds,
            pack: packed::as_it_is,
            place: |folder| folder.join("input.toml"),
            read,
        }
    }

    /// Logs of a format.
    fn log(name: &'static str, inputs: u64, seeds: fn() -> Vec<Vec<u8>>) -> Self {
        let target = Self::alone(name, inputs, seeds, log);
        target.of(Form::Bytes).placed(|folder| folder.join("run"))
    }

    fn of(self, form: Form) -> Self {
        Self { form, ..self }
    }

    fn packed(self, pack: fn(Vec<u8>, &mut ChaCha8Rng) -> Vec<u8>) -> Self {
        Self { pack, ..self }
    }

    fn placed(self, place: fn(&Path) -> PathBuf) -> Self {
        Self { place, ..self }
    }

    fn read_by(self, read: fn(&Path) -> bool) -> Self {
        Self { read, ..self }
    }
}

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
    Target::alone("formula", 20_000, seeds::formulas, read).run();
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
    Target::alone("model", 2000, seeds::models, read).run();
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
    Target::alone("effect", 3000, seeds::effects, read).run();
}

#[test]
fn recipe() {
    let read = |path: &Path| Recipe::read(path).is_ok();
    Target::alone("recipe", 3000, seeds::recipes, read).run();
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
    Target::alone("task", 3000, seeds::tasks, read).run();
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
    Target::alone("plant", 2000, seeds::plants, read).run();
}

#[test]
fn experiment() {
    let read = |path: &Path| {
        experiment::Config::read(path).is_ok() || undeclared_effect::Experiment::read(path).is_ok()
    };
    Target::alone("experiment", 3000, seeds::experiments, read).run();
}

#[test]
fn bench() {
    let read = |path: &Path| bench::read(path).is_ok() || bench::rigs::read(path).is_ok();
    Target::alone("bench", 2000, seeds::benches, read).run();
}

/// Robot descriptions in a format.
fn robot(name: &'static str, inputs: u64, seeds: fn() -> Vec<Vec<u8>>, read: fn(&Path) -> bool) {
    let place = |folder: &Path| folder.join("arm.xml");
    Target::alone(name, inputs, seeds, read).placed(place).run();
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
    Target::alone("manifest", 2000, seeds::manifests, checkpoint_beside)
        .placed(place)
        .run();
}

#[test]
fn weights() {
    let place = |folder: &Path| in_checkpoint(folder, "weights.safetensors");
    Target::alone("weights", 2000, seeds::weights, checkpoint_beside)
        .of(Form::Bytes)
        .placed(place)
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
    Target::alone("optimizer", 2000, seeds::optimizers, read)
        .of(Form::Bytes)
        .placed(place)
        .run();
}

#[test]
fn tensors() {
    let place = |folder: &Path| in_checkpoint(folder, "weights.safetensors");
    let pack = packed::tensors;
    Target::alone("tensors", 2000, seeds::tensors, checkpoint_beside)
        .packed(pack)
        .placed(place)
        .run();
}

#[test]
fn description() {
    let place = |folder: &Path| {
        copy_files(exported(), folder);
        folder.join("model.json")
    };
    let read = |path: &Path| {
        let imported = Imported::read(path, library().effects());
        imported.is_ok_and(|imported| {
            let _ = save_imported(&path.with_file_name("out"), imported, 0, Backend::NdArray);
            true
        })
    };
    Target::alone("description", 1000, seeds::descriptions, read)
        .placed(place)
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
    Target::alone("report", 300, seeds::reports, read)
        .placed(place)
        .run();
}

#[test]
fn csv() {
    Target::log("csv", 2000, seeds::csv).of(Form::Text).run();
}

#[test]
fn gzip() {
    Target::log("gzip", 1000, seeds::csv)
        .of(Form::Text)
        .packed(packed::gzip)
        .run();
}

#[test]
fn npz() {
    Target::log("npz", 2000, seeds::npz).run();
}

#[test]
fn pt() {
    Target::log("pt", 2000, seeds::pt).run();
}

#[test]
fn hdf5() {
    Target::log("hdf5", 2000, seeds::hdf5).run();
}

#[test]
fn pickle() {
    Target::log("pickle", 2000, seeds::pickles)
        .packed(packed::pt)
        .run();
}

#[test]
fn npy() {
    Target::log("npy", 2000, seeds::npy)
        .of(Form::Text)
        .packed(packed::npz)
        .run();
}

#[test]
fn mat() {
    Target::log("mat", 2000, seeds::mat).run();
}

#[test]
fn packed_mat() {
    Target::log("packed_mat", 2000, seeds::mat)
        .packed(packed::mat)
        .run();
}

#[test]
fn parquet() {
    Target::log("parquet", 2000, seeds::parquet).run();
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
    Target::log("lerobot", 1000, seeds::lerobot)
        .read_by(read)
        .of(Form::Text)
        .placed(place)
        .run();
}

#[test]
fn bag() {
    let place = |folder: &Path| folder.join("run.db3");
    Target::log("bag", 1000, seeds::bags)
        .read_by(recording)
        .placed(place)
        .run();
}

#[test]
fn mcap() {
    Target::log("mcap", 2000, seeds::mcap)
        .read_by(recording)
        .packed(packed::mcap)
        .run();
}
