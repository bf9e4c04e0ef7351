use thiserror::Error;

use super::{DriveError, Driven, Policy, Task};
use crate::plan::Objective;
use residyn_core::data::Log;

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
    Drive(#[from] DriveError),
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

/// Drive a plant by `policy` for `steps` steps.
///
/// # Errors
/// As [`Driven::step`].
pub fn drive(
    plant: &mut dyn Driven,
    policy: &mut dyn Policy,
    steps: usize,
) -> Result<Stretch, DriveError> {
    let mut stretch = Stretch {
        log: plant.empty_log(),
        states: Vec::new(),
    };
    for _ in 0..steps {
        let row = Row::of(plant);
        let command = policy.torque(&row.measured, row.time_s);
        let held = plant.step(&command.unwrap_or_else(|| plant.safe()), &policy.ahead())?;
        policy.held(&held.steps);
        stretch.push(row, &held.sent);
    }
    // No command in the last row.
    let (row, idle) = (Row::of(plant), vec![0.0; stretch.log.joints()]);
    stretch.push(row, &idle);
    Ok(stretch)
}

/// A whole episode of `task` from the plant's current state.
///
/// # Errors
/// As [`Driven::step`], and a reward or goal that is not finite.
pub fn episode(
    task: &Task,
    plant: &mut dyn Driven,
    policy: &mut dyn Policy,
) -> Result<Episode, EpisodeError> {
    let stretch = drive(plant, policy, task.steps)?;
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

/// A plant at the beginning of a step.
struct Row {
    time_s: f64,
    measured: Vec<f64>,
    state: Vec<f64>,
}

impl Row {
    fn of(plant: &mut dyn Driven) -> Self {
        Self {
            measured: plant.measure(),
            time_s: plant.time_s(),
            state: plant.state().to_vec(),
        }
    }
}

impl Stretch {
    fn push(&mut self, row: Row, tau: &[f64]) {
        let log = &mut self.log;
        log.time.push(row.time_s);
        let channels = log.q.iter_mut().chain(&mut log.qd).chain(&mut log.tau);
        for (channel, value) in channels.zip(row.measured.iter().chain(tau)) {
            channel.push(*value);
        }
        self.states.push(row.state);
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
