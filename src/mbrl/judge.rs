use serde::{Deserialize, Serialize};

use super::RunError;
use crate::control::{Episode, Predictor, Purpose, Task, episode, stream, with_controller};
use crate::plant::Plant;

/// Lets models drive a plant in episodes that are not learnt from. Start, noise and draws of candidates are the same for
/// every model, so that models alone make the difference.
#[derive(Debug, Clone, Copy)]
pub struct Judge<'a> {
    pub task: &'a Task,
    pub plant: &'a Plant,
    pub seed: u64,
}

/// How an episode went that is not learnt from.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Judged {
    /// The sum of rewards.
    #[serde(rename = "return")]
    pub total: f64,
    /// Whether the goal held until the end.
    pub success: bool,
    /// Candidates of all plans whose rollout diverged.
    pub diverged: usize,
}

impl Judge<'_> {
    /// How an episode goes with a model, under plans that are new after `replan` steps.
    ///
    /// # Errors
    /// A plant that diverges.
    pub fn judge(&self, predictor: &Predictor, replan: usize) -> Result<Judged, RunError> {
        let (episode, diverged) = self.episode(predictor, replan)?;
        Ok(Judged {
            total: episode.total(),
            success: episode.success,
            diverged,
        })
    }

    /// The same in full, and how many candidates diverged.
    ///
    /// # Errors
    /// A plant that diverges.
    pub fn episode(
        &self,
        predictor: &Predictor,
        replan: usize,
    ) -> Result<(Episode, usize), RunError> {
        let dynamics = self.plant.true_dynamics();
        let mut rng = stream(self.seed, Purpose::Judge, 0);
        let start = self.task.draw_start(&mut rng);
        let mut rig = self.task.rig(self.plant, &dynamics, &start);
        let draws = stream(self.seed, Purpose::JudgePlan, 0);
        with_controller(predictor, self.task, replan, &draws, |controller| {
            let episode = episode(self.task, &mut rig, controller, &mut rng)?;
            Ok((episode, controller.diverged()))
        })
    }
}
