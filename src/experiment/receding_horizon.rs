//! The ablation: models trained on the same plant, evaluated with increasing receding horizons.

use super::learning::TrainedMethod;
use super::results::{Course, Results};
use super::{ExperimentError, Session};
use crate::control::Predictor;

pub(super) const NAME: &str = "receding-horizon";

pub(super) fn check(session: &Session) -> Result<(), String> {
    let horizon = session.task.planner.horizon;
    match session.config.replan.as_slice() {
        [] => Err(format!(
            "{NAME} needs `replan`, the receding horizons to compare"
        )),
        some if some.iter().all(|steps| (1..=horizon).contains(steps)) => Ok(()),
        _ => Err(format!(
            "`replan` lists numbers from 1 to {horizon}, the steps of a plan"
        )),
    }
}

/// Evaluates the trained models with every receding horizon.
pub(super) fn compare(
    session: &Session,
    learnt: &[Vec<TrainedMethod>],
    results: &mut Results,
) -> Result<(), ExperimentError> {
    results.receding_horizon = Some(session.config.replan.clone());
    let over_horizons = |predictor: &(dyn Fn(usize) -> Predictor + Sync), seen, name: &str| {
        let each = session.config.replan.iter();
        each.map(|replan| Ok((seen, session.score_all(predictor, *replan, name)?)))
            .collect::<Result<Course, ExperimentError>>()
    };
    for (method, runs) in session.methods.iter().zip(learnt) {
        let name = &method.config.name;
        let seen = runs[0].rounds.last().map_or(0, |round| round.transitions);
        let course = over_horizons(&|k| method.predictor(&runs[k].model), seen, name)?;
        results.methods.insert(name.clone(), course);
    }
    for (name, predictor) in session.fixed()? {
        let course = over_horizons(&|_| predictor.clone(), 0, name)?;
        results.methods.insert(name.to_owned(), course);
    }
    Ok(())
}
