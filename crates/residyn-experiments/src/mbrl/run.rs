use serde::{Deserialize, Serialize};

use super::{EpisodeScore, Evaluator, Learner, RunError, transitions};
use residyn_control::control::{Predictor, RandomTorque, Simulated, Task, drive, with_controller};
use residyn_core::data::Log;
use residyn_core::model::Dynamics;
use residyn_core::plant::{Plant, Rig};
use residyn_core::streams::{Purpose, stream};
use residyn_train::{HybridModel, Training};

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
    pub plant: &'a Plant,
    pub learner: &'a Learner,
    pub schedule: Schedule,
    pub seed: u64,
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
    /// A plant that diverges.
    pub fn begin(&self) -> Result<RunState, RunError> {
        let dynamics = self.plant.dynamics();
        let mut rig = self.rig(&dynamics, 0);
        let mut random = RandomTorque::new(self.task, stream(self.seed, Purpose::Random(0)));
        let mut noise = stream(self.seed, Purpose::Gather(0));
        let mut plant = Simulated {
            rig: &mut rig,
            noise: &mut noise,
        };
        let stretch = drive(&mut plant, &mut random, self.schedule.random)?;
        Ok(RunState {
            logs: vec![stretch.log],
            ..RunState::default()
        })
    }

    /// Carries out a round: train, evaluate, gather.
    ///
    /// # Errors
    /// A loss that is not finite, a plant that diverges, and a plan whose candidates all diverge.
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

    fn gather(&self, predictor: &Predictor, state: &RunState) -> Result<Log, RunError> {
        let dynamics = self.plant.dynamics();
        let mut rig = self.rig_now(&dynamics, state)?;
        let of_round = |purpose: fn(usize) -> Purpose| stream(self.seed, purpose(state.rounds + 1));
        let (mut noise, draws) = (of_round(Purpose::Gather), of_round(Purpose::GatherPlan));
        let steps = self.schedule.gather;
        with_controller(
            predictor,
            self.task,
            self.task.replan,
            &draws,
            |controller| {
                let mut plant = Simulated {
                    rig: &mut rig,
                    noise: &mut noise,
                };
                let stretch = drive(&mut plant, controller, steps)?;
                controller.check()?;
                Ok(stretch.log)
            },
        )
    }

    /// The plant in the state at the end of the last stretch under control, restored by replaying the torques of the
    /// episode so far. After the end of an episode, the plant in a new initial state.
    fn rig_now<'d>(&self, dynamics: &'d Dynamics, state: &RunState) -> Result<Rig<'d>, RunError> {
        let of_episode = self.task.steps / self.schedule.gather;
        let (episode, begun) = (state.rounds / of_episode, state.rounds % of_episode);
        let mut rig = self.rig(dynamics, 1 + episode);
        let controlled = &state.logs[1..];
        for log in &controlled[controlled.len() - begun..] {
            for row in 0..log.rows() - 1 {
                let held: Vec<f64> = log.tau.iter().map(|tau| tau[row]).collect();
                rig.step(&held)?;
            }
        }
        Ok(rig)
    }

    fn rig<'d>(&self, dynamics: &'d Dynamics, number: usize) -> Rig<'d> {
        let mut rng = stream(self.seed, Purpose::Start(number));
        let start = self.task.draw_start(&mut rng);
        self.task.rig(self.plant, dynamics, &start)
    }
}
