use std::fs;
use std::path::{Path, PathBuf};

use super::{epochs, fit, hybrid, parameter, pendulum, rng, transitions};
use crate::{Backend, Checkpoint, FitSettings, HybridModel, Training, save};
use residyn_core::model::{LastLayer, MlpSettings, Origin};

fn origin() -> Origin {
    Origin {
        config: serde_json::json!({"epochs": 3}),
        model_toml: "[system]\nname = \"pendulum\"\n".to_owned(),
        ..Origin::of_seed(9)
    }
}

fn trained(c_g: f64) -> Training {
    let segments = transitions(20, 0.0, 1);
    let model = hybrid((c_g, 2.0), &segments, Backend::NdArray, LastLayer::Random);
    let settings = epochs(3);
    fit(model, &segments, settings)
}

/// A saved checkpoint, in a directory that exists as long as the first part.
fn saved() -> (tempfile::TempDir, PathBuf) {
    let parent = tempfile::tempdir().unwrap();
    let dir = parent.path().join("run");
    save(&dir, &trained(8.0), &origin()).unwrap();
    (parent, dir)
}

fn message(dir: &Path) -> String {
    let text = Checkpoint::load(dir).unwrap_err().to_string();
    text.replace(&format!("{dir:?}"), "DIR")
}

#[test]
fn a_checkpoint_restores_the_model_and_its_origin() {
    let (_parent, dir) = saved();
    let checkpoint = Checkpoint::load(&dir).unwrap();
    assert_eq!(checkpoint.model_toml, origin().model_toml);
    assert_eq!(checkpoint.manifest.config, origin().config);
    assert_eq!(checkpoint.manifest.seed, 9);
    for backend in Backend::ALL {
        let model = checkpoint
            .model(&pendulum(8.0, 2.0), &backend.device())
            .unwrap();
        assert_eq!(model.weights(), trained(8.0).model().weights());
    }
    let names: Vec<_> = fs::read_dir(dir.parent().unwrap()).unwrap().collect();
    assert_eq!(names.len(), 1, "nothing is left beside it: {names:?}");
}

#[test]
fn a_prior_that_is_a_network_is_saved_too() {
    let segments = transitions(20, 0.0, 1);
    let settings = MlpSettings::for_joints(1);
    let new = |seed| segments.network(&settings, LastLayer::Random, &mut rng(seed));
    let model = HybridModel::network("pendulum", 1, &new(1), &Backend::NdArray.device())
        .and_then(|model| model.with_residual(&new(2)))
        .unwrap();
    let training = Training::new(model, FitSettings::default(), rng(3)).unwrap();
    let parent = tempfile::tempdir().unwrap();
    let dir = parent.path().join("run");
    save(&dir, &training, &origin()).unwrap();
    let checkpoint = Checkpoint::load(&dir).unwrap();
    let restored = checkpoint
        .training(&pendulum(8.0, 2.0), &Backend::NdArray.device())
        .unwrap();
    assert_eq!(restored.model().weights(), training.model().weights());
}

#[test]
fn an_older_checkpoint_is_replaced_and_found_after_an_interrupted_replacement() {
    let (_parent, dir) = saved();
    save(&dir, &trained(9.0), &origin()).unwrap();
    let newer = Checkpoint::load(&dir).unwrap();
    assert_eq!(newer.weights, trained(9.0).model().weights());
    // The state after a kill between the two renamings.
    fs::rename(&dir, dir.with_file_name(".run.previous")).unwrap();
    assert_eq!(Checkpoint::load(&dir).unwrap().weights, newer.weights);
    save(&dir, &trained(8.0), &origin()).unwrap();
    assert_eq!(
        Checkpoint::load(&dir).unwrap().weights,
        trained(8.0).model().weights()
    );
    assert!(!dir.with_file_name(".run.previous").exists());
}

