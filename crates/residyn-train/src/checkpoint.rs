use std::fs;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};

use burn::tensor::Device;

use super::manifest::{FORMAT, Manifest};
use super::{Backend, Best, CheckpointError, HybridModel, Training};
use residyn_core::model::{
    Dynamics, Library, Model, ModelShape, ModelWeights, Origin, SavedModelError, weights,
};
use residyn_io::files::{
    FreshFolder, OutputError, content_id, end_of_links, folder_of, hidden_beside, read_saved,
    remove_folder, write_whole,
};

const MANIFEST: &str = "checkpoint.json";
const MODEL: &str = "model.toml";
/// The model to use.
const WEIGHTS: &str = "weights.safetensors";
/// The model to continue from, which differs if an earlier one was the best.
const LAST: &str = "last.safetensors";
/// The optimiser's state.
const OPTIMIZER: &str = "optimizer.bpk";

/// A checkpoint as read from its directory.
#[derive(Debug, Clone, PartialEq)]
pub struct Checkpoint {
    pub manifest: Manifest,
    /// Text of the model file that the checkpoint belongs to.
    pub model_toml: String,
    /// The model to use.
    pub weights: ModelWeights,
    last: ModelWeights,
    optimizer: Vec<u8>,
    dir: PathBuf,
}

/// Writes a run to `dir`, completely or not at all, in place of any existing checkpoint.
///
/// The files are written to a new directory next to `dir`, which then takes its name. The old one is called
/// `.NAME.previous` in the meantime; if the program dies between the two renamings, [`Checkpoint::load`] finds it
/// there, and [`Checkpoint::find`] puts it back.
///
/// # Errors
/// A directory that cannot be written, or that holds something other than a checkpoint.
pub fn save(dir: &Path, training: &Training, origin: &Origin) -> Result<(), CheckpointError> {
    let dir = &end_of_links(dir);
    refuse_other_contents(dir)?;
    let optimizer = training.optimizer.to_bytes();
    let model = training.model();
    let last = model.weights();
    let shape = ModelShape::of(model.system(), model.joints(), &model.declared(), &last);
    let manifest = Manifest::of(training, shape, origin, &optimizer);
    let used = training.best.as_ref().map_or(&last, |best| &best.weights);
    let json = serde_json::to_vec_pretty(&manifest)
        .map_err(|error| io("encode the description of", dir)(std::io::Error::other(error)))?;
    let files: [(&str, &[u8]); 5] = [
        (WEIGHTS, &weights::to_bytes(&manifest.shape, used)),
        (LAST, &weights::to_bytes(&manifest.shape, &last)),
        (OPTIMIZER, &optimizer),
        (MODEL, origin.model_toml.as_bytes()),
        (MANIFEST, &json),
    ];
    let parent = folder_of(dir);
    fs::create_dir_all(parent).map_err(OutputError::of(parent))?;
    let fresh = FreshFolder::beside(dir).map_err(OutputError::of(dir))?;
    for (name, bytes) in files {
        let written = write_whole(&fresh.path().join(name), bytes);
        // Report the final path, since the temporary name is gone.
        written.map_err(|error| OutputError::of(&dir.join(name))(error.source))?;
    }
    Ok(replace(dir, fresh.path()).map_err(OutputError::of(dir))?)
}

fn refuse_other_contents(dir: &Path) -> Result<(), CheckpointError> {
    if !dir.exists() || dir.join(MANIFEST).is_file() {
        return Ok(());
    }
    let mut entries = fs::read_dir(dir).map_err(io("look into", dir))?;
    match entries.next() {
        None => Ok(()),
        Some(_) => Err(io("replace by a checkpoint", dir)(std::io::Error::other(
            "it holds other files; choose a new directory or empty it",
        ))),
    }
}

