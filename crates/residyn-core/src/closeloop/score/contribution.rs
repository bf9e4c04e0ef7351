use std::fmt::{self, Display, Formatter};

use rayon::prelude::*;

use super::errors::Scorer;
use crate::closeloop::establish::{Chosen, Standing};
use crate::closeloop::fitted::Fitted;
use crate::closeloop::problem::Problem;
use crate::closeloop::refine::Refined;
use crate::digits::amount_of;
use crate::identify::FitError;
use crate::model::{FittedEffect, Model, Parameter, PerLogValue, Status};

/// One effect that was added.
#[derive(Debug, Clone)]
pub struct Finding {
    pub effect: FittedEffect,
    pub expression: String,
    /// With intervals.
    pub parameters: Vec<Parameter>,
    /// For the parameters that switch the effect on or, for an effect without such a parameter, for the fall of the
    /// loss on left-out blocks. 1 if the refit without the effect, which this needs, fails.
    pub p_value: f64,
    /// Share of the compared error on the test logs that this effect alone removes, or why the refit without it failed.
    pub error_reduction: Result<f64, FitError>,
    /// Share of the loss of the motion under the commands that the effect removes, if the motion asked for it.
    pub motion_reduction: Option<f64>,
    pub status: Status,
    /// Why it is not established, in a sentence.
    pub reason: Option<String>,
}

impl Finding {
    /// The value of each parameter or, if it has one per log, its values in single logs.
    pub fn rows(&self) -> Vec<(Parameter, Option<&PerLogValue>)> {
        let of_parameter = |(k, parameter): (usize, &Parameter)| {
            if !parameter.per_log {
                return vec![(parameter.clone(), None)];
            }
            let own = self.effect.own.iter().filter(|own| own.parameter == k);
            own.map(|own| {
                let parameter = Parameter {
                    value: own.value,
                    ci95: own.ci95,
                    ..parameter.clone()
                };
                (parameter, Some(own))
            })
            .collect()
        };
        let all = self.parameters.iter().enumerate();
        all.flat_map(of_parameter).collect()
    }
}

/// `coulomb_friction on joint 1: F_c1 = 0.1598 N m (0.1593 to 0.1603)`
impl Display for Finding {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let values: Vec<String> = self.rows().iter().map(own_value).collect();
        write!(f, "{}: {}", self.effect.label(), values.join(", "))
    }
}

/// A value of a finding, with the log if it holds in one log only.
fn own_value((parameter, own): &(Parameter, Option<&PerLogValue>)) -> String {
    let amount = amount_of(parameter.value, parameter.ci95, &parameter.unit);
    let log = own.map_or_else(String::new, |own| format!(" in {}", own.log_name()));
    format!("{} = {amount}{log}", parameter.name)
}

/// The effects that were added to the declared model, each with what it contributes. `chosen` is the model before it was
/// refined, `with` the error of the refined one on the test logs.
pub(in crate::closeloop) fn findings(
    problem: &Problem<'_>,
    chosen: &Chosen,
    refined: &Refined<'_>,
    scorer: &Scorer<'_>,
) -> Vec<Finding> {
    let (chosen, standings) = (&chosen.after, &chosen.standings);
    let with = scorer.compared(problem.error_model, chosen);
    let added = problem.added(&refined.after.model);
    let finding = |(k, standing): (usize, &Standing)| {
        // Both in the coarse steps that effects were selected with.
        let less = &standing.without;
        let error = |less: &Fitted| scorer.compared(problem.error_model, less);
        let reduction = |less: &Fitted| 1.0 - with / error(less).max(f64::MIN_POSITIVE);
        let (expression, parameters) = described(problem.declared, &refined.after.model, k);
        Finding {
            effect: refined.after.model.effects[k].clone(),
            expression,
            parameters,
            p_value: refined.p_value(k).unwrap_or(standing.p_value),
            error_reduction: less.as_ref().map(reduction).map_err(Clone::clone),
            motion_reduction: standing.gain_by_motion,
            status: standing.status,
            reason: standing.reason.clone(),
        }
    };
    added.into_par_iter().zip(standings).map(finding).collect()
}

/// What the k-th effect of a model adds, and the parameters that it is reported with: for a shift, the shifted
/// parameter.
fn described(declared: &Model, model: &Model, k: usize) -> (String, Vec<Parameter>) {
    let effect = &model.effects[k];
    match effect.shifted() {
        Some(shifted) => {
            let actual = model.absorbed().parameters.swap_remove(shifted);
            let expression = declared.parameters[shifted].expression_of_shift(actual.value);
            (expression, vec![actual])
        }
        None => {
            let own = model.all_parameters()[model.place_of(k)].to_vec();
            let names: Vec<String> = own.iter().map(|p| p.name.clone()).collect();
            (effect.expression(&names, model.driven_by()), own)
        }
    }
}