#[test]
fn other_files_are_not_replaced() {
    let parent = tempfile::tempdir().unwrap();
    fs::write(parent.path().join("thesis.tex"), "text").unwrap();
    let error = save(parent.path(), &trained(8.0), &origin()).unwrap_err();
    assert!(
        error
            .to_string()
            .contains("it holds other files; choose a new directory")
    );
    assert!(parent.path().join("thesis.tex").exists());
}

#[test]
fn missing_and_damaged_files_are_named() {
    let (_parent, dir) = saved();
    assert!(
        message(Path::new("nowhere"))
            .starts_with("not a checkpoint: there is no \"checkpoint.json\"")
    );
    fs::write(dir.join("last.safetensors"), b"short").unwrap();
    assert!(message(&dir).starts_with("the checkpoint's file \"last.safetensors\" is damaged ("));
    fs::remove_file(dir.join("weights.safetensors")).unwrap();
    assert_eq!(
        message(&dir),
        "not a checkpoint: there is no \"weights.safetensors\" in DIR"
    );
    fs::write(dir.join("checkpoint.json"), "{").unwrap();
    assert!(message(&dir).starts_with("the checkpoint's file \"checkpoint.json\" is damaged (EOF"));
}

#[test]
fn a_damaged_optimiser_state_is_refused() {
    let (_parent, dir) = saved();
    let load = || message(&dir);
    let path = dir.join("optimizer.bpk");
    let whole = fs::read(&path).unwrap();
    fs::write(&path, &whole[..whole.len() / 2]).unwrap();
    assert!(
        load().starts_with("the checkpoint's file \"optimizer.bpk\" is damaged ("),
        "{}",
        load()
    );
    fs::write(&path, b"").unwrap();
    assert!(
        load().starts_with("the checkpoint's file \"optimizer.bpk\" is damaged ("),
        "{}",
        load()
    );
}

/// Change the text of `checkpoint.json`.
fn edit(dir: &Path, from: &str, to: &str) {
    let path = dir.join("checkpoint.json");
    let text = fs::read_to_string(&path).unwrap();
    assert!(text.contains(from), "{text}");
    fs::write(path, text.replace(from, to)).unwrap();
}

#[test]
fn another_format_and_another_shape_are_refused() {
    let (_parent, dir) = saved();
    edit(&dir, "\"format\": 3", "\"format\": 7");
    let version = env!("CARGO_PKG_VERSION");
    assert_eq!(
        message(&dir),
        format!(
            "the checkpoint has format 7, this program reads format 3; use the residyn that wrote it \
             (version {version}) or train again, in DIR"
        )
    );
    let (_parent, dir) = saved();
    let path = dir.join("checkpoint.json");
    let mut json: serde_json::Value = serde_json::from_slice(&fs::read(&path).unwrap()).unwrap();
    json["residual"]["widths"][1] = 8.into();
    fs::write(&path, json.to_string()).unwrap();
    assert_eq!(
        message(&dir),
        "tensor `layers.0.weight` in \"weights.safetensors\" has shape [16, 3], but checkpoint.json \
         describes [8, 3]; the files belong to different checkpoints, in DIR"
    );
}

#[test]
fn a_checkpoint_of_another_model_is_refused() {
    let (_parent, dir) = saved();
    let checkpoint = Checkpoint::load(&dir).unwrap();
    let refused = |dynamics| {
        let model = checkpoint.model(&dynamics, &Backend::NdArray.device());
        let text = model.unwrap_err().to_string();
        text.split("; use").next().unwrap().to_owned()
    };
    let mut other = pendulum(8.0, 2.0);
    other.name = "acrobot".to_owned();
    assert_eq!(
        refused(other),
        "the checkpoint is of another model: its system is pendulum, the model's is acrobot"
    );
    let mut other = pendulum(8.0, 2.0);
    other.parameters[1] = parameter("J", 1.0);
    assert_eq!(
        refused(other),
        "the checkpoint is of another model: its list of parameters is C_g, C_i, the model's is C_g, J"
    );
    let mut other = pendulum(8.0, 2.0);
    other.joints = 2;
    assert_eq!(
        refused(other),
        "the checkpoint is of another model: its number of joints is 1, the model's is 2"
    );
}