fn replace(dir: &Path, fresh: &Path) -> std::io::Result<()> {
    let previous = previous(dir);
    if dir.exists() {
        remove_folder(&previous)?;
        fs::rename(dir, &previous)?;
    }
    if let Err(error) = fs::rename(fresh, dir) {
        if previous.exists() {
            fs::rename(&previous, dir)?;
        }
        return Err(error);
    }
    remove_folder(&previous)
}

/// Finish a replacement that a killed program began: however far it got, one checkpoint is there afterwards under its
/// name.
fn settle(dir: &Path) -> std::io::Result<()> {
    let previous = previous(dir);
    if dir.join(MANIFEST).is_file() {
        return remove_folder(&previous);
    }
    match fs::rename(&previous, dir) {
        Err(error) if error.kind() != ErrorKind::NotFound => Err(error),
        _ => Ok(()),
    }
}

/// Where the older checkpoint is while a new one takes its place.
fn previous(dir: &Path) -> PathBuf {
    hidden_beside(dir, ".previous")
}

fn io<'a>(action: &'static str, path: &'a Path) -> impl Fn(std::io::Error) -> CheckpointError + 'a {
    move |source| CheckpointError::Io {
        action,
        source,
        path: path.to_owned(),
    }
}

impl Checkpoint {
    /// Reads a checkpoint and checks that its files belong together.
    ///
    /// # Errors
    /// A missing or damaged file, or another format.
    pub fn load(dir: &Path) -> Result<Self, CheckpointError> {
        let dir = &end_of_links(dir);
        let set_aside = previous(dir);
        let dir = if !dir.exists() && set_aside.exists() {
            set_aside
        } else {
            dir.to_owned()
        };
        let manifest = read_manifest(&dir)?;
        let numbers = |file: &str| -> Result<ModelWeights, CheckpointError> {
            let bytes = read(&dir, file)?;
            Ok(weights::from_bytes(&manifest.shape, &bytes, file, &dir)?)
        };
        let model_toml = String::from_utf8(read(&dir, MODEL)?)
            .map_err(|error| corrupt(MODEL, error.to_string(), &dir))?;
        let (weights, last) = (numbers(WEIGHTS)?, numbers(LAST)?);
        let optimizer = read(&dir, OPTIMIZER)?;
        if content_id(&optimizer) != manifest.optimizer {
            let reason = "it is not the file that checkpoint.json describes";
            return Err(corrupt(OPTIMIZER, reason.to_owned(), &dir));
        }
        Ok(Self {
            optimizer,
            weights,
            last,
            model_toml,
            manifest,
            dir,
        })
    }

    /// A checkpoint, the declared model in it, and the trained model.
    ///
    /// # Errors
    /// As [`Checkpoint::load`], or a model file that `library` cannot read.
    pub fn open(
        dir: &Path,
        library: &Library,
        backend: Backend,
    ) -> Result<(Self, Model, HybridModel), CheckpointError> {
        let checkpoint = Self::load(dir)?;
        let text = &checkpoint.model_toml;
        let declared = Model::from_text(&dir.join(MODEL), text, library.effects())?;
        let trained = checkpoint.model(&declared.dynamics(), &backend.device())?;
        Ok((checkpoint, declared, trained))
    }

    /// The checkpoint in `dir`, which the caller owns, or none if `dir` does not exist or is empty.
    ///
    /// # Errors
    /// As [`Checkpoint::load`], or a directory that holds something else.
    pub fn find(dir: &Path) -> Result<Option<Self>, CheckpointError> {
        let dir = &end_of_links(dir);
        settle(dir).map_err(OutputError::of(dir))?;
        refuse_other_contents(dir)?;
        let is_there = dir.join(MANIFEST).is_file();
        is_there.then(|| Self::load(dir)).transpose()
    }

    /// A hash of the trained model's numbers.
    pub fn fingerprint(&self) -> String {
        content_id(&weights::to_bytes(&self.manifest.shape, &self.weights))
    }

    /// The trained model, on `device`. `dynamics` is the content of the checkpoint's model file.
    ///
    /// # Errors
    /// When `dynamics` is another model.
    pub fn model(
        &self,
        dynamics: &Dynamics,
        device: &Device,
    ) -> Result<HybridModel, CheckpointError> {
        self.build(&self.weights, dynamics, device)
    }

