use std::path::PathBuf;

use serde::{Deserialize, Serialize};

use super::folder::stretch;
use super::{EpisodeScore, Evaluator, Learner, RunError, transitions};
use residyn_control::control::{Driven, Predictor, RandomTorque, Task, drive, with_controller};
use residyn_core::data::Log;
use residyn_core::streams::{Purpose, stream};
use residyn_plants::{Beginning, Controlled, plant_seed};
use residyn_train::{HybridModel, Training};

/// How far a plant in another process may be from where it was when its motion is repeated, as a share of 1 or of the value:
/// a number is told in 17 digits.
const REPEATED: f64 = 1e-9;

/// The amounts of data, in transitions.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Schedule {
    /// Transitions under random torques, before the first training.
    pub random: usize,
    /// Transitions T under control between two trainings; must divide the steps of an episode of the task.
    pub gather: usize,
    /// Number of trainings.
    pub rounds: usize,
}

/// One run of the loop on one plant: everything that determines its results.
pub struct Run<'a> {
    pub task: &'a Task,
    pub plant: &'a Controlled,
    pub learner: &'a Learner,
    pub schedule: Schedule,
    pub seed: u64,
    /// Where the recorded motion is kept: by a plant in another process, row by row.
    pub folder: PathBuf,
}

/// The state of a run between two rounds.
#[derive(Debug, Clone, Default)]
pub struct RunState {
    /// The recorded motion: one log for each stretch, the first one under random torques.
    pub logs: Vec<Log>,
    /// The model after the last round; none before the first.
    pub model: Option<HybridModel>,
    /// Rounds done.
    pub rounds: usize,
}

/// The results of a round: one line of `rounds.jsonl`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Round {
    /// Counted from 0.
    pub round: usize,
    /// Number of real transitions that the model was trained on.
    pub transitions: usize,
    #[serde(flatten)]
    pub score: EpisodeScore,
    /// Prediction error on these transitions after training: mean of ||s' - s_hat'||^2.
    pub error: f64,
    /// ||F_r||
    pub residual_norm: f64,
    /// Names and values of the physical parameters.
    pub parameters: Vec<(String, f64)>,
}

impl Run<'_> {
    /// Gathers data under random torques, before the first round.
    ///
    /// # Errors
    /// A plant that diverges or no longer answers.
    pub fn begin(&self) -> Result<RunState, RunError> {
        let mut random = RandomTorque::new(self.task, stream(self.seed, Purpose::Random(0)));
        let log = self.stretch(0, 0, |plant| {
            Ok(drive(plant, &mut random, self.schedule.random)?.log)
        })?;
        Ok(RunState {
            logs: vec![log],
            ..RunState::default()
        })
    }

    /// Carries out a round: train, evaluate, gather.
    ///
    /// # Errors
    /// A loss that is not finite, a plant that diverges or no longer answers, and a stretch in which the
    /// candidates of all plans diverge.
    pub fn round(&self, state: &mut RunState) -> Result<(Round, Training), RunError> {
        let (round, seed) = (state.rounds, self.seed);
        let segments = transitions(&state.logs, self.task.joints())?;
        let previous = state.model.as_ref();
        let training = self.learner.learn(&segments, previous, seed, round)?;
        let model = training.result()?;
        let predictor = model.predictor(self.learner.fit.integrator);
        let score = self.evaluator().score(&predictor, self.task.replan)?;
        let last = training.history().last().expect("a run records its end");
        let record = Round {
            round,
            transitions: segments.len(),
            score,
            error: last.error,
            residual_norm: last.residual_norm,
            parameters: model.parameters(),
        };
        let gathered = self.gather(&predictor, state)?;
        state.logs.push(gathered);
        state.model = Some(model);
        state.rounds += 1;
        Ok((record, training))
    }

    fn evaluator(&self) -> Evaluator<'_> {
        Evaluator {
            task: self.task,
            plant: self.plant,
            seed: self.seed,
        }
    }

    /// The next stretch of the episode, or the first of the next one.
    fn gather(&self, predictor: &Predictor, state: &RunState) -> Result<Log, RunError> {
        let of_episode = self.task.steps / self.schedule.gather;
        let (episode, begun) = (state.rounds / of_episode, state.rounds % of_episode);
        let before = &state.logs[state.logs.len() - begun..];
        let plans = stream(self.seed, Purpose::GatherPlan(state.rounds + 1));
        let predictor = &predictor.clone().acting_after(self.plant.latency());
        self.stretch(1 + episode, state.rounds + 1, |plant| {
            self.repeat(plant, before)?;
            with_controller(
                predictor,
                self.task,
                self.task.replan,
                &plans,
                |controller| {
                    let stretch = drive(plant, controller, self.schedule.gather)?;
                    controller.check()?;
                    Ok(stretch.log)
                },
            )
        })
    }

    /// Bring a plant at the beginning of an episode to the end of its last stretch.
    fn repeat(&self, plant: &mut dyn Driven, before: &[Log]) -> Result<(), RunError> {
        for log in before {
            for row in 0..log.rows() - 1 {
                let held: Vec<f64> = log.tau.iter().map(|tau| tau[row]).collect();
                plant.step(&held, &[])?;
            }
        }
        let Some(last) = before.last().filter(|_| self.plant.description().is_some()) else {
            return Ok(());
        };
        let ended = last
            .q
            .iter()
            .chain(&last.qd)
            .map(|column| column[last.rows() - 1]);
        let mut apart = plant.state().iter().zip(ended);
        match apart.all(|(now, then)| (now - then).abs() <= REPEATED * (1.0 + then.abs())) {
            true => Ok(()),
            false => Err(RunError::NotRepeated),
        }
    }

    /// What `act` records in an episode of this number, as the stretch of this number.
    fn stretch(
        &self,
        episode: usize,
        number: usize,
        act: impl FnOnce(&mut dyn Driven) -> Result<Log, RunError>,
    ) -> Result<Log, RunError> {
        let mut draws = stream(self.seed, Purpose::Start(episode));
        let start = self.task.draw_start(&mut draws);
        let beginning = Beginning {
            task: self.task,
            start: &start,
            noise: stream(self.seed, Purpose::Gather(number)),
            seed: plant_seed(&draws),
            log: Some(&stretch(&self.folder, number)),
        };
        self.plant.during(beginning, act)
    }
}
