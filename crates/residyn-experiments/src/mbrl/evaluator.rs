use serde::{Deserialize, Serialize};

use super::RunError;
use residyn_control::control::{Controller, Episode, Predictor, Task, episode, with_controller};
use residyn_core::streams::{Purpose, stream};
use residyn_plants::{Beginning, Controlled, plant_seed};

/// Evaluates models as controllers, in episodes that are not used for training. Initial state, sensor noise and the
/// planner's random numbers are the same for every model, so that results differ by the model alone.
#[derive(Clone, Copy)]
pub struct Evaluator<'a> {
    pub task: &'a Task,
    pub plant: &'a Controlled,
    pub seed: u64,
}

/// The result of an evaluation episode.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct EpisodeScore {
    /// The sum of rewards.
    #[serde(rename = "return")]
    pub total: f64,
    /// Whether the goal was held until the end.
    pub success: bool,
    /// Number of candidate plans whose rollout diverged.
    pub diverged: usize,
    /// Number of plans whose candidates all diverged: the plant held its safe command.
    #[serde(default)]
    pub lost: usize,
}

impl Evaluator<'_> {
    /// Evaluates a model in an episode, planning anew every `replan` steps.
    ///
    /// # Errors
    /// A plant that diverges or no longer answers, and an episode in which the candidates of all plans diverge.
    pub fn score(&self, predictor: &Predictor, replan: usize) -> Result<EpisodeScore, RunError> {
        self.drive(predictor, replan, |episode, controller| EpisodeScore {
            total: episode.total(),
            success: episode.success,
            diverged: controller.diverged(),
            lost: controller.lost().len(),
        })
    }

    /// The whole episode.
    ///
    /// # Errors
    /// As [`Evaluator::score`].
    pub fn episode(&self, predictor: &Predictor, replan: usize) -> Result<Episode, RunError> {
        self.drive(predictor, replan, |episode, _| episode)
    }

    fn drive<T>(
        &self,
        predictor: &Predictor,
        replan: usize,
        tell: impl FnOnce(Episode, &Controller<'_, '_>) -> T,
    ) -> Result<T, RunError> {
        let mut noise = stream(self.seed, Purpose::Judge(0));
        let start = self.task.draw_start(&mut noise);
        let beginning = Beginning {
            task: self.task,
            start: &start,
            seed: plant_seed(&noise),
            noise,
            log: None,
        };
        let plans = stream(self.seed, Purpose::JudgePlan(0));
        let predictor = &predictor.clone().acting_after(self.plant.latency());
        self.plant.during(beginning, |plant| {
            with_controller(predictor, self.task, replan, &plans, |controller| {
                let episode = episode(self.task, plant, controller)?;
                controller.check()?;
                Ok(tell(episode, controller))
            })
        })
    }
}
