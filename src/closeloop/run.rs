use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;

use super::bootstrap::reduction_interval;
use super::contradicted::contradicted;
use super::curve::curves;
use super::evidence::{p_of_gains, p_value};
use super::find::{Found, find};
use super::folds::{folds, left_out_losses};
use super::learn::learn_residual;
use super::outcome::{Contender, Errors, Finding, Outcome, Verdict};
use super::per_log::take_over_intervals;
use super::proposal::proposal;
use super::residual::{ForceSample, residual_force, within_turn};
use super::split::Split;
use super::study::{Fitted, Study, StudyError};
use super::unexplained::{UNKNOWN, Unexplained};
use crate::data::audit;
use crate::evaluate::{Assessment, assess, window_count};
use crate::identify::uncertainty;
use crate::model::{Dynamics, FittedEffect, Library, Parameter, System};
use crate::train::Backend;

/// What closing the loop is asked for.
pub struct Request<'a> {
    pub system: &'a System,
    pub library: &'a Library,
    pub split: Split,
    /// Models to score as they are on the same test logs.
    pub against: Vec<Contender>,
    /// Horizons of the reported errors in s; the effect of an effect is reported at the middle one.
    pub horizons_s: [f64; 3],
    /// Where the residual network is trained; without one there is none.
    pub backend: Option<Backend>,
}

/// Where the work stands, for a progress display.
#[derive(Debug, Clone, Copy)]
pub struct Stage<'s> {
    /// Of [`STAGES`].
    pub number: usize,
    pub text: &'s str,
}

/// Number of stages that [`close_loop`] announces.
pub const STAGES: usize = 6;

/// Fewer windows than this tell nothing.
const FEWEST_WINDOWS: usize = 8;

/// Effects that raise the error on the test logs by more than noise in the windows' start states does are not
/// to be trusted: a twentieth.
const WORSE: f64 = 1.05;

