use std::path::{Path, PathBuf};

use include_dir::{Dir, include_dir};
use rand::{Rng, RngExt};
use serde::{Deserialize, Serialize};
use thiserror::Error;

use super::Bounds;
use crate::plan::{Objective, Settings};
use residyn_core::limits::{LOG_ROWS, check_readings};
use residyn_core::model::Dynamics;
use residyn_core::plant::{Noise, Plant, Rig, check_step};
use residyn_core::sim::Integrator;
use residyn_core::toml_text::from_toml;
use residyn_io::files::text_or_embedded;

/// What a plant is to do, and how to plan for it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Task {
    /// Name of the system.
    pub system: String,
    pub about: String,
    /// The reward of a step: a formula of the state that it leads to, of the torque held over it, and of time.
    pub objective: String,
    /// Steps of an episode.
    pub steps: usize,
    /// How long a torque is held, in s.
    pub step_s: f64,
    /// True positions, then velocities at the start.
    pub start: Vec<f64>,
    /// Half the width of a uniform distribution around each of them; none if not given.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub start_spread: Vec<f64>,
    /// Lowest and highest torque of each joint, in N m (or N), or command of its drive.
    #[serde(alias = "command")]
    pub torque: Vec<[f64; 2]>,
    /// Steps of a plan that are executed before the next: the receding horizon RH.
    pub replan: usize,
    /// Integrator of models that are equations, one of its steps for each step of the task. A checkpoint keeps the
    /// integrator that it was trained with.
    #[serde(default)]
    pub integrator: Integrator,
    pub planner: Settings,
    pub goal: Goal,
    #[serde(default)]
    pub plant: PlantSettings,
    /// What plans keep the state within as far as they can; the plant says so, not the file.
    #[serde(skip)]
    pub bounds: Bounds,
    /// Where it was read from.
    #[serde(skip)]
    pub path: PathBuf,
}

/// The criterion of success: a formula of the state stays above a bound to the end of the episode.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Goal {
    pub formula: String,
    pub at_least: f64,
    /// Length of the last part of an episode over which it must hold, in s.
    pub hold_s: f64,
}

/// How the plant moves and is measured.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct PlantSettings {
    pub integrator: Integrator,
    pub noise: Noise,
}

/// An invalid task: which file, what is wrong, and the remedy.
#[derive(Debug, Error)]
#[error("{path}: {message}", path = .path.display())]
pub struct TaskError {
    pub path: PathBuf,
    pub message: String,
}

/// Why there is no task for a plant.
#[derive(Debug, Error)]
pub enum NoTask {
    #[error(transparent)]
    Invalid(#[from] TaskError),
    #[error("no built-in task is for {system}; give a task file (built in: {built_in})")]
    None { system: String, built_in: String },
    #[error("the task {task} is for {of}, but the plant is {system}; give a task for it")]
    OtherSystem {
        task: String,
        of: String,
        system: String,
    },
}

/// The embedded tasks.
static BUILT_IN: Dir<'_> = include_dir!("$CARGO_MANIFEST_DIR/../../configs/tasks");

impl Task {
    /// Read a task file or, if there is no such file, the embedded task of that name.
    ///
    /// # Errors
    /// Unreadable file, unknown key, invalid formula or number: with place and remedy.
    pub fn read(path: &Path) -> Result<Self, TaskError> {
        let text = text_or_embedded(path, text_of).map_err(|error| TaskError {
            path: path.to_owned(),
            message: format!(
                "{error}; give a task file or one of {}",
                Self::names().join(", ")
            ),
        })?;
        Self::from_text(path, &text)
    }

    /// The task in `text`; `path` is for messages.
    ///
    /// # Errors
    /// As [`Task::read`].
    pub fn from_text(path: &Path, text: &str) -> Result<Self, TaskError> {
        let wrong = |message: String| TaskError {
            path: path.to_owned(),
            message,
        };
        let mut task: Self = from_toml(text).map_err(|error| wrong(error.to_string()))?;
        path.clone_into(&mut task.path);
        task.check().map_err(wrong)?;
        Ok(task)
    }