    /// The run, to be continued.
    ///
    /// # Errors
    /// When `dynamics` is another model.
    pub fn training(
        &self,
        dynamics: &Dynamics,
        device: &Device,
    ) -> Result<Training, CheckpointError> {
        let model = self.build(&self.last, dynamics, device)?;
        let manifest = &self.manifest;
        let training = Training::new(model, manifest.settings.clone(), manifest.rng.clone())?;
        let resumed = training.resumed_at(manifest.epoch, &self.optimizer);
        let mut training = resumed.map_err(|reason| corrupt(OPTIMIZER, reason, &self.dir))?;
        training.penalty_weight = manifest.penalty_weight;
        training.history.clone_from(&manifest.history);
        training.best = manifest.best.as_ref().map(|best| Best {
            epoch: best.epoch,
            validation: best.validation,
            weights: self.weights.clone(),
        });
        Ok(training)
    }

    fn build(
        &self,
        weights: &ModelWeights,
        dynamics: &Dynamics,
        device: &Device,
    ) -> Result<HybridModel, CheckpointError> {
        self.check(dynamics)?;
        let shape = &self.manifest.shape;
        Ok(HybridModel::restored(shape, weights, dynamics, device)?)
    }

    fn check(&self, dynamics: &Dynamics) -> Result<(), CheckpointError> {
        let same = |what, saved: String, given: String| match saved == given {
            true => Ok(()),
            false => Err(CheckpointError::Foreign {
                what,
                saved,
                given,
                dir: self.dir.clone(),
            }),
        };
        let saved = &self.manifest.shape;
        same("system", saved.system.clone(), dynamics.name.clone())?;
        let (joints, given) = (saved.joints.to_string(), dynamics.joints.to_string());
        same("number of joints", joints, given)?;
        if saved.prior.is_some() {
            // A network needs no equations, so the model file may have any.
            return Ok(());
        }
        let known = listed(saved.parameters.iter().map(|p| &p.name));
        let given = listed(dynamics.parameters.iter().map(|p| &p.name));
        same("list of parameters", known, given)
    }
}

fn listed<'n>(names: impl Iterator<Item = &'n String>) -> String {
    match names.map(String::as_str).collect::<Vec<_>>() {
        names if names.is_empty() => "none".to_owned(),
        names => names.join(", "),
    }
}

fn read(dir: &Path, file: &str) -> Result<Vec<u8>, CheckpointError> {
    let path = dir.join(file);
    match read_saved(&path) {
        Ok(bytes) => Ok(bytes),
        Err(error) if error.kind() == ErrorKind::NotFound => Err(CheckpointError::Missing {
            missing: file.to_owned(),
            dir: dir.to_owned(),
        }),
        Err(error) => Err(io("read", &path)(error)),
    }
}

/// The format is read first: in another format everything else may differ.
fn read_manifest(dir: &Path) -> Result<Manifest, CheckpointError> {
    let damaged = |error: serde_json::Error| corrupt(MANIFEST, error.to_string(), dir);
    let json: serde_json::Value = serde_json::from_slice(&read(dir, MANIFEST)?).map_err(damaged)?;
    match json["format"].as_u64() {
        Some(FORMAT) => serde_json::from_value(json).map_err(damaged),
        Some(found) => Err(CheckpointError::Format {
            found,
            expected: FORMAT,
            written_by: format!("version {}", json["residyn"].as_str().unwrap_or("unknown")),
            dir: dir.to_owned(),
        }),
        None => Err(corrupt(MANIFEST, "it has no number `format`".into(), dir)),
    }
}

fn corrupt(file: &str, reason: String, dir: &Path) -> CheckpointError {
    let (file, dir) = (file.to_owned(), dir.to_owned());
    SavedModelError::Corrupt { file, reason, dir }.into()
}
