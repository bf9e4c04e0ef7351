use rand::Rng;
use rayon::prelude::*;

use super::error::StudyError;
use super::establish::{Standing, establish, without_each};
use super::every_log::EveryLog;
use super::fitted::Fitted;
use super::gravity::{against_gravity, shares_of_gravity};
use super::remainder::{Unexplained, unexplained};
use super::select::{Losses, Rival, Round, Search, Trial, candidates, starts};
use super::space::Space;
use super::stage::{Observer, Stage};
use super::study::Study;
use crate::data::Log;
use crate::identify::{FitError, Identifiability};
use crate::model::{FittedEffect, Library, Status};

/// The result of searching the logs for what the declared model lacks.
pub struct Found {
    /// The declared model, fitted.
    pub before: Fitted,
    pub chosen: Chosen,
    pub unexplained: Unexplained,
    /// The share of the declared gravity in the torques of each log, where they are compared and it tells.
    pub gravity: Vec<Option<f64>>,
}

/// The set of effects that was chosen.
pub struct Chosen {
    /// The model with them, fitted.
    pub after: Fitted,
    /// One for each added effect, in the order of the model.
    pub standings: Vec<Standing>,
    pub rounds: Vec<Round>,
    /// Whether the search was stopped because its time was spent.
    pub stopped: bool,
    /// Effects that explain the logs as well as one that was chosen.
    pub rivals: Vec<Rival>,
    /// Why there are no effects, if the chosen model could not be fitted.
    pub failure: Option<FitError>,
}

impl Chosen {
    /// Number of established effects.
    pub fn established(&self) -> usize {
        let standings = self.standings.iter();
        standings
            .filter(|s| s.status == Status::Established)
            .count()
    }

    /// Effects are not established beside a remainder that leaves most of what their joint lacks, or more than they explain.
    fn doubt(&mut self, study: &Study<'_>, before: &Fitted, remainder: &Unexplained) {
        let settings = &study.settings.establish;
        let [declared, with] = [before, &self.after].map(|model| Loss::of(study, model));
        let left = |of: &Loss, effect: &FittedEffect| {
            of.on(effect) / declared.on(effect).max(f64::MIN_POSITIVE)
        };
        let masks = |effect: &FittedEffect| {
            remainder.matters_on(study, effect.joint) && left(&with, effect) > settings.masking
        };
        let is_outweighed = |standing: &Standing| {
            let effect = &standing.effect;
            let least = settings.outweighed * remainder.fraction_on(study, effect.joint);
            let without = standing.without.as_ref();
            let without = without.map(|without| Loss::of(study, without));
            without.is_ok_and(|without| left(&without, effect) - left(&with, effect) < least)
        };
        demote(&mut self.standings, |standing| {
            let masks = masks(&standing.effect).then_some(MASKING);
            let reason = masks.or_else(|| is_outweighed(standing).then_some(OUTWEIGHED))?;
            Some(reason.into())
        });
    }

    /// Effects are not established without which the torques of some log fit as well.
    fn ask_every_log<'l>(&mut self, logs: impl Iterator<Item = &'l Log>) {
        let logs = EveryLog::of(logs, &self.after);
        demote(&mut self.standings, |standing| {
            let log = logs.fits_as_well_without(standing)?;
            Some(format!(
                "the torques of {} fit as well without it",
                log.name()
            ))
        });
    }

    /// Note in the model how each of the effects stands.
    fn mark(&mut self, study: &Study<'_>) {
        let model = &mut self.after.model;
        let added = study.added(model);
        for (effect, standing) in model.effects[added].iter_mut().zip(&self.standings) {
            effect.status = Some(standing.status);
        }
    }
}

/// Established effects are no more than supported where there is a reason why not.
fn demote(standings: &mut [Standing], reason: impl Fn(&Standing) -> Option<String> + Sync) {
    let established = |standing: &&mut Standing| standing.status == Status::Established;
    standings
        .par_iter_mut()
        .filter(established)
        .for_each(|standing| {
            if let Some(reason) = reason(standing) {
                standing.status = Status::Supported;
                standing.reason = Some(reason);
            }
        });
}

