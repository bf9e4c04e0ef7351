//! What is done in a fold: score models as they are, fit the plain structure, close the loop.

use std::fmt;

use serde::{Deserialize, Serialize};

use super::errors::{LogErrors, by_log, errors_on};
use super::fold::{Fold, Measured};
use super::mujoco::Task;
use crate::answer::answer;
use residyn_core::closeloop::{
    Declared, Problem, Request, ResidualLearner, Settings, Split, StudyError, Verdict, Watch,
    close_loop,
};
use residyn_core::data::Log;
use residyn_core::model::{Library, Model};
use residyn_core::rng;

/// A model that is scored.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Scored {
    /// The declared model with the values in its file.
    Declared,
    /// The declared model, fitted.
    Fitted,
    /// The declared model with the usual friction that closing the loop compares with, fitted; the same as `Fitted` if
    /// that friction is declared.
    Usual,
    /// The declared model with the plain structure, fitted.
    Plain,
    /// A published parameter set as it is.
    Published(String),
    /// The declared model, fitted by mujoco.sysid with damping, dry friction and armature on every joint.
    MujocoSysid,
    /// What closing the loop found.
    After,
    /// With the residual network; the same as `After` if there is none.
    Hybrid,
}

/// A piece of work in a fold. Each is stored separately.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Method {
    /// Score the declared model and the published sets as they are.
    AsTheyAre,
    /// Fit the plain structure.
    Plain,
    /// Let mujoco.sysid fit the declared model.
    MujocoSysid,
    /// Close the loop.
    CloseLoop,
}

/// The result of a method in a fold.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Found {
    /// Errors of each model on each test log of the fold.
    pub errors: Vec<(Scored, Vec<LogErrors>)>,
    /// The verdict of closing the loop.
    pub said: Option<Said>,
}

/// The verdict of closing the loop and the names of the effects that it found.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Said {
    pub verdict: Verdict,
    pub names: Vec<String>,
}

impl fmt::Display for Scored {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Declared => "declared",
            Self::Fitted => "declared, fitted",
            Self::Usual => "usual friction",
            Self::Plain => "plain structure",
            Self::MujocoSysid => "mujoco.sysid",
            Self::Published(name) => return write!(f, "published {name}"),
            Self::After => "after",
            Self::Hybrid => "hybrid",
        })
    }
}

impl Scored {
    /// Whether closing the loop has to do at least as well.
    pub fn is_rival(&self) -> bool {
        matches!(
            self,
            Self::Usual | Self::Plain | Self::Published(_) | Self::MujocoSysid
        )
    }
}

/// The tools that methods work with.
pub struct Tools<'a> {
    pub library: &'a Library,
    /// Trains the residual network.
    pub learner: Option<&'a dyn ResidualLearner>,
    pub seed: u64,
}

impl Method {
    pub const ALL: [Self; 4] = [
        Self::AsTheyAre,
        Self::Plain,
        Self::MujocoSysid,
        Self::CloseLoop,
    ];

    /// The name used in its files.
    pub fn name(self) -> &'static str {
        match self {
            Self::AsTheyAre => "as_they_are",
            Self::Plain => "plain",
            Self::MujocoSysid => "mujoco_sysid",
            Self::CloseLoop => "closeloop",
        }
    }

    /// The models that the method scores on a rig.
    pub fn scores(self, rig: &Measured) -> Vec<Scored> {
        let published = rig
            .published
            .iter()
            .map(|(name, _)| Scored::Published(name.clone()));
        match self {
            Self::AsTheyAre => std::iter::once(Scored::Declared).chain(published).collect(),
            Self::Plain => vec![Scored::Plain],
            Self::MujocoSysid => vec![Scored::MujocoSysid],
            Self::CloseLoop => vec![Scored::Fitted, Scored::Usual, Scored::After, Scored::Hybrid],
        }
    }

    /// Changes with everything that the result depends on; `program` stands for this build of the program.
    pub fn fingerprint(self, rig: &Measured, fold: &Fold, seed: u64, program: &str) -> String {
        match self {
            // Another build of the program changes nothing in the task for MuJoCo.
            Self::MujocoSysid => Task::new(&rig.declared, &fold.train, &fold.test)
                .map_or_else(|error| error.to_string(), |task| task.fingerprint()),
            Self::AsTheyAre | Self::Plain | Self::CloseLoop => {
                format!("{} {seed} {program}", rig.fingerprint)
            }
        }
    }

    /// Do the work.
    ///
    /// # Errors
    /// Logs or a model on which the method fails.
    pub fn run(
        self,
        rig: &Measured,
        fold: &Fold,
        tools: &Tools<'_>,
        watch: &dyn Watch,
    ) -> anyhow::Result<Found> {
        let (errors, said) = match self {
            Self::AsTheyAre => (as_they_are(rig, fold), None),
            Self::Plain => {
                let fitted = fit(&rig.plain, tools.library, &fold.train)?;
                (vec![(Scored::Plain, errors_of(&fitted, fold))], None)
            }
            Self::MujocoSysid => {
                let task = Task::new(&rig.declared, &fold.train, &fold.test)?;
                (vec![(Scored::MujocoSysid, task.run()?)], None)
            }
            Self::CloseLoop => closed(rig, fold, tools, watch)?,
        };
        Ok(Found { errors, said })
    }
}

fn errors_of(model: &Model, fold: &Fold) -> Vec<LogErrors> {
    errors_on(&model.dynamics(), &fold.test)
}

fn as_they_are(rig: &Measured, fold: &Fold) -> Vec<(Scored, Vec<LogErrors>)> {
    let sets = rig.published.iter();
    let sets = sets.map(|(name, model)| (Scored::Published(name.clone()), errors_of(model, fold)));
    std::iter::once((Scored::Declared, errors_of(&rig.declared, fold)))
        .chain(sets)
        .collect()
}

/// A model and its effects, fitted from their current values, as closing the loop fits the declared model.
fn fit(model: &Model, library: &Library, logs: &[Log]) -> Result<Model, StudyError> {
    let settings = Settings::default();
    let problem = Problem::new(model, library, logs, &settings);
    let Declared { problem, fitted } = problem.fit_declared()?;
    Ok(problem.refined().estimate(&fitted)?.model)
}

type Closed = (Vec<(Scored, Vec<LogErrors>)>, Option<Said>);

fn closed(
    rig: &Measured,
    fold: &Fold,
    tools: &Tools<'_>,
    watch: &dyn Watch,
) -> Result<Closed, StudyError> {
    let split = Split::given(fold.train.clone(), fold.test.clone());
    let mut request = Request::new(&rig.declared, tools.library, split);
    request.learner = tools.learner;
    let outcome = close_loop(request, &mut rng(tools.seed), watch)?;
    let errors = &outcome.errors;
    let usual = errors.with_friction.as_ref().unwrap_or(&errors.before);
    let hybrid = errors.hybrid.as_ref().unwrap_or(&errors.after);
    let models = [
        (Scored::Fitted, &errors.before),
        (Scored::Usual, usual),
        (Scored::After, &errors.after),
        (Scored::Hybrid, hybrid),
    ];
    let logs = fold.test.len();
    let answer = answer(&outcome);
    let said = Said {
        verdict: answer.verdict,
        names: answer.named.into_iter().map(|named| named.label).collect(),
    };
    let errors = models.map(|(what, assessment)| (what, by_log(assessment, logs)));
    Ok((errors.into(), Some(said)))
}
