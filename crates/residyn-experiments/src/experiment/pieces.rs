//! The pieces of work of an experiment: every method with every seed.

use std::collections::BTreeMap;
use std::slice;

use rayon::prelude::*;

use super::learning::{Method, TrainedMethod};
use super::results::{Course, PERFECT, PRIOR};
use super::{ExperimentError, Observer, Session};
use crate::mbrl::{EpisodeScore, Evaluator, RunError};
use residyn_control::control::Predictor;
use residyn_core::plant::Plant;
use residyn_io::runs::{RunFolder, Shard};

/// A method with one seed. It runs in its own folder, where its results are found again.
#[derive(Clone, Copy)]
pub(super) struct Piece<'s> {
    actor: Actor<'s>,
    seed: u64,
}

/// What controls the plant.
#[derive(Clone, Copy)]
enum Actor<'s> {
    /// A method that learns.
    Learner(&'s Method),
    /// The prior of a method, without learning.
    Prior(&'s Method),
    /// The plant's own equations.
    Perfect(&'s Plant),
}

/// Number of real transitions and score: one for each amount of data or each receding horizon.
pub(super) type Entries = Vec<(usize, EpisodeScore)>;

impl Piece<'_> {
    /// Number of its trainings.
    pub fn rounds(&self) -> usize {
        match self.actor {
            Actor::Learner(method) => method.config.rounds,
            Actor::Prior(_) | Actor::Perfect(_) => 0,
        }
    }
}

impl Actor<'_> {
    fn name(&self) -> &str {
        match self {
            Self::Learner(method) => &method.config.name,
            Self::Prior(_) => PRIOR,
            Self::Perfect(_) => PERFECT,
        }
    }
}

impl Session {
    /// All pieces, the longest first.
    pub(super) fn pieces(&self) -> Vec<Piece<'_>> {
        let learners: Vec<_> = self.methods.iter().map(Actor::Learner).collect();
        let prior = self.methods.iter().find(|method| method.has_prior());
        let perfect = self.truth.as_ref().map(Actor::Perfect);
        let others: Vec<_> = (perfect.into_iter())
            .chain(prior.map(Actor::Prior))
            .collect();
        let mut pieces = Vec::new();
        for actors in [learners, others] {
            for seed in self.seeds() {
                pieces.extend(actors.iter().map(|&actor| Piece { actor, seed }));
            }
        }
        pieces
    }

    /// Do a shard of the pieces with these receding horizons, or else with the task's; learners are scored with these
    /// after the last round, or else with the task's after each round. Returns the results of each method in the order
    /// of the seeds.
    pub(super) fn do_shard(
        &self,
        shard: Shard,
        horizons: Option<&[usize]>,
        folder: &RunFolder,
        observer: Observer<'_>,
    ) -> Result<BTreeMap<String, Vec<Entries>>, ExperimentError> {
        let pieces: Vec<Piece<'_>> = shard.share(self.pieces()).collect();
        let done = self.each(&pieces, |piece| {
            let name = piece.actor.name();
            let own = folder.within(format!("runs/{name}-{:02}", piece.seed));
            let entries = self.do_piece(*piece, horizons, &own, observer);
            entries.map_err(|source| ExperimentError::Run {
                method: name.to_owned(),
                seed: piece.seed,
                source,
            })
        })?;
        let mut by_method = BTreeMap::<String, Vec<Entries>>::new();
        for (piece, entries) in pieces.iter().zip(done) {
            let name = piece.actor.name().to_owned();
            by_method.entry(name).or_default().push(entries);
        }
        Ok(by_method)
    }

    fn do_piece(
        &self,
        piece: Piece<'_>,
        horizons: Option<&[usize]>,
        own: &RunFolder,
        observer: Observer<'_>,
    ) -> Result<Entries, RunError> {
        let (seen, predictor) = match piece.actor {
            Actor::Learner(method) => {
                let run = self.run_of(method, piece.seed, own);
                let TrainedMethod { rounds, model, .. } =
                    method.learn(&run, own.clone(), observer)?;
                if horizons.is_none() {
                    let rounds = rounds.into_iter();
                    return Ok(rounds
                        .map(|round| (round.transitions, round.score))
                        .collect());
                }
                let seen = rounds.last().map_or(0, |round| round.transitions);
                (seen, method.predictor(&model))
            }
            Actor::Prior(method) => (0, method.prior(self.task.integrator)?),
            // Integrated like the models' equations.
            Actor::Perfect(plant) => (
                0,
                Predictor::of_equations(plant.dynamics(), self.task.integrator),
            ),
        };
        let horizons = horizons.unwrap_or(slice::from_ref(&self.task.replan));
        let score = |replan: &usize| {
            let score = self.score(piece.seed, &predictor, *replan, own);
            score.map(|score| (seen, score))
        };
        self.each(horizons, score)
    }

    /// What `act` makes of each item, at the same time if there are several plants.
    fn each<T: Sync, R: Send, E: Send>(
        &self,
        items: &[T],
        act: impl Fn(&T) -> Result<R, E> + Sync + Send,
    ) -> Result<Vec<R>, E> {
        match self.plant.is_single() {
            true => items.iter().map(act).collect(),
            false => items.par_iter().with_max_len(1).map(act).collect(),
        }
    }

    /// The score of a model, stored or else from an episode.
    fn score(
        &self,
        seed: u64,
        predictor: &Predictor,
        replan: usize,
        own: &RunFolder,
    ) -> Result<EpisodeScore, RunError> {
        let file = format!("score-{replan:03}.json");
        if let Some(stored) = own.read(&file)? {
            return Ok(stored);
        }
        let evaluator = Evaluator {
            task: &self.task,
            plant: &self.plant,
            seed,
        };
        let score = evaluator.score(predictor, replan)?;
        own.write(&file, &score)?;
        Ok(score)
    }
}

/// Combines the results of all seeds.
impl From<Vec<Entries>> for Course {
    fn from(seeds: Vec<Entries>) -> Self {
        let entry = |k: usize| {
            let scores = seeds.iter().map(|entries| entries[k].1.clone());
            (seeds[0][k].0, scores.collect::<Vec<_>>())
        };
        (0..seeds[0].len()).map(entry).collect()
    }
}