    /// Names of the embedded tasks, in alphabetical order.
    pub fn names() -> Vec<&'static str> {
        let stem = |file: &include_dir::File<'static>| file.path().file_stem()?.to_str();
        let mut names: Vec<_> = BUILT_IN.files().filter_map(stem).collect();
        names.sort_unstable();
        names
    }

    /// The embedded task of a system; if there are several, the one with the longest planning horizon.
    pub fn of_system(system: &str) -> Option<Self> {
        let tasks = Self::names()
            .into_iter()
            .map(|name| Self::read(Path::new(name)));
        tasks
            .map(|task| task.expect("embedded tasks are read by a test"))
            .filter(|task| task.system == system)
            .max_by_key(|task| task.planner.horizon)
    }

    /// A task for a plant, as [`Task::for_system`].
    ///
    /// # Errors
    /// As [`Task::for_system`].
    pub fn for_plant(plant: &Plant, given: Option<&Path>) -> Result<Self, NoTask> {
        Self::for_system(&plant.system.name, plant.system.joints, given)
    }

    /// A task for a system: from a file, or the embedded one of this name; without a name, the embedded task of the
    /// system.
    ///
    /// # Errors
    /// As [`Task::read`]; no task for the system, or a task for another one.
    pub fn for_system(system: &str, joints: usize, given: Option<&Path>) -> Result<Self, NoTask> {
        let of_system = || {
            Self::of_system(system).ok_or_else(|| NoTask::None {
                system: system.to_owned(),
                built_in: Self::names().join(", "),
            })
        };
        let task = given.map_or_else(of_system, |path| Ok(Self::read(path)?))?;
        match task.system == *system && task.joints() == joints {
            true => Ok(task),
            false => Err(NoTask::OtherSystem {
                task: task.name(),
                system: system.to_owned(),
                of: task.system,
            }),
        }
    }

    /// Its name: the stem of its file's name.
    pub fn name(&self) -> String {
        let stem = self.path.file_stem().unwrap_or_default();
        stem.to_string_lossy().into_owned()
    }

    /// Number of joints.
    pub fn joints(&self) -> usize {
        self.torque.len()
    }

    /// The objective that a planner maximises.
    pub fn objective(&self) -> Objective {
        Objective::new(&self.objective, self.joints()).expect("checked when it was read")
    }

    /// The formula of the goal.
    pub fn goal_formula(&self) -> Objective {
        Objective::new(&self.goal.formula, self.joints()).expect("checked when it was read")
    }

    /// Draw a true start state.
    pub fn draw_start(&self, rng: &mut impl Rng) -> Vec<f64> {
        let spread = self
            .start_spread
            .iter()
            .copied()
            .chain(std::iter::repeat(0.0));
        (self.start.iter().zip(spread))
            .map(|(middle, half)| middle + half * rng.random_range(-1.0..=1.0))
            .collect()
    }

