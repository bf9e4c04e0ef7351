//! Stage 10: what the logs can show: how often the search names an absent effect, and how small an effect it would
//! name.

mod detection_limit;
mod simulated_logs;
#[cfg(test)]
mod tests;

pub use self::detection_limit::{DetectionLimit, Smallest};

use rand::{Rng, RngExt};
use serde::{Deserialize, Serialize};

use self::detection_limit::detection_limits;
use self::simulated_logs::SimulatedLogs;
use super::error::StudyError;
use super::error_model::ErrorModel;
use super::fitted::Fitted;
use super::pipeline::find;
use super::problem::Problem;
use super::stage::{Stage, Watch};
use crate::data::Joint;
use crate::data::statistics::wilson;
use crate::model::{FittedEffect, Model};
use crate::streams::{Purpose, stream};

/// The results of the search on logs simulated from the accepted model, with the torques and the noise of the user's
/// logs.
#[derive(Debug, Clone, PartialEq)]
pub struct Calibration {
    /// What was named in each simulation of the accepted model: every one a false alarm.
    pub named: Vec<Vec<Named>>,
    /// Number of these simulations with a significant unexplained residual.
    pub unexplained: usize,
    pub limits: Vec<DetectionLimit>,
    /// Effects were hidden at this multiple of their smallest size.
    pub hidden: f64,
    /// The largest torque of each joint in the training logs.
    pub top_torque: Vec<f64>,
}

/// Effects that are hidden: those that most rigs have.
const COMMON: [&str; 4] = [
    "viscous_friction",
    "coulomb_friction",
    "constant_torque",
    "actuator_gain",
];

impl Calibration {
    /// Simulations in which something was named.
    pub fn alarms(&self) -> usize {
        self.named.iter().filter(|named| !named.is_empty()).count()
    }

    /// Share of simulations in which something was named.
    pub fn rate(&self) -> f64 {
        self.alarms() as f64 / self.named.len().max(1) as f64
    }

    /// 95 % interval of that share.
    pub fn rate_ci95(&self) -> [f64; 2] {
        wilson(self.alarms(), self.named.len())
    }
}

/// The effect to hide, if it is one of the common ones.
fn hidden(limit: &DetectionLimit, multiple: f64) -> Option<FittedEffect> {
    let Smallest::Detectable { switch, values } = &limit.smallest else {
        return None;
    };
    let mut hidden = limit.effect.clone();
    hidden.values = values.iter().map(|value| (*value, None)).collect();
    hidden.values[*switch].0 *= multiple;
    let is_common = COMMON.contains(&hidden.effect.name.as_str());
    is_common.then_some(hidden)
}

/// An effect that the search established.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Named {
    pub name: String,
    pub joint: Joint,
}

impl Named {
    /// An effect by its name.
    pub fn of(effect: &FittedEffect) -> Self {
        Self {
            name: effect.effect.name.clone(),
            joint: effect.joint,
        }
    }
}

/// One set of simulated logs to be searched. Its random draws depend only on the calibration's seed and its number, so
/// that simulations may be searched in any order, and in several sessions.
#[derive(Debug, Clone)]
pub struct Simulation {
    number: usize,
    seed: u64,
    /// The effect hidden in it; `None` in a simulation of the accepted model itself.
    hidden: Option<FittedEffect>,
}

impl Simulation {
    /// Distinguishes it from all other simulations, in any calibration of one model on one set of logs.
    pub fn key(&self) -> String {
        format!("{:016x} {}: {}", self.seed, self.number, self.about())
    }

    /// A description for people.
    pub fn about(&self) -> String {
        match &self.hidden {
            None => format!("simulation {} of the accepted model", self.number + 1),
            Some(effect) => format!("simulation with {}", effect.label()),
        }
    }
}

/// The result of the search on a simulation.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Searched {
    pub named: Vec<Named>,
    /// Whether a significant residual was left unexplained.
    pub unexplained: bool,
}

/// Simulations of a model that [`find`] accepted, each to be searched like the user's logs, and the conclusions.
pub struct Calibrator<'a> {
    problem: &'a Problem<'a>,
    /// Whatever is named beyond the accepted model is a false alarm.
    declared: Model,
    simulated: SimulatedLogs<'a>,
    limits: Vec<DetectionLimit>,
    simulations: Vec<Simulation>,
}

impl<'a> Calibrator<'a> {
    /// Plan `runs` simulations of the accepted model, and one for each common effect that is hidden.
    ///
    /// # Errors
    /// A problem that compares torques; and as [`Problem::fit_declared`].
    pub fn new(
        problem: &'a Problem<'a>,
        accepted: &'a Fitted,
        runs: usize,
        rng: &mut impl Rng,
    ) -> Result<Self, StudyError> {
        if problem.error_model == ErrorModel::InverseDynamics {
            return Err(StudyError::NotOfMotion);
        }
        let limits = detection_limits(problem, accepted)?;
        let multiple = problem.settings.calibrate.hidden_multiple;
        let common = limits.iter().filter_map(|limit| hidden(limit, multiple));
        let all = std::iter::repeat_n(None, runs).chain(common.map(Some));
        let seed = rng.random();
        let simulation = |(number, hidden)| Simulation {
            number,
            seed,
            hidden,
        };
        Ok(Self {
            problem,
            declared: accepted.model.clone(),
            simulated: SimulatedLogs::new(problem, accepted)?,
            simulations: all.enumerate().map(simulation).collect(),
            limits,
        })
    }

    /// All simulations, in order.
    pub fn simulations(&self) -> &[Simulation] {
        &self.simulations
    }

    /// Simulate, and search the result; `None` if the motion diverges with the hidden effect.
    ///
    /// # Errors
    /// As [`Problem::fit_declared`].
    pub fn search(
        &self,
        simulation: &Simulation,
        watch: &dyn Watch,
    ) -> Result<Option<Searched>, StudyError> {
        let mut rng = stream(simulation.seed, Purpose::Other(simulation.number));
        let hidden = simulation.hidden.as_slice();
        let Some(logs) = self.simulated.draw(hidden, &mut rng) else {
            let is_accepted = simulation.hidden.is_none();
            assert!(!is_accepted, "it was fitted to these windows");
            return Ok(None);
        };
        let problem = Problem {
            declared: &self.declared,
            ..self.problem.on(&logs)
        };
        watch.see(Stage::Fit.into());
        let found = find(problem.fit_declared()?, &[], &mut rng, watch)?;
        Ok(Some(Searched {
            named: found.chosen.named().map(Named::of).collect(),
            unexplained: found.unexplained.is_significant(),
        }))
    }

    /// What follows from the searches of all simulations, in their order.
    pub fn conclude(mut self, searched: Vec<Option<Searched>>) -> Calibration {
        let (mut named, mut unexplained) = (Vec::new(), 0);
        for (simulation, searched) in self.simulations.iter().zip(searched) {
            match (&simulation.hidden, searched) {
                (None, Some(searched)) => {
                    unexplained += usize::from(searched.unexplained);
                    named.push(searched.named);
                }
                (Some(effect), Some(searched)) => {
                    let mut limits = self.limits.iter_mut();
                    let limit = limits.find(|limit| limit.effect.is_same(effect));
                    limit.expect("each comes from a limit").named = Some(searched.named);
                }
                (_, None) => {}
            }
        }
        Calibration {
            named,
            unexplained,
            limits: self.limits,
            hidden: self.problem.settings.calibrate.hidden_multiple,
            top_torque: self.problem.top_torque.clone(),
        }
    }
}
