//! Stage 3: fit the declared model.

use super::error::StudyError;
use super::fitted::Fitted;
use super::study::Study;
use crate::identify::{FitError, Identifiability, Shooting, cut, fit, identifiability};
use crate::model::Model;

impl Study<'_> {
    /// Fit the declared model, with the effects that its file carries, from its declared values: over short
    /// windows, in which even a poor start does not diverge, then over longer ones. Parameters that the
    /// logs do not determine are found on the way and held from then on at the values reached: only those are
    /// sure to be compatible with the bounds of the others.
    ///
    /// # Errors
    /// No window, or a model that diverges even over short windows.
    pub fn fit_declared(&mut self) -> Result<Fitted, StudyError> {
        let windows = cut(self.logs, self.settings.fit.short_window_s);
        let short = Shooting::new(self.logs, windows, &self.shooting.noise);
        let (first, held) = self.fit_and_hold(&short, self.declared)?;
        self.hold(held);
        let (second, held) = self.fit_and_hold(&self.shooting, &first.model)?;
        self.hold(held);
        Ok(second)
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
