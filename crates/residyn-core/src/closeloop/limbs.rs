//! A search limb by limb: joints of one limb do not move those of another, so that each limb is a smaller problem of its
//! own.

use std::sync::{Arc, OnceLock};

use rand::{Rng, RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;

use super::alike::{Part, agree};
use super::command_path;
use super::diagnostics::{Probed, diagnose_in_parts};
use super::error::StudyError;
use super::error_model::ErrorModel;
use super::establish::{Chosen, Standing};
use super::fit::Declared;
use super::fitted::Fitted;
use super::gravity::shares_of_gravity;
use super::judge::{Found, mark};
use super::plainer::Unused;
use super::problem::Problem;
use super::select::{Rival, Round, Tried};
use super::stage::Watch;
use crate::data::{Audit, Joint, Log};
use crate::identify::{FitError, as_it_stands};
use crate::model::{FittedEffect, Library, Model, PerLogValue};

/// Rows of a limb's logs that are searched; the whole is fitted to all of them.
const ROWS: usize = 6000;

/// As [`find`](super::find), limb by limb; `None` if there is only one limb, or motion is compared, in which all joints are one part.
pub(super) fn find_in_limbs<'a>(
    declared: &Declared<'a>,
    apart: &[Log],
    rng: &mut impl Rng,
    watch: &dyn Watch,
) -> Result<Option<Found<'a>>, StudyError> {
    let problem = &declared.problem;
    let joints = problem.declared.limbs();
    if joints.len() == 1 || problem.error_model == ErrorModel::OutputError {
        return Ok(None);
    }
    let limb = |joints| Limb::of(problem, apart, joints);
    let limbs: Vec<Limb> = joints.into_iter().map(limb).collect();
    // The same draws for each limb: no result depends on their order.
    let seed = rng.random();
    let mut draws: Vec<_> = limbs
        .iter()
        .map(|_| ChaCha8Rng::seed_from_u64(seed))
        .collect();
    let searched = limbs.par_iter().zip(&mut draws);
    let parts = searched.map(|(limb, rng)| limb.search(problem, rng, watch));
    let mut parts: Vec<Part<'_>> = parts.collect::<Result<_, StudyError>>()?;
    agree(problem.declared, &mut parts, watch);
    let judged = parts.into_par_iter().zip(&limbs).zip(&mut draws);
    let found = judged.map(|((mut part, limb), rng)| {
        let probes = part.searched.left(rng).probes.iter();
        let probes = probes.map(|probed| probed.on(part.joints[probed.joint]));
        (probes.collect(), part.searched.judged(&limb.apart, rng))
    });
    let (probed, found): (Vec<Vec<Probed>>, Vec<Found<'_>>) = found.unzip();
    let whole = Whole {
        declared,
        limbs: limbs.iter().zip(&found).collect(),
    };
    let chosen = whole.chosen()?;
    let before = declared.fitted.clone();
    let knowing = Problem {
        usual: Arc::new(OnceLock::from(whole.usual())),
        ..problem.knowing(problem.identifiability_of(&chosen.after))
    };
    Ok(Some(Found {
        unexplained: diagnose_in_parts(problem, &before, &chosen.after, probed.concat(), rng),
        problem: knowing,
        gravity: shares_of_gravity(problem),
        before,
        chosen,
    }))
}

/// A limb, and what the logs hold of it.
pub(super) struct Limb {
    joints: Vec<Joint>,
    model: Model,
    logs: Vec<Log>,
    audits: Vec<Audit>,
    apart: Vec<Log>,
}

impl Limb {
    pub(super) fn of(problem: &Problem<'_>, apart: &[Log], joints: Vec<Joint>) -> Self {
        let own = |logs: &[Log]| logs.iter().map(|log| log.of_joints(&joints)).collect();
        Self {
            model: problem.declared.limb(&joints),
            logs: own(problem.logs),
            apart: own(apart),
            audits: (problem.audits().iter())
                .map(|audit| audit.of_joints(&joints))
                .collect(),
            joints,
        }
    }