    /// `plant` at a true start state, with the integrator and sensor noise of the task; `dynamics` are the plant's
    /// [own](Plant::dynamics).
    ///
    /// # Panics
    /// When one of them belongs to another system.
    pub fn rig<'d>(&self, plant: &Plant, dynamics: &'d Dynamics, start: &[f64]) -> Rig<'d> {
        let PlantSettings { integrator, noise } = self.plant;
        let start = plant.as_read(start);
        Rig::new(dynamics, &start, integrator, self.step_s, noise)
    }

    /// Check the task for a plant of `joints` joints.
    ///
    /// # Errors
    /// What is wrong, and the remedy.
    pub fn check_for(&self, joints: usize) -> Result<(), TaskError> {
        let sizes = match self.joints() {
            found if found == joints => Ok(()),
            found => Err(format!(
                "`torque` needs a range for each of {joints} joints, found {found}"
            )),
        };
        sizes
            .and_then(|()| self.check())
            .map_err(|message| TaskError {
                path: self.path.clone(),
                message,
            })
    }

    fn check(&self) -> Result<(), String> {
        let n = self.joints();
        if n == 0 {
            return Err("`torque` has no range; write one [lowest, highest] for each joint".into());
        }
        let sizes = [
            ("start", self.start.len(), true),
            ("start_spread", self.start_spread.len(), false),
        ];
        for (name, found, required) in sizes {
            if found != 2 * n && (required || found > 0) {
                return Err(format!(
                    "`{name}` needs {} numbers, the positions and velocities of {n} joints, found {found}",
                    2 * n
                ));
            }
        }
        if let Some([low, high]) = self.torque.iter().find(|[low, high]| !(low <= high)) {
            return Err(format!(
                "`torque` has the range [{low}, {high}]; write [lowest, highest]"
            ));
        }
        check_readings("torque", self.torque.iter().flatten().copied())?;
        check_readings("start", self.start.iter().copied())?;
        check_readings("start_spread", self.start_spread.iter().copied())?;
        check_step(self.step_s)?;
        if !(1..=LOG_ROWS).contains(&self.steps) {
            return Err(format!("`steps` must be from 1 to {LOG_ROWS}"));
        }
        self.planner.check().map_err(|error| error.to_string())?;
        if !(1..=self.planner.horizon).contains(&self.replan) {
            return Err(format!(
                "`replan` is {}, but a plan has {} steps; choose from 1 to that number",
                self.replan, self.planner.horizon
            ));
        }
        let Noise { position, velocity } = self.plant.noise;
        if !(position >= 0.0 && velocity >= 0.0) {
            return Err(
                "`plant.noise` holds standard deviations; they must not be negative".into(),
            );
        }
        check_readings("plant.noise", [position, velocity])?;
        if !(self.goal.hold_s >= 0.0) {
            return Err(format!(
                "`goal.hold_s` is {}; it must not be negative",
                self.goal.hold_s
            ));
        }
        let formulas = [
            ("objective", &self.objective),
            ("goal.formula", &self.goal.formula),
        ];
        for (name, formula) in formulas {
            Objective::new(formula, n).map_err(|error| format!("`{name}`: {error}"))?;
        }
        Ok(())
    }
}

fn text_of(name: &str) -> Option<&'static str> {
    BUILT_IN.get_file(format!("{name}.toml"))?.contents_utf8()
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::Task;

    #[test]
    fn every_embedded_task_is_sound() {
        for name in Task::names() {
            let task = Task::read(Path::new(name)).unwrap();
            assert_eq!(task.name(), name);
        }
        assert_eq!(
            Task::of_system("acrobot").unwrap().name(),
            "acrobot-swingup"
        );
        assert!(Task::of_system("drive").is_none());
    }

    #[test]
    fn mistakes_are_reported_with_their_remedy() {
        let text = super::text_of("pendulum").unwrap();
        let message = |from: &str, to: &str| {
            assert!(text.contains(from), "{from}");
            let broken = text.replace(from, to);
            Task::from_text(Path::new("t.toml"), &broken)
                .unwrap_err()
                .to_string()
        };
        assert_eq!(
            message("replan = 50", "replan = 81"),
            "t.toml: `replan` is 81, but a plan has 80 steps; choose from 1 to that number"
        );
        let unknown = message("objective = \"cos(q1)\"", "objective = \"cos(q2)\"");
        assert!(
            unknown.starts_with("t.toml: `objective`: ") && unknown.contains("q2"),
            "{unknown}"
        );
        let torque = message("torque = [[-3.0, 3.0]]", "torque = [[3.0, -3.0]]");
        assert!(
            torque.ends_with("`torque` has the range [3, -3]; write [lowest, highest]"),
            "{torque}"
        );
    }
}
