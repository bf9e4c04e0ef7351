use std::path::PathBuf;

use serde::{Deserialize, Serialize};

use residyn_core::plant::{Sampling, Starts};
use residyn_core::sim::Integrator;

/// The data that a model is trained on.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "Keys", untagged)]
pub enum Data {
    Logged(Logged),
    Simulated(Simulated),
}

/// Logs of a rig. States are estimated by smoothing the logged positions.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Logged {
    pub logs: Vec<PathBuf>,
    /// Rows closer together than this are merged, s.
    pub step_s: f64,
    /// Number of steps that the loss unrolls.
    pub steps: usize,
}

/// Random trajectories of a simulated plant, with exact states.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Simulated {
    /// A plant or model file, or the name of a built-in system.
    pub plant: PathBuf,
    #[serde(flatten)]
    pub sampling: Sampling,
    /// Number of steps that the loss unrolls.
    pub steps: usize,
}

/// All keys of `[data]`, before they are split into the keys for logs and for a plant.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Keys {
    logs: Option<Vec<PathBuf>>,
    plant: Option<PathBuf>,
    steps: Option<usize>,
    step_s: Option<f64>,
    trajectories: Option<usize>,
    length: Option<usize>,
    integrator: Option<Integrator>,
    position: Option<Vec<[f64; 2]>>,
    velocity: Option<Vec<[f64; 2]>>,
    #[serde(alias = "command")]
    torque: Option<Vec<[f64; 2]>>,
    starts: Option<Starts>,
}

impl Logged {
    /// Settings for logs of desk-sized rigs: a step of 10 ms is short compared with the motion, and eight steps show
    /// what encoder noise hides in one.
    pub fn usual(logs: Vec<PathBuf>) -> Self {
        Self {
            logs,
            step_s: 0.01,
            steps: 8,
        }
    }
}

impl TryFrom<Keys> for Data {
    type Error = String;

    fn try_from(keys: Keys) -> Result<Self, String> {
        if keys.steps == Some(0) {
            return Err("`steps` must be at least 1".into());
        }
        match (&keys.logs, &keys.plant) {
            (Some(_), Some(_)) => Err(
                "[data] has both `logs` and `plant`; keep the one to train on and remove the other"
                    .into(),
            ),
            (None, None) => Err(
                "[data] has neither `logs` (log files) nor `plant` (a simulated rig); give one"
                    .into(),
            ),
            (Some(_), None) => keys.logged().map(Self::Logged),
            (None, Some(_)) => keys.simulated().map(Self::Simulated),
        }
    }
}

impl Keys {
    fn logged(self) -> Result<Logged, String> {
        let foreign = [
            ("trajectories", self.trajectories.is_some()),
            ("length", self.length.is_some()),
            ("integrator", self.integrator.is_some()),
            ("position", self.position.is_some()),
            ("velocity", self.velocity.is_some()),
            ("torque", self.torque.is_some()),
            ("starts", self.starts.is_some()),
        ];
        if let Some((name, _)) = foreign.iter().find(|(_, given)| *given) {
            return Err(format!(
                "`{name}` belongs to a simulated plant, but [data] has `logs`; remove it"
            ));
        }
        let logs = self.logs.unwrap_or_default();
        if logs.is_empty() {
            return Err("`logs` is empty; name at least one log".into());
        }
        let usual = Logged::usual(logs);
        let step_s = self.step_s.unwrap_or(usual.step_s);
        if !(step_s > 0.0 && step_s.is_finite()) {
            return Err(format!("`step_s` is {step_s}; it must be above zero"));
        }
        Ok(Logged {
            step_s,
            steps: self.steps.unwrap_or(usual.steps),
            ..usual
        })
    }

    fn simulated(self) -> Result<Simulated, String> {
        let length = self.length.unwrap_or(1);
        let steps = self.steps.unwrap_or(1);
        if steps > length {
            return Err(format!(
                "`steps` is {steps}, but trajectories have a `length` of {length} steps; lower the one \
                 or raise the other"
            ));
        }
        Ok(Simulated {
            sampling: Sampling {
                trajectories: required("trajectories", self.trajectories)?,
                length,
                step_s: required("step_s", self.step_s)?,
                integrator: self.integrator.unwrap_or_default(),
                position: required("position", self.position)?,
                velocity: required("velocity", self.velocity)?,
                torque: required("torque", self.torque)?,
                starts: self.starts.unwrap_or_default(),
            },
            plant: required("plant", self.plant)?,
            steps,
        })
    }
}

fn required<T>(name: &str, value: Option<T>) -> Result<T, String> {
    value.ok_or_else(|| format!("[data] with a `plant` needs `{name}`"))
}
