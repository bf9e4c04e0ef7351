use rand_chacha::ChaCha8Rng;

use super::{Controller, Predictor, Task};
use crate::plan::Planner;

/// Run `lead` with a controller that plans with `predictor` for `task`, replanning after `replan` steps, on all cores.
/// `rng` draws the candidates.
///
/// # Panics
/// When `predictor` has a different number of joints from the task.
pub fn with_controller<R>(
    predictor: &Predictor,
    task: &Task,
    replan: usize,
    rng: &ChaCha8Rng,
    lead: impl FnOnce(&mut Controller<'_, '_>) -> R,
) -> R {
    let rollouts = predictor.rollouts(&task.objective(), task.step_s);
    let rollouts = match task.bounds.excess(task.joints()) {
        Some(excess) => rollouts.within(excess.program()),
        None => rollouts,
    };
    let planner = Planner::new(&task.planner, &task.torque, || rollouts.block(), rng);
    let observer = predictor.observer(task.step_s);
    planner.with_workers(|| lead(&mut Controller::new(&planner, &rollouts, observer, replan)))
}
