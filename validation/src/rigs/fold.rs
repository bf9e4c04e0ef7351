//! A rig with its models and logs read, and its folds: which logs train a model and which test it.

use std::collections::BTreeMap;
use std::path::Path;

use super::config::{Declared, Published, Rig, RigsError, Test};
use residyn_core::closeloop::between;
use residyn_core::data::{Joint, LeaveOut, Log, leave_out};
use residyn_core::model::{FittedEffect, Library, Model, ModelError};
use residyn_io::files::content_id;
use residyn_io::read_logs;
use residyn_io::read_model;

/// A measured rig with its models and logs.
#[derive(Debug)]
pub struct Measured {
    pub rig: Rig,
    /// Before any fit.
    pub declared: Model,
    /// The declared model with the plain structure added, before any fit.
    pub plain: Model,
    /// Published parameter sets by name.
    pub published: Vec<(String, Model)>,
    pub folds: Vec<Fold>,
    /// Changes with everything that the rig's numbers depend on: description, model files, logs.
    pub fingerprint: String,
}

/// Logs to fit a model to and logs to score it on.
#[derive(Debug, Clone)]
pub struct Fold {
    pub name: String,
    pub train: Vec<Log>,
    pub test: Vec<Log>,
    /// The row that each test log counts in.
    pub places: Vec<Place>,
}

/// A test log, and the row of the table that it counts in.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Place {
    /// `None` for a log (or half of one) that was left out of the logs that models are fitted to.
    pub group: Option<String>,
    pub log: String,
}

impl Measured {
    /// Read the models and logs of a rig; `data` is the folder of measured logs.
    ///
    /// # Errors
    /// A model or log that cannot be read, or names that the models do not have.
    pub fn open(rig: Rig, data: &Path, library: &Library) -> Result<Self, RigsError> {
        let declared = model(&rig, &rig.declared, library)?;
        let published = |set: &Published| Ok((set.name.clone(), model(&rig, &set.model, library)?));
        let logs = Logs::read(&rig, &declared, data)?;
        let published = rig
            .published
            .iter()
            .map(published)
            .collect::<Result<_, _>>()?;
        Ok(Self {
            plain: with_plain(&declared, &rig.plain, library).map_err(RigsError::of(&rig))?,
            published,
            folds: logs.folds(rig.test),
            fingerprint: fingerprint(&rig, data),
            declared,
            rig,
        })
    }
}

/// A model with other values of some of its parameters.
fn model(rig: &Rig, declared: &Declared, library: &Library) -> Result<Model, RigsError> {
    let mut model = read_model(&declared.model, library).map_err(RigsError::of(rig))?;
    for (parameter, value) in &declared.parameters {
        let known: Vec<&str> = model.parameters.iter().map(|p| p.name.as_str()).collect();
        let Some(k) = known.iter().position(|known| known == parameter) else {
            let (file, known) = (declared.model.display(), known.join(", "));
            let message = format!("{file} has no parameter `{parameter}`; it has {known}");
            return Err(RigsError::of(rig)(message));
        };
        model.parameters[k] = model.parameters[k].with_value(*value);
    }
    Ok(model)
}

/// The model with these effects on every joint, absent until they are fitted, beside those that it declares.
fn with_plain(
    declared: &Model,
    effects: &[String],
    library: &Library,
) -> Result<Model, ModelError> {
    let mut all = declared.effects.clone();
    for name in effects {
        let effect = library.effect(name)?;
        for joint in Joint::all(declared.joints) {
            let new = FittedEffect::absent(effect, joint);
            let declares = |own: &FittedEffect| own.effect.name == *name && own.joint == joint;
            if declared.effects.iter().any(declares) {
                continue;
            }
            declared.check_effect(&new, &all)?;
            all.push(new);
        }
    }
    Ok(declared.with_effects(all))
}

/// The logs of a rig.
struct Logs {
    /// The logs that models are fitted to.
    fitted: Vec<Log>,
    also: BTreeMap<String, Vec<Log>>,
}

impl Logs {
    fn read(rig: &Rig, model: &Model, data: &Path) -> Result<Self, RigsError> {
        let folder = data.join(&rig.folder);
        if !folder.is_dir() {
            let rig = rig.name.clone();
            return Err(RigsError::NoLogs { rig, folder });
        }
        let groups = std::iter::once(&rig.logs).chain(rig.also.values());
        let paths = groups.clone().flatten().map(|log| folder.join(log));
        let mut logs = read_logs(paths, model).map_err(RigsError::of(rig))?;
        let spans = rig.leave_out.iter().map(|text| text.parse::<LeaveOut>());
        let spans = spans.collect::<Result<Vec<_>, _>>();
        let spans = spans.map_err(RigsError::of(rig))?;
        leave_out::apply(&mut logs, &spans).map_err(RigsError::of(rig))?;
        let mut groups = groups.map(|group| logs.drain(..group.len()).collect());
        Ok(Self {
            fitted: groups.next().unwrap_or_default(),
            also: rig.also.keys().cloned().zip(groups).collect(),
        })
    }

    fn folds(&self, test: Test) -> Vec<Fold> {
        let mut folds = match test {
            Test::EachLog => self.each_log(),
            Test::Halves => self.halves(),
        };
        folds.extend(self.all());
        folds
    }

    fn each_log(&self) -> Vec<Fold> {
        let fold = |k: usize| {
            let mut train = self.fitted.clone();
            let test = train.remove(k);
            Fold::new(test.name(), train, vec![test], &[None])
        };
        (0..self.fitted.len()).map(fold).collect()
    }

    fn halves(&self) -> Vec<Fold> {
        let half = |log: &Log| {
            let middle = log.time[0] + log.duration() / 2.0;
            (
                between(log, f64::NEG_INFINITY, middle),
                between(log, middle, f64::INFINITY),
            )
        };
        let (first, second): (Vec<Log>, Vec<Log>) = self.fitted.iter().map(half).unzip();
        let groups = vec![None; first.len()];
        vec![
            Fold::new("second half".into(), first.clone(), second.clone(), &groups),
            Fold::new("first half".into(), second, first, &groups),
        ]
    }

    /// The fold that tests on other logs, if there are any.
    fn all(&self) -> Option<Fold> {
        let tests = self
            .also
            .iter()
            .flat_map(|(group, logs)| logs.iter().map(|log| (log.clone(), Some(group.clone()))));
        let (test, groups): (Vec<Log>, Vec<Option<String>>) = tests.unzip();
        (!test.is_empty())
            .then(|| Fold::new("other logs".into(), self.fitted.clone(), test, &groups))
    }
}

impl Fold {
    fn new(name: String, train: Vec<Log>, test: Vec<Log>, groups: &[Option<String>]) -> Self {
        let place = |(log, group): (&Log, &Option<String>)| Place {
            group: group.clone(),
            log: log.name(),
        };
        Self {
            places: test.iter().zip(groups).map(place).collect(),
            name,
            train,
            test,
        }
    }
}

/// Changes with the description of a rig and with the contents of the files that it names.
fn fingerprint(rig: &Rig, data: &Path) -> String {
    let mut bytes = serde_json::to_vec(rig).expect("numbers, texts and names");
    let models = std::iter::once(&rig.declared).chain(rig.published.iter().map(|set| &set.model));
    let models = models.map(|declared| declared.model.clone());
    let names = rig.logs.iter().chain(rig.also.values().flatten());
    let logs = names.map(|log| data.join(&rig.folder).join(log));
    for path in models.chain(logs) {
        // A built-in system is not a file; it changes only with the program.
        bytes.extend(std::fs::read(path).unwrap_or_default());
    }
    content_id(&bytes)
}