/// Stages 3 to 5: fit the declared model, choose the set of effects that explains the logs best, judge each of them and
/// test the residuals. Where torques are compared, those of the logs that are set apart have to be fitted better by an effect
/// as well, though nothing is fitted to them.
///
/// # Errors
/// As [`Study::fit_declared`].
pub fn find(
    study: &mut Study<'_>,
    apart: &[Log],
    library: &Library,
    rng: &mut impl Rng,
    progress: &mut Observer<'_>,
) -> Result<Found, StudyError> {
    progress(Stage::Fit.into());
    let mut before = study.fit_declared(library.effects())?;
    let mut chosen = choose(study, library, &before, progress, |search| {
        search.select(before.clone())
    });
    if study.space == Space::Motion
        && let Some((widths, narrowest)) = study.wider_reversal(&chosen.after)
    {
        let narrow = std::mem::replace(&mut study.sign_widths, widths);
        let wide = study.fit_declared(library.effects())?;
        let other = choose(study, library, &wide, progress, |search| {
            search.select(wide.clone())
        });
        if Loss::of(study, &other.after).total() < narrowest {
            (before, chosen) = (wide, other);
        } else {
            study.sign_widths = narrow;
        }
    }
    progress(Stage::Remainder.into());
    let mut left = unexplained(study, library.probes(), &before, &chosen.after, rng);
    if (left.is_significant() || chosen.failure.is_some())
        && study.space == Space::Motion
        && study.has_time()
        && let Some((identifiability, other)) = second_search(study, library, &before, progress)
        && Loss::of(study, &other.after).total() < Loss::of(study, &chosen.after).total()
    {
        study.identifiability = identifiability;
        chosen = other;
        left = unexplained(study, library.probes(), &before, &chosen.after, rng);
    }
    if left.is_significant() {
        chosen.doubt(study, &before, &left);
    }
    if study.space == Space::Torque {
        chosen.ask_every_log(study.logs.iter().chain(apart));
        if let Some((after, standing)) = study.with_payload(&chosen.after, library.effects()) {
            chosen.after = after;
            chosen.standings.push(standing);
        }
    }
    let gravity = shares_of_gravity(study);
    if against_gravity(&gravity).is_some() {
        demote(&mut chosen.standings, |_| Some(ANOTHER_GRAVITY.into()));
    }
    chosen.mark(study);
    if chosen.established() == 0 && !chosen.standings.is_empty() {
        // What is not established explains nothing.
        left = unexplained(study, library.probes(), &before, &before, rng);
    }
    study.identifiability = study.identifiability_of(&chosen.after);
    Ok(Found {
        before,
        chosen,
        unexplained: left,
        gravity,
    })
}

/// Why effects are not established that leave most of the loss and an unexplained remainder.
const MASKING: &str = "an unexplained remainder stays, and all effects together cut the loss by less than half: it would \
                       mask the real cause";

/// Why effects are not established that are fitted to a part of the torques.
const ANOTHER_GRAVITY: &str = "the torques hold another gravity than the declared bodies need, and it may imitate what they lack";

/// Why an effect is not established beside a remainder that is larger.
const OUTWEIGHED: &str =
    "over twice what it explains stays unexplained: it may be a part of the real cause's shape";

/// A search that begins over short windows and from the declared values: with most of the force missing, fits over longer
/// ones end in minima from which no set of effects looks right, and where other parameters seem undetermined.
fn second_search(
    study: &Study<'_>,
    library: &Library,
    before: &Fitted,
    progress: &mut Observer<'_>,
) -> Option<(Identifiability, Chosen)> {
    let mut short = study.over_short_windows();
    let declared = short.fit_started().ok()?;
    let mut study = study.clone();
    study.identifiability = short.identifiability.clone();
    let chosen = choose(&study, library, before, progress, |search| {
        search.select_from(&short, declared)
    });
    let has_found = !chosen.standings.is_empty();
    has_found.then_some((study.identifiability, chosen))
}

/// `select` searches for a set of effects.
fn choose(
    study: &Study<'_>,
    library: &Library,
    before: &Fitted,
    progress: &mut Observer<'_>,
    select: impl FnOnce(&mut Search<'_, '_>) -> Result<Trial, FitError>,
) -> Chosen {
    let mut search = Search::new(study, library.effects(), progress);
    let chosen = match select(&mut search) {
        Ok(chosen) => chosen,
        Err(failure) => {
            return Chosen {
                after: before.clone(),
                standings: Vec::new(),
                stopped: !study.has_time(),
                rounds: search.rounds,
                rivals: Vec::new(),
                failure: Some(failure),
            };
        }
    };
    let stopped = !study.has_time();
    search.tell(Stage::Establish.into());
    let without = without_each(study, &chosen);
    let all = candidates(study, library.effects(), &study.declared.effects);
    let trials = all.iter().map(|candidate| starts(candidate).len()).sum();
    let standings = establish(study, &chosen, &without, trials);
    let established: Vec<bool> = (standings.iter())
        .map(|standing| standing.status == Status::Established)
        .collect();
    Chosen {
        rivals: search.rivals(&chosen, &without, &established),
        standings,
        stopped,
        rounds: search.rounds,
        after: chosen.fitted,
        failure: None,
    }
}

/// Losses of a model on stretches left out of its fit, in one unit for all models: a fit's own is its scale.
pub(super) struct Loss {
    losses: Losses,
    unit: f64,
}

impl Loss {
    pub fn of(study: &Study<'_>, model: &Fitted) -> Self {
        Self {
            losses: Losses::of(study, model),
            unit: model.fit.scale.powi(2),
        }
    }

    pub fn total(&self) -> f64 {
        self.losses.total() * self.unit
    }

    /// Of what an effect is judged by.
    fn on(&self, effect: &FittedEffect) -> f64 {
        self.losses.of_effect(effect).iter().sum::<f64>() * self.unit
    }
}
