use serde::{Deserialize, Serialize};

use super::RunError;
use residyn_control::control::{Episode, Predictor, Simulated, Task, episode, with_controller};
use residyn_core::plant::Plant;
use residyn_core::streams::{Purpose, stream};

/// Evaluates models as controllers, in episodes that are not used for training. Initial state, sensor noise and the
/// planner's random numbers are the same for every model, so that results differ by the model alone.
#[derive(Debug, Clone, Copy)]
pub struct Evaluator<'a> {
    pub task: &'a Task,
    pub plant: &'a Plant,
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
}

impl Evaluator<'_> {
    /// Evaluates a model in an episode, planning anew every `replan` steps.
    ///
    /// # Errors
    /// A plant that diverges, and a plan whose candidates all diverge.
    pub fn score(&self, predictor: &Predictor, replan: usize) -> Result<EpisodeScore, RunError> {
        let (episode, diverged) = self.episode(predictor, replan)?;
        Ok(EpisodeScore {
            total: episode.total(),
            success: episode.success,
            diverged,
        })
    }

    /// The whole episode, and the number of candidate plans that diverged.
    ///
    /// # Errors
    /// A plant that diverges, and a plan whose candidates all diverge.
    pub fn episode(
        &self,
        predictor: &Predictor,
        replan: usize,
    ) -> Result<(Episode, usize), RunError> {
        let dynamics = self.plant.dynamics();
        let mut rng = stream(self.seed, Purpose::Judge(0));
        let start = self.task.draw_start(&mut rng);
        let mut rig = self.task.rig(self.plant, &dynamics, &start);
        let draws = stream(self.seed, Purpose::JudgePlan(0));
        with_controller(predictor, self.task, replan, &draws, |controller| {
            let mut plant = Simulated {
                rig: &mut rig,
                noise: &mut rng,
            };
            let episode = episode(self.task, &mut plant, controller)?;
            controller.check()?;
            Ok((episode, controller.diverged()))
        })
    }
}
