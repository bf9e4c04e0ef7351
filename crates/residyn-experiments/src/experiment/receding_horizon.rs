//! The ablation: models trained on the same plant, evaluated with increasing receding horizons.

use super::{Experiment, Session};

pub(super) const EXPERIMENT: Experiment = Experiment {
    name: "receding-horizon",
    check,
    horizons: |session| Some(&session.config.replan),
};

fn check(session: &Session) -> Result<(), String> {
    let horizon = session.task.planner.horizon;
    match session.config.replan.as_slice() {
        [] => Err("receding-horizon needs `replan`, the receding horizons to compare".to_owned()),
        some if some.iter().all(|steps| (1..=horizon).contains(steps)) => Ok(()),
        _ => Err(format!(
            "`replan` must list numbers from 1 to {horizon}, the steps of a plan"
        )),
    }
}
