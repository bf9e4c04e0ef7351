use rand::Rng;
use thiserror::Error;

use super::{Policy, Task};
use crate::plan::Objective;
use residyn_core::data::Log;
use residyn_core::plant::{PlantError, Rig};

/// Consecutive steps of a rig under a policy.
#[derive(Debug, Clone, PartialEq)]
pub struct Stretch {
    /// Sensor readings and commands: one row per step, and one for the state after the last step.
    pub log: Log,
    /// The true state of each row: positions, then velocities.
    pub states: Vec<Vec<f64>>,
}

/// A whole episode of a task.
#[derive(Debug, Clone, PartialEq)]
pub struct Episode {
    pub stretch: Stretch,
    /// The reward of each step.
    pub rewards: Vec<f64>,
    /// Whether the goal held to the end.
    pub success: bool,
}

/// Why an episode has no return.
#[derive(Debug, Error)]
pub enum EpisodeError {
    #[error("{0}")]
    Rig(#[from] PlantError),
    #[error(
        "the {what} of the task is {value} in the state at {time_s:.3} s, {state:?}; give a formula that is finite there"
    )]
    Formula {
        what: &'static str,
        value: f64,
        time_s: f64,
        state: Vec<f64>,
    },
}

/// Drive the rig by `policy` for `steps` steps.
///
/// # Errors
/// A rig that diverges.
pub fn drive(
    rig: &mut Rig<'_>,
    policy: &mut dyn Policy,
    steps: usize,
    rng: &mut impl Rng,
) -> Result<Stretch, PlantError> {
    let mut stretch = Stretch {
        log: rig.empty_log(),
        states: Vec::new(),
    };
    for _ in 0..steps {
        let (measured, time_s) = (rig.measure(rng), rig.time_s());
        let tau = policy.torque(&measured, time_s);
        stretch.push(rig, &measured, &tau);
        rig.step(&tau)?;
    }
    // No command in the last row.
    let (measured, idle) = (rig.measure(rng), vec![0.0; stretch.log.joints()]);
    stretch.push(rig, &measured, &idle);
    Ok(stretch)
}

/// A whole episode of `task` from the rig's current state.
///
/// # Errors
/// A rig that diverges, and a reward or goal that is not finite.
pub fn episode(
    task: &Task,
    rig: &mut Rig<'_>,
    policy: &mut dyn Policy,
    rng: &mut impl Rng,
) -> Result<Episode, EpisodeError> {
    let stretch = drive(rig, policy, task.steps, rng)?;
    let rewards = stretch.values("objective", &task.objective())?;
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // saturates
    let held = (task.goal.hold_s / task.step_s).round() as usize;
    let goal = stretch.values("goal", &task.goal_formula())?;
    let last = &goal[goal.len().saturating_sub(held)..];
    Ok(Episode {
        success: last.iter().all(|value| *value >= task.goal.at_least),
        rewards,
        stretch,
    })
}

impl Stretch {
    fn push(&mut self, rig: &Rig<'_>, measured: &[f64], tau: &[f64]) {
        let log = &mut self.log;
        log.time.push(rig.time_s());
        let channels = log.q.iter_mut().chain(&mut log.qd).chain(&mut log.tau);
        for (channel, value) in channels.zip(measured.iter().chain(tau)) {
            channel.push(*value);
        }
        self.states.push(rig.state().to_vec());
    }

    /// The values of a formula after each step.
    fn values(&self, what: &'static str, formula: &Objective) -> Result<Vec<f64>, EpisodeError> {
        let steps = self.states.iter().enumerate().skip(1);
        let after = |(row, state): (usize, &Vec<f64>)| {
            let held: Vec<f64> = self.log.tau.iter().map(|tau| tau[row - 1]).collect();
            let time_s = self.log.time[row];
            let value = formula.value(state, &held, time_s);
            match value.is_finite() {
                true => Ok(value),
                false => Err(EpisodeError::Formula {
                    what,
                    value,
                    time_s,
                    state: state.clone(),
                }),
            }
        };
        steps.map(after).collect()
    }
}

impl Episode {
    /// The sum of rewards.
    pub fn total(&self) -> f64 {
        self.rewards.iter().sum()
    }
}
