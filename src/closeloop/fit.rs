//! Stage 3: fit the declared model.

use super::error::StudyError;
use super::fitted::Fitted;
use super::select::usual_friction;
use super::study::Study;
use crate::identify::{FitError, Identifiability, Shooting, cut, fit, identifiability};
use crate::model::{Effect, FittedEffect, Model};

impl Study<'_> {
    /// Fit the declared model, with the effects that its file carries, from its declared values: over short
    /// windows, in which even a poor start does not diverge, then over longer ones. It is fitted twice: alone, and with
    /// the friction that most machines have on every joint until the last fit, since without friction the first optimum
    /// of a rig that has it may lie anywhere. The better of the two counts. Parameters that the logs do not determine are
    /// found on the way and held from then on at the values reached: only those are sure to be compatible with the
    /// bounds of the others.
    ///
    /// # Errors
    /// No window, or a model that diverges even over short windows.
    pub fn fit_declared(&mut self, library: &[Effect]) -> Result<Fitted, StudyError> {
        let friction = usual_friction(self, library);
        let mut found = self.declared_beside(&[]);
        if !friction.is_empty() {
            let other = self.declared_beside(&friction);
            // Costs are in units of each fit's own scale.
            let cost = |(fitted, _): &(Fitted, _)| fitted.fit.cost * fitted.fit.scale.powi(2);
            found = match (found, other) {
                (Ok(alone), Ok(beside)) if cost(&alone) <= cost(&beside) => Ok(alone),
                (Ok(_), Ok(other)) | (Err(_), Ok(other)) => Ok(other),
                (found, Err(_)) => found,
            };
        }
        let (fitted, identifiability) = found?;
        self.identifiability = identifiability;
        Ok(fitted)
    }

    /// The declared model, fitted beside some effects and then alone, and what the logs determine of it.
    fn declared_beside(
        &self,
        effects: &[FittedEffect],
    ) -> Result<(Fitted, Identifiability), FitError> {
        let mut study = self.again();
        let windows = cut(self.logs, self.settings.fit.short_window_s);
        let short = Shooting::new(self.logs, windows, &self.shooting.noise);
        let own = &self.declared.effects;
        let model = self
            .declared
            .with_effects([own.as_slice(), effects].concat());
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
        let mut verdict = identifiability(&dynamics, &values, &free);
        // Only declared parameters are held: an effect that the file carries stays free.
        verdict.hold.retain(|&k| k < model.parameters.len());
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
