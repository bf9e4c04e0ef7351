//! Stage 3: fit the declared model.

use super::error::StudyError;
use super::fitted::Fitted;
use super::select::usual_friction;
use super::start::around;
use super::study::Study;
use crate::identify::{FitError, Identifiability, Shooting, fit, identifiability};
use crate::model::{Effect, FittedEffect, Model};

/// The declared model, fitted, and what the logs determine of it.
type Declared = (Fitted, Identifiability);

/// So many fits that begin at values around the declared ones are compared: one alone may end in a local minimum.
const FITTED_AROUND: usize = 3;

/// Costs of fits are in units of each one's own scale.
fn cost((fitted, _): &Declared) -> f64 {
    fitted.fit.cost * fitted.fit.scale.powi(2)
}

impl Study<'_> {
    /// Fit the declared model, with the effects that its file carries, from its declared values: over short
    /// windows, in which even a poor start does not diverge, then over longer ones. It is fitted twice: alone, and with
    /// the friction that most machines have on every joint until the last fit, since without friction the first optimum
    /// of a rig that has it may lie anywhere. The better of the two counts. Parameters that the logs do not determine are
    /// found on the way and held from then on at the values reached: only those are sure to be compatible with the
    /// bounds of the others. A model that diverges with its declared values is fitted from others around them.
    ///
    /// # Errors
    /// No window, or a model that diverges even over short windows, from all starting values.
    pub fn fit_declared(&mut self, library: &[Effect]) -> Result<Fitted, StudyError> {
        let friction = usual_friction(self, library);
        let found = match self.fitted_from(self.declared, &friction) {
            Err(FitError::Diverged { diverged, windows }) => {
                let (start, found) = self
                    .fitted_around(&friction)
                    .ok_or(FitError::Diverged { diverged, windows })?;
                self.moved_to = start.parameters;
                self.moved_to.retain(|parameter| !parameter.fixed);
                found
            }
            found => found?,
        };
        let (fitted, identifiability) = found;
        self.identifiability = identifiability;
        Ok(fitted)
    }

    /// The best of a few fits that begin at values around the declared ones, and where it began.
    fn fitted_around(&self, friction: &[FittedEffect]) -> Option<(Model, Declared)> {
        let fit = |start: Model| Some((self.fitted_from(&start, friction).ok()?, start));
        let found = around(self).filter_map(fit).take(FITTED_AROUND);
        let (found, start) = found.min_by(|(a, _), (b, _)| cost(a).total_cmp(&cost(b)))?;
        Some((start, found))
    }

    /// The declared model, fitted from these values alone and beside friction.
    fn fitted_from(&self, start: &Model, friction: &[FittedEffect]) -> Result<Declared, FitError> {
        let found = self.declared_beside(start, &[]);
        if friction.is_empty() {
            return found;
        }
        match (found, self.declared_beside(start, friction)) {
            (Ok(alone), Ok(beside)) if cost(&alone) <= cost(&beside) => Ok(alone),
            (_, Ok(beside)) => Ok(beside),
            (found, Err(_)) => found,
        }
    }

    /// The declared model, fitted from these values beside some effects and then alone.
    fn declared_beside(
        &self,
        start: &Model,
        effects: &[FittedEffect],
    ) -> Result<Declared, FitError> {
        let mut study = self.again();
        let short = self.windows_of(self.settings.fit.short_window_s);
        let own = &self.declared.effects;
        let model = start.with_effects([own.as_slice(), effects].concat());
        let (first, held) = study.fit_and_hold(&short, &model)?;
        study.hold(held);
        let (mut last, held) = study.fit_and_hold(&self.shooting, &first.model)?;
        study.hold(held);
        if !effects.is_empty() {
            let alone = last
                .model
                .with_effects(last.model.effects[..own.len()].to_vec());
            let (fitted, held) = study.fit_and_hold(&self.shooting, &alone)?;
            study.hold(held);
            last = fitted;
        }
        Ok((last, study.identifiability))
    }

    /// The declared model, fitted over the study's windows alone from the values that its fit began with. What they do not
    /// determine is held.
    ///
    /// # Errors
    /// As [`Study::fit_declared`].
    pub(super) fn fit_started(&mut self) -> Result<Fitted, FitError> {
        self.identifiability = Identifiability::default();
        let (fitted, held) = self.fit_and_hold(&self.shooting, &self.started_from())?;
        self.hold(held);
        Ok(fitted)
    }

    fn fit_and_hold(
        &self,
        shooting: &Shooting<'_>,
        model: &Model,
    ) -> Result<(Fitted, Identifiability), FitError> {
        let model = self.smoothed(model);
        let dynamics = model.dynamics();
        let active = self.active(&dynamics);
        let locals = shooting.initial_locals(0);
        let (values, free) = fit(shooting, &dynamics, &active, locals, None)?;
        // An effect that the file carries stays free; one that is fitted beside it goes again.
        let declared = model.parameters.len();
        let carried = 0..self.declared.effects.len();
        let carried = carried.fold(declared..declared, |all, k| {
            all.start..model.place_of(k).end
        });
        let mut verdict = identifiability(&dynamics, &carried, &values, &free);
        verdict.hold.retain(|&k| k < declared);
        let columns = free.columns.iter();
        verdict.free = columns
            .filter(|column| column.parameter < carried.end)
            .count();
        if verdict.hold.is_empty() {
            let fitted = Fitted::new(&model, &dynamics, (values, free), self.logs);
            return Ok((fitted, verdict));
        }
        let kept = |k: &usize| !verdict.hold.contains(k);
        let active: Vec<usize> = active.into_iter().filter(kept).collect();
        let start = values.put_into(&dynamics, self.logs);
        let found = fit(shooting, &start, &active, free.locals, None)?;
        Ok((Fitted::new(&model, &start, found, self.logs), verdict))
    }

    fn hold(&mut self, verdict: Identifiability) {
        self.identifiability
            .undetermined
            .extend(verdict.undetermined);
        self.identifiability.free = self.identifiability.free.max(verdict.free);
        self.identifiability.hold.extend(verdict.hold);
        self.identifiability.determined =
            self.identifiability.free - self.identifiability.hold.len();
    }
}
