//! One search for effects after another, until none explains the logs better.

use rand::Rng;

use super::diagnostics::{Unexplained, diagnose};
use super::error::StudyError;
use super::error_model::ErrorModel;
use super::establish::{Chosen, establish};
use super::fit::Declared;
use super::fitted::Fitted;
use super::judge::{Found, judge};
use super::loss::Loss;
use super::plainer::{Plainer, Unused, plainer};
use super::select::{Selected, Trial, select, select_beginning_with, select_from};
use super::stage::{Stage, Watch};
use crate::data::Log;
use crate::model::FittedEffect;

/// A search for effects, and the fit that it began with.
pub(super) struct Searched<'a> {
    pub declared: Declared<'a>,
    pub chosen: Chosen,
    /// What the chosen model leaves; `None` if it has changed since.
    left: Option<Unexplained>,
}

impl<'a> Searched<'a> {
    /// The best of several searches and plainer models.
    ///
    /// # Errors
    /// As [`Problem::fit_declared`](super::Problem::fit_declared).
    pub fn by(
        declared: Declared<'a>,
        apart: &[Log],
        rng: &mut impl Rng,
        watch: &dyn Watch,
    ) -> Result<Self, StudyError> {
        let Declared { problem, fitted } = &declared;
        let first = problem.by_torques_first(fitted, apart, rng, watch);
        let is_near = first.is_some() || problem.error_model == ErrorModel::InverseDynamics;
        let mut best = Self::beginning_with(first, declared, watch);
        if let Some(slower) = best.with_slower_reversals(watch)? {
            best = slower;
        }
        watch.see(Stage::Diagnostics.into());
        let mut left = best.diagnose(rng);
        // Torques have no false minima.
        if (best.leaves_much(&left) || best.chosen.failure.is_some())
            && !is_near
            && let Some(other) = best.searched_again(watch)
        {
            best = other;
            left = best.diagnose(rng);
        }
        best.left = Some(left);
        Ok(best.plainest(apart, watch))
    }

    /// The search that begins with a model, and plainer models from there.
    pub fn from(
        first: Fitted,
        declared: Declared<'a>,
        apart: &[Log],
        rng: &mut impl Rng,
        watch: &dyn Watch,
    ) -> Self {
        let mut best = Self::beginning_with(Some(first), declared, watch);
        best.left = Some(best.diagnose(rng));
        best.plainest(apart, watch)
    }

    /// The effects of the chosen model beyond the declared ones.
    pub fn added(&self) -> &[FittedEffect] {
        let model = &self.chosen.after.model;
        &model.effects[self.declared.problem.added(model)]
    }

    /// Plainer models in place of the chosen one, as long as they predict whole logs better, and simpler effects in place of those
    /// that do no more.
    fn plainest(mut self, apart: &[Log], watch: &dyn Watch) -> Self {
        if (self.left.as_ref()).is_some_and(|left| !left.is_significant()) {
            self.chosen.unmasked = self.chosen.named().cloned().collect();
        }
        while let Some(plainer) = self.plainer(apart, watch) {
            self = plainer;
        }
        while let Some(simpler) = self.without_excess(watch) {
            self = simpler;
        }
        self
    }

    /// What the chosen model leaves.
    pub fn left(&mut self, rng: &mut impl Rng) -> &Unexplained {
        let left = self.left.take();
        let left = left.unwrap_or_else(|| self.diagnose(rng));
        self.left.insert(left)
    }

    /// Judge each effect, and test the residuals.
    pub fn judged(mut self, apart: &[Log], rng: &mut impl Rng) -> Found<'a> {
        let left = self.left(rng).clone();
        judge(self.declared, self.chosen, left, apart, rng)
    }

    /// The same search with another fitted set of effects in place of the chosen one, and why some are not used.
    #[must_use]
    pub fn with(&self, trial: Trial, unused: Vec<Unused>, watch: &dyn Watch) -> Self {
        let Declared { problem, fitted } = &self.declared;
        let selected = Selected {
            chosen: Ok(trial),
            usual: self.chosen.usual.clone(),
            rounds: self.chosen.rounds.clone(),
            stopped: self.chosen.stopped,
        };
        let chosen = Chosen {
            unused: [self.chosen.unused.clone(), unused].concat(),
            unmasked: self.chosen.unmasked.clone(),
            ..establish(problem, fitted, selected, watch)
        };
        Self {
            declared: self.declared.clone(),
            chosen,
            left: None,
        }
    }

    /// A search that begins with the `first` model, or with the declared one if there is none.
    fn beginning_with(first: Option<Fitted>, declared: Declared<'a>, watch: &dyn Watch) -> Self {
        let Declared { problem, fitted } = &declared;
        let selected = match first {
            Some(first) => select_beginning_with(problem, first, watch),
            None => select(problem, fitted, watch),
        };
        let chosen = establish(problem, fitted, selected, watch);
        Self {
            declared,
            chosen,
            left: None,
        }
    }

    /// The search with wider smoothing velocities, if its loss is lower.
    fn with_slower_reversals(&self, watch: &dyn Watch) -> Result<Option<Self>, StudyError> {
        let problem = &self.declared.problem;
        let Some((widths, narrowest)) = problem.wider_reversal(&self.chosen.after, watch) else {
            return Ok(None);
        };
        let declared = problem.with_smoothing_velocities(widths).fit_declared()?;
        let first = problem.begins_with_torques();
        let first = first.then(|| declared.problem.estimate(&self.chosen.after));
        let first = first.and_then(Result::ok);
        let other = Self::beginning_with(first, declared, watch);
        Ok((other.loss() < narrowest).then_some(other))
    }

    /// Whether so much is unexplained that the chosen set may be that of a false minimum.
    fn leaves_much(&self, left: &Unexplained) -> bool {
        let most = (self.declared.problem.settings.select).false_minimum_share;
        left.is_significant() && left.fraction > most
    }

    /// A search that begins over short windows and from the declared values, if its loss is lower: with most of the
    /// force missing, fits over longer windows end in minima from which no set of effects looks right, and at which
    /// other parameters seem undetermined.
    fn searched_again(&self, watch: &dyn Watch) -> Option<Self> {
        let Declared { problem, fitted } = &self.declared;
        if watch.has_to_end() {
            return None;
        }
        let short = problem.fitted_over_short_windows().ok()?;
        let problem = problem.knowing(short.problem.identifiability.clone());
        let selected = select_from(&problem, &short, watch);
        let chosen = establish(&problem, fitted, selected, watch);
        let fitted = fitted.clone();
        let declared = Declared { problem, fitted };
        let other = Self {
            declared,
            chosen,
            left: None,
        };
        (!other.chosen.standings.is_empty() && other.loss() < self.loss()).then_some(other)
    }

    /// The same search with a plainer model in place of the chosen one, if it predicts whole logs better.
    fn plainer(&self, apart: &[Log], watch: &dyn Watch) -> Option<Self> {
        let Declared { problem, fitted } = &self.declared;
        let Plainer {
            fitted: plain,
            unused,
        } = plainer(problem, fitted, &self.chosen, apart)?;
        let trial = Trial::of(problem, plain);
        Some(self.with(trial, vec![unused], watch))
    }

    fn loss(&self) -> f64 {
        Loss::of(&self.declared.problem, &self.chosen.after).total()
    }

    fn diagnose(&self, rng: &mut impl Rng) -> Unexplained {
        let Declared { problem, fitted } = &self.declared;
        diagnose(problem, fitted, &self.chosen.after, rng)
    }
}