    /// Search for what the limb lacks.
    fn search<'l>(
        &'l self,
        whole: &Problem<'l>,
        rng: &mut impl Rng,
        watch: &dyn Watch,
    ) -> Result<Part<'l>, StudyError> {
        let problem = self.problem(whole, whole.library, whole.error_model);
        let problem = problem.spread_over(ROWS);
        Ok(Part {
            joints: self.joints.clone(),
            searched: command_path::searched(problem.fit_declared()?, &self.apart, rng, watch)?,
        })
    }

    pub(super) fn joints(&self) -> &[Joint] {
        &self.joints
    }

    /// The limb's part of a problem, with these effects and errors.
    pub(super) fn problem<'l>(
        &'l self,
        whole: &Problem<'l>,
        library: &'l Library,
        errors: ErrorModel,
    ) -> Problem<'l> {
        let logs = (self.logs.as_slice(), self.audits.clone());
        Problem {
            solver: whole.solver,
            ..Problem::audited(&self.model, library, errors, logs, whole.settings)
        }
    }

    /// An effect of the limb as one of the whole.
    pub(super) fn of_whole(&self, effect: &FittedEffect) -> FittedEffect {
        effect.on(self.joints[effect.joint])
    }

    /// An effect of the whole, on a joint of the limb, as one of the limb.
    pub(super) fn of_limb(&self, effect: &FittedEffect) -> FittedEffect {
        let mut joints = self.joints.iter();
        let place = joints.position(|own| *own == effect.joint);
        effect.on(Joint::at(place.expect("it is on the limb")))
    }

    /// Write the declared part of a fitted limb into the whole; its added effects are returned.
    pub(super) fn put_into(&self, whole: &mut Model, limb: &Model) -> Vec<FittedEffect> {
        let free = (self.model.parameters.iter()).map(|declared| !declared.fixed);
        for ((own, found), free) in whole.parameters.iter_mut().zip(&limb.parameters).zip(free) {
            if free {
                own.clone_from(found);
            }
        }
        let of_limb = |own: &&PerLogValue| !self.model.parameters[own.parameter].fixed;
        whole.own.retain(|own| !of_limb(&own));
        whole.own.extend(limb.own.iter().filter(of_limb).cloned());
        let mut effects = limb.effects.iter().map(|effect| self.of_whole(effect));
        let declared = whole.effects.iter_mut();
        let declared = declared.filter(|effect| self.joints.contains(&effect.joint));
        for (place, found) in declared.zip(effects.by_ref()) {
            *place = found;
        }
        effects.collect()
    }

    fn round_of_whole(&self, round: &Round) -> Round {
        let tried = round.tried.iter().map(|tried| Tried {
            effects: (tried.effects.iter())
                .map(|effect| self.of_whole(effect))
                .collect(),
            ..*tried
        });
        Round {
            candidates: round.candidates,
            tried: tried.collect(),
        }
    }
}

/// What was found in all limbs, as an answer about the whole.
struct Whole<'w, 'a> {
    declared: &'w Declared<'a>,
    limbs: Vec<(&'w Limb, &'w Found<'w>)>,
}

impl Whole<'_, '_> {
    fn chosen(&self) -> Result<Chosen, FitError> {
        let problem = &self.declared.problem;
        let model = self.with(None);
        let start_states = problem.shooting.initial_start_states(0);
        let mut chosen = Chosen::of(problem.refit(&model, start_states, None)?);
        for (k, (limb, found)) in self.limbs.iter().enumerate() {
            let own = &found.chosen;
            let standings = own.standings.par_iter();
            let standings = standings.map(|standing| self.standing(k, standing, &chosen.after));
            let standings: Vec<Standing> = standings.collect();
            chosen.standings.extend(standings);
            let rivals = own.rivals.par_iter();
            let rivals = rivals.map(|rival| self.rival(k, rival, &chosen.after));
            let rivals: Vec<Rival> = rivals.collect::<Result<_, FitError>>()?;
            chosen.rivals.extend(rivals);
            chosen
                .rounds
                .extend(own.rounds.iter().map(|round| limb.round_of_whole(round)));
            chosen.stopped |= own.stopped;
            let unused = own.unused.iter().map(|unused| Unused {
                effect: unused.effect.as_ref().map(|effect| limb.of_whole(effect)),
                ..unused.clone()
            });
            chosen.unused.extend(unused);
            chosen.failure = chosen.failure.or_else(|| own.failure.clone());
        }
        mark(&mut chosen.after.model, &chosen.standings);
        Ok(chosen)
    }

