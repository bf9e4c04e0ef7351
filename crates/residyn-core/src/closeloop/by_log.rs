//! The chosen model fitted to each training log alone: on which values the logs agree, and how well the fit to one log
//! predicts the others.

use std::slice::from_ref;

use rayon::prelude::*;

use super::fitted::Fitted;
use super::problem::Problem;
use super::refine::with_intervals;
use super::score::Scorer;
use super::stage::Watch;
use crate::data::Log;
use crate::identify::{FitError, uncertainty};

/// The chosen model, fitted to one training log alone.
pub struct OfLog {
    pub log: String,
    /// With 95 % intervals.
    pub fitted: Result<Fitted, FitError>,
    /// The compared error on each training log, in order; empty if the fit failed or there are too many logs.
    pub errors: Vec<f64>,
}

impl Problem<'_> {
    /// The chosen model fitted log by log; empty for a single log.
    pub(super) fn by_log(&self, chosen: &Fitted, watch: &dyn Watch) -> Vec<OfLog> {
        let most = self.settings.score.most_logs_fitted_alone;
        if !(2..=most).contains(&self.logs.len()) || watch.has_to_end() {
            return Vec::new();
        }
        let of_log = |log: &Log| {
            let fitted = self.fitted_to(log, chosen);
            OfLog {
                log: log.name(),
                errors: (fitted.as_ref()).map_or_else(|_| Vec::new(), |f| self.crossed(f)),
                fitted,
            }
        };
        self.logs.par_iter().map(of_log).collect()
    }

    fn fitted_to(&self, log: &Log, chosen: &Fitted) -> Result<Fitted, FitError> {
        let problem = Problem {
            held: self.identifiability.hold.clone(),
            ..self.on(from_ref(log))
        };
        let start_states = problem.shooting.initial_start_states(0);
        let mut fitted = problem.refit(&chosen.model, start_states, None)?;
        let uncertainty = uncertainty(&problem.shooting, &fitted.fit);
        fitted.model = with_intervals(&problem, &fitted, &uncertainty, &fitted.model);
        Ok(fitted)
    }

    fn crossed(&self, fitted: &Fitted) -> Vec<f64> {
        let logs = match self.logs.len() > self.settings.score.most_logs_crossed {
            true => &[],
            false => self.logs,
        };
        let error = |log| {
            let scorer = Scorer {
                test: from_ref(log),
                settings: &self.settings.score,
            };
            scorer.compared(self.error_model, fitted)
        };
        logs.iter().map(error).collect()
    }
}
