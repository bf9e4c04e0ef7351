//! Stage 3: fit the declared model.

use super::error::StudyError;
use super::fitted::Fitted;
use super::study::Study;
use crate::identify::{FitError, Identifiability, Shooting, cut, fit, identifiability};
use crate::model::FittedEffect;

impl Study<'_> {
    /// Fit the declared model, with the effects that its file carries, from its declared values: over short
    /// windows, in which even a poor start does not diverge, then over longer ones. Parameters that the
    /// logs do not determine are found on the way and held from then on at the values reached: only those are
    /// sure to be compatible with the bounds of the others.
    ///
    /// # Errors
    /// No window, or a model that diverges even over short windows.
    pub fn fit_declared(&mut self) -> Result<Fitted, StudyError> {
        let declared: Vec<f64> = self.system.parameters.iter().map(|p| p.value).collect();
        let windows = cut(self.logs, self.settings.fit.short_window_s);
        let short = Shooting::new(self.logs, windows, &self.shooting.noise);
        let (first, held) = self.fit_and_hold(&short, &self.system.effects, &declared)?;
        self.hold(held);
        let (second, held) = self.fit_and_hold(&self.shooting, &first.effects, &first.declared)?;
        self.hold(held);
        Ok(second)
    }

    fn fit_and_hold(
        &self,
        shooting: &Shooting<'_>,
        effects: &[FittedEffect],
        declared: &[f64],
    ) -> Result<(Fitted, Identifiability), FitError> {
        let free = self.fit_on(
            shooting,
            effects,
            declared,
            shooting.initial_locals(0),
            None,
        )?;
        let mut verdict = identifiability(&free.dynamics, &free.fit);
        // Only declared parameters are held: an effect that the file carries is asked about as it is.
        verdict.hold.retain(|&k| k < declared.len());
        if verdict.hold.is_empty() {
            return Ok((free, verdict));
        }
        let kept = |k: &usize| !verdict.hold.contains(k);
        let active: Vec<usize> = free.fit.active.iter().copied().filter(kept).collect();
        let locals = free.fit.locals.clone();
        let fit = fit(
            shooting,
            &free.dynamics,
            &active,
            free.fit.found(),
            locals,
            None,
        )?;
        Ok((
            Fitted::new(free.dynamics, effects, fit, declared.len(), self.logs),
            verdict,
        ))
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