    /// The whole with what was found in each limb; with another model of limb `other`, if there is one.
    fn with(&self, other: Option<(usize, &Model)>) -> Model {
        let limbs = self.limbs.iter().enumerate();
        self.of_limbs(limbs.map(|(k, (limb, found))| {
            let other = other.filter(|(other, _)| *other == k);
            (
                *limb,
                other.map_or(&found.chosen.after.model, |(_, model)| model),
            )
        }))
    }

    /// The declared model with the values and effects of a model of each limb.
    fn of_limbs<'m>(&self, limbs: impl Iterator<Item = (&'m Limb, &'m Model)>) -> Model {
        let mut whole = self.declared.fitted.model.clone();
        let mut added = Vec::new();
        for (limb, model) in limbs {
            added.extend(limb.put_into(&mut whole, model));
        }
        let effects = [whole.effects.as_slice(), &added].concat();
        whole.with_effects(effects)
    }

    /// The whole with another model of limb `k`, at the scale of the chosen one. Its windows' normal equations are not kept:
    /// there is one such model for each effect.
    fn other(&self, k: usize, other: &Fitted, after: &Fitted) -> Result<Fitted, FitError> {
        let other = self.as_it_stands(&self.with(Some((k, &other.model))), after)?;
        Ok(other.without_windows())
    }

    /// A model of the whole at the scale of another.
    fn as_it_stands(&self, model: &Model, scaled: &Fitted) -> Result<Fitted, FitError> {
        let problem = &self.declared.problem;
        let model = problem.smoothed(model);
        let dynamics = problem.compiled(&model);
        let active = problem.active(&dynamics);
        let start_states = scaled.fit.start_states.clone();
        let scale = scaled.fit.scale;
        let fit = as_it_stands(&problem.shooting, &dynamics, &active, start_states, scale)?;
        Ok(Fitted { model, fit })
    }

    /// The declared model with the usual friction, as it was fitted in each limb; `None` if it diverges in one.
    fn usual(&self) -> Option<Fitted> {
        let fitted = self
            .limbs
            .par_iter()
            .map(|(_, found)| found.problem.with_usual_friction());
        let fitted: Vec<Fitted> = fitted.collect::<Option<_>>()?;
        let limbs = self.limbs.iter().zip(&fitted);
        let model = self.of_limbs(limbs.map(|((limb, _), fitted)| (*limb, &fitted.model)));
        self.as_it_stands(&model, &self.declared.fitted).ok()
    }

    fn standing(&self, k: usize, standing: &Standing, after: &Fitted) -> Standing {
        let without = standing.without.as_ref();
        Standing {
            effect: self.limbs[k].0.of_whole(&standing.effect),
            without: without
                .map_err(Clone::clone)
                .and_then(|without| self.other(k, without, after)),
            ..standing.clone()
        }
    }

    fn rival(&self, k: usize, rival: &Rival, after: &Fitted) -> Result<Rival, FitError> {
        let limb = self.limbs[k].0;
        Ok(Rival {
            fitted: self.other(k, &rival.fitted, after)?,
            effect: limb.of_whole(&rival.effect),
            instead_of: limb.of_whole(&rival.instead_of),
            ..*rival
        })
    }
}