/// Fit the declared model, add effects while they help on trajectories left out of the fit, train the residual
/// network on what is left, and measure before and after on the test logs.
///
/// # Errors
/// Logs without a usable window, or a declared model that diverges from its starting values.
pub fn close_loop(
    request: Request<'_>,
    rng: &mut ChaCha8Rng,
    progress: &mut dyn FnMut(Stage<'_>),
) -> Result<Outcome, StudyError> {
    let Request {
        system,
        library,
        split,
        against,
        horizons_s,
        backend,
    } = request;
    if let Some(&horizon_s) = horizons_s
        .iter()
        .find(|h| window_count(&split.test, **h) == 0)
    {
        return Err(StudyError::NoTest { horizon_s });
    }
    let audits = split.train.iter().chain(&split.test).map(audit).collect();
    let mut study = Study::new(system, &split.train);
    let Found {
        before,
        after,
        rounds,
        alternatives,
        taken_back,
        confirmed_on,
        unexplained: left,
    } = find(&mut study, library, rng, progress)?;
    progress(Stage {
        number: 3,
        text: "residual force",
    });
    let residual = |model: &Fitted| {
        let mut samples = residual_force(&study, model);
        within_turn(&mut samples, &system.prismatic);
        samples
    };
    let (residual_before, residual_after) = rayon::join(|| residual(&before), || residual(&after));
    let curves = |samples: &[ForceSample]| curves(samples, &system.prismatic);
    let fine = study.refined();
    let coarse = after.fit.values.clone();
    let after = fine.estimate(&after);
    let (curves_before, curves_after) = (curves(&residual_before), curves(&residual_after));
    let proposal = proposal(&study, &after, &left);
    let learned = match backend {
        Some(backend) => learn_residual(&fine, &after, backend, rng, &mut |text| {
            progress(Stage { number: 4, text });
        })?,
        None => None,
    };
    progress(Stage {
        number: 5,
        text: "open-loop errors",
    });
    let judge = |model: &Fitted| {
        let values: Vec<Vec<f64>> = (split.test.iter())
            .map(|log| model.values_in(log))
            .collect();
        assess(
            &model.dynamics,
            |log| &values[log],
            &split.test,
            &horizons_s,
        )
    };
    let judge_as_is = |model: &System| {
        let dynamics = model.dynamics();
        let values: Vec<Vec<f64>> = (split.test.iter())
            .map(|log| dynamics.in_log(log).values())
            .collect();
        assess(&dynamics, |log| &values[log], &split.test, &horizons_s)
    };
    let judge_hybrid = |model: &Dynamics| {
        let values = model.values();
        assess(model, |_| &values, &split.test, &horizons_s)
    };
    let scored = |other: &Contender| (other.name.clone(), judge_as_is(&other.system));
    let (error_before, error_after) = rayon::join(|| judge(&before), || judge(&after));
    let errors = Errors {
        declared: judge_as_is(system),
        hybrid: learned.as_ref().map(|model| judge_hybrid(&model.hybrid)),
        against: against.iter().map(scored).collect(),
        reduction_ci95: reduction_interval(error_before.middle(), error_after.middle(), rng),
        before: error_before,
        after: error_after,
    };
    let parameters = with_intervals(&fine, &after, &coarse);
    let findings = findings(&study, &after, &parameters, &errors.after, judge);
    let (verdict, reason) = verdict(&study, &after, &left, &errors);
    Ok(Outcome {
        verdict,
        reason,
        how_split: split.how.clone(),
        audits,
        sign_widths: fine.sign_widths.clone(),
        prismatic: system.prismatic.clone(),
        identifiability: study.identifiability.clone(),
        alternatives,
        taken_back,
        confirmed_on,
        contradicted: contradicted(
            &system.dynamics().values(),
            &with_intervals(&study, &before, &before.fit.values),
        ),
        before,
        after,
        parameters,
        findings,
        rounds,
        unexplained: left,
        proposal,
        errors,
        residual_before,
        residual_after,
        curves_before,
        curves_after,
        learned,
        calibration: None,
        train: split.train.clone(),
        test: split.test,
    })
}

/// Fitted values with their 95 % intervals; parameters that were not free have none. An interval reaches as much
/// further as the value was off in coarser numbers: smoothing and steps err to first order, so that what halving
/// them changes is what is left of their error (Richardson 1911).
fn with_intervals(study: &Study<'_>, model: &Fitted, coarse: &[f64]) -> Vec<Parameter> {
    let uncertainty = uncertainty(&study.shooting, &model.fit);
    let mut parameters = model.dynamics.parameters.clone();
    for (parameter, value) in parameters.iter_mut().zip(&model.fit.values) {
        parameter.value = *value;
        parameter.ci95 = None;
    }
    for (i, column) in model.fit.columns.iter().enumerate() {
        let k = column.parameter;
        if column.log.is_some() {
            continue;
        }
        let value = model.fit.values[k];
        let half = uncertainty.half_width(i) + (value - coarse[k]).abs();
        let [low, high] = parameters[k].bounds;
        parameters[k].ci95 = Some([(value - half).max(low), (value + half).min(high)]);
    }
    for (e, effect) in model.effects.iter().enumerate() {
        if let Some(k) = effect.shifted() {
            parameters[k] = parameters[k].shifted_by(&parameters[model.range_of(e).start]);
        }
    }
    parameters
}

fn findings(
    study: &Study<'_>,
    model: &Fitted,
    parameters: &[Parameter],
    with: &Assessment,
    judge: impl Fn(&Fitted) -> Assessment + Sync,
) -> Vec<Finding> {
    let folds = folds(&study.shooting);
    let uncertainty = uncertainty(&study.shooting, &model.fit);
    let finding = |k: usize| {
        let own = parameters[model.range_of(k)].to_vec();
        let mut effect = model.effects[k].clone();
        let (expression, reported) = described(study.system, &effect, parameters, &own);
        for (slot, parameter) in effect.values.iter_mut().zip(&own) {
            *slot = (parameter.value, parameter.ci95);
        }
        take_over_intervals(
            &mut effect,
            model.range_of(k),
            &model.fit,
            &uncertainty,
            study.logs,
        );
        let without = without(study, model, k)?;
        let losses = |model: &Fitted| left_out_losses(&model.fit, &folds);
        Some(Finding {
            expression,
            effect,
            parameters: reported,
            p_value: p_value(study, model, k)
                .unwrap_or_else(|| p_of_gains(&losses(&without), &losses(model))),
            error_reduction: 1.0
                - with.position_rms() / judge(&without).position_rms().max(f64::MIN_POSITIVE),
        })
    };
    let declared = study.system.effects.len();
    (declared..model.effects.len())
        .into_par_iter()
        .filter_map(finding)
        .collect()
}

/// What an effect with its `own` parameters adds, and the parameters that it is reported with: of a shift, what is
/// shifted.
fn described(
    system: &System,
    effect: &FittedEffect,
    parameters: &[Parameter],
    own: &[Parameter],
) -> (String, Vec<Parameter>) {
    match effect.shifted() {
        Some(k) => {
            let expression = system.parameters[k].expression_of_shift(parameters[k].value);
            (expression, vec![parameters[k].clone()])
        }
        None => {
            let names: Vec<String> = own.iter().map(|p| p.name.clone()).collect();
            (effect.expression(&names), own.to_vec())
        }
    }
}

/// The model refitted without its k-th effect, its residuals on the same scale.
fn without(study: &Study<'_>, model: &Fitted, k: usize) -> Option<Fitted> {
    let mut effects = model.effects.clone();
    effects.remove(k);
    study
        .refit(
            &effects,
            &model.declared,
            model.fit.locals.clone(),
            Some(model.fit.scale),
        )
        .ok()
}

fn verdict(
    study: &Study<'_>,
    after: &Fitted,
    left: &Unexplained,
    errors: &Errors,
) -> (Verdict, String) {
    let windows = study.shooting.windows.len();
    if windows < FEWEST_WINDOWS {
        let reason = format!(
            "the training logs hold only {windows} windows of half a second; record more motion"
        );
        return (Verdict::Inconclusive, reason);
    }
    let known = &study.identifiability;
    if known.free > 0 && known.determined == 0 {
        let reason =
            "the training logs determine no parameter of the declared model; move the joints more"
                .into();
        return (Verdict::Inconclusive, reason);
    }
    let found = after.effects.len() - study.system.effects.len();
    if found > 0 && errors.after.position_rms() > WORSE * errors.before.position_rms() {
        let reason = "effects help on left-out stretches of the training logs but raise the error on the test logs: \
                      do not use them before logs of more varied motion confirm them";
        return (Verdict::Inconclusive, reason.into());
    }
    let what_is_left = match left.place.as_str() {
        UNKNOWN => "something is left that follows no variable that was probed".to_owned(),
        place => format!("something that depends on {place} is left"),
    };
    match (found, left.is_significant()) {
        (0, false) => (
            Verdict::NoMissingEffect,
            "no effect of the library helps on left-out stretches".into(),
        ),
        (0, true) => (
            Verdict::Unexplained,
            format!("no effect of the library helps, and {what_is_left}"),
        ),
        (_, false) => (
            Verdict::Explained,
            "the effects found leave nothing significant".into(),
        ),
        (_, true) => (
            Verdict::PartlyExplained,
            format!("effects were found, and {what_is_left}"),
        ),
    }
}
