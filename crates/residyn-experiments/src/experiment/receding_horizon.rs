//! The ablation: models trained on the same plant, evaluated with increasing receding horizons.

use super::Session;

pub(super) const NAME: &str = "receding-horizon";

pub(super) fn check(session: &Session) -> Result<(), String> {
    let horizon = session.task.planner.horizon;
    match session.config.replan.as_slice() {
        [] => Err(format!(
            "{NAME} needs `replan`, the receding horizons to compare"
        )),
        some if some.iter().all(|steps| (1..=horizon).contains(steps)) => Ok(()),
        _ => Err(format!(
            "`replan` must list numbers from 1 to {horizon}, the steps of a plan"
        )),
    }
}
