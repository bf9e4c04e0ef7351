use thiserror::Error;

use super::per_log::{take_over, values_on};
use crate::data::{Audit, Log, audit};
use crate::expr::SignForm;
use crate::identify::{Fit, FitError, Identifiability, Shooting, cut, fit, identifiability};
use crate::model::{Dynamics, FittedEffect, System, put_own};

/// Why the loop could not be closed at all.
#[derive(Debug, Error)]
pub enum StudyError {
    #[error(
        "the test logs give no window of {horizon_s} s to judge by; give longer test logs or leave out less"
    )]
    NoTest { horizon_s: f64 },
    #[error(transparent)]
    Fit(#[from] FitError),
    #[error(transparent)]
    Train(#[from] crate::train::TrainError),
    #[error(transparent)]
    Hybrid(#[from] crate::train::HybridError),
}

/// Length in s of the windows of the first fit: even a poor start does not diverge in them.
const SHORT_S: f64 = 0.15;
/// Length in s of the windows over which models are fitted and compared: most effects show in them.
pub(super) const WINDOW_S: f64 = 0.5;

/// Dry friction is smoothed over this share of a joint's top speed in the logs: a joint that sticks creeps at most at
/// such a speed, a milliradian in half a second on a lab rig. A share, so that the width means the
/// same on a slow axis and on a fast arm.
const SIGN_WIDTH: f64 = 5e-4;

/// The model that is reported is fitted once more in finer steps (s), with friction that reverses over half the
/// speed: smoothing and steps shift dry friction by a few parts in a thousand, more than the noise of long logs does.
const FINE_STEP_S: f64 = 5e-4;

/// A declared system, logs to learn from, and what both imply.
pub struct Study<'a> {
    pub system: &'a System,
    pub logs: &'a [Log],
    pub sign: Vec<SignForm>,
    /// Speed of each joint over which dry friction reverses, in rad/s (or m/s).
    pub sign_widths: Vec<f64>,
    /// Top speed and top torque of each joint.
    pub top_speed: Vec<f64>,
    pub top_torque: Vec<f64>,
    pub shooting: Shooting<'a>,
    /// A few of its windows, spread evenly, for first looks.
    pub sample: Sample<'a>,
    /// What the logs determine of the declared parameters; those in `hold` are held in every fit.
    pub identifiability: Identifiability,
}

/// Some of a study's windows.
pub struct Sample<'a> {
    pub shooting: Shooting<'a>,
    /// Which of the study's windows they are.
    members: Vec<usize>,
}

/// Windows of a first look.
const SAMPLE: usize = 24;

impl<'a> Sample<'a> {
    fn of(shooting: &Shooting<'a>) -> Self {
        let every = shooting.windows.len().div_ceil(SAMPLE).max(1);
        let members: Vec<usize> = (0..shooting.windows.len()).step_by(every).collect();
        let windows = members.iter().map(|&w| shooting.windows[w]).collect();
        Self {
            shooting: Shooting::new(shooting.logs, windows, &shooting.noise),
            members,
        }
    }

    /// The local values of these windows, of those of all.
    pub fn locals(&self, all: &[Vec<f64>]) -> Vec<Vec<f64>> {
        self.members.iter().map(|&w| all[w].clone()).collect()
    }
}

/// A model fitted to a study's logs.
#[derive(Debug, Clone)]
pub struct Fitted {
    /// Values of the declared parameters.
    pub declared: Vec<f64>,
    /// Effects with their fitted values.
    pub effects: Vec<FittedEffect>,
    pub dynamics: Dynamics,
    pub fit: Fit,
}

impl<'a> Study<'a> {
    pub fn new(system: &'a System, logs: &'a [Log]) -> Self {
        let audits: Vec<Audit> = logs.iter().map(audit).collect();
        let top = |f: &dyn Fn(usize, usize) -> f64| -> Vec<f64> {
            (0..system.joints)
                .map(|j| (0..logs.len()).map(|l| f(l, j)).fold(0.0, f64::max))
                .collect()
        };
        let top_speed = top(&|l, j| audits[l].joints[j].fast_rad_s);
        let top_torque = top(&|l, j| {
            audits[l].joints[j]
                .tau
                .max
                .max(-audits[l].joints[j].tau.min)
        });
        // Encoders that are finer than their noise show it; coarse ones add the error of rounding.
        let noise = top(&|l, j| {
            let channel = &audits[l].joints[j].q;
            channel
                .noise_std
                .max(channel.resolution / 12.0_f64.sqrt())
                .max(1e-9)
        });
        let by_speed = || {
            top_speed
                .iter()
                .map(|speed| SIGN_WIDTH * speed.max(1e-6))
                .collect()
        };
        let sign_widths: Vec<f64> = system.sign_width.clone().unwrap_or_else(by_speed);
        let shooting = Shooting::new(logs, cut(logs, WINDOW_S), &noise);
        Self {
            system,
            logs,
            sign: smooth(&sign_widths),
            sign_widths,
            sample: Sample::of(&shooting),
            shooting,
            top_speed,
            top_torque,
            identifiability: Identifiability::default(),
        }
    }

    /// The same system on other logs of the same rig: noise, speeds and the width of friction's reversal stay.
    pub fn on<'b>(&self, logs: &'b [Log]) -> Study<'b>
    where
        'a: 'b,
    {
        let shooting = Shooting::new(logs, cut(logs, WINDOW_S), &self.shooting.noise);
        Study {
            system: self.system,
            logs,
            sign: self.sign.clone(),
            sign_widths: self.sign_widths.clone(),
            top_speed: self.top_speed.clone(),
            top_torque: self.top_torque.clone(),
            sample: Sample::of(&shooting),
            shooting,
            identifiability: Identifiability::default(),
        }
    }

    /// The same study in finer numbers, to estimate a model that has been chosen. A width of friction's reversal that
    /// the model file gives stays.
    pub fn refined(&self) -> Self {
        let narrower = self.system.sign_width.as_ref().map_or(0.5, |_| 1.0);
        let sign_widths: Vec<f64> = self.sign_widths.iter().map(|w| narrower * w).collect();
        let windows = self.shooting.windows.clone();
        let shooting = Shooting::new(self.logs, windows, &self.shooting.noise);
        Self {
            sign: smooth(&sign_widths),
            sign_widths,
            shooting: shooting.in_steps_of(FINE_STEP_S),
            identifiability: self.identifiability.clone(),
            ..self.on(self.logs)
        }
    }

    /// A chosen model estimated anew; as it was where that fails.
    pub fn estimate(&self, chosen: &Fitted) -> Fitted {
        let locals = chosen.fit.locals.clone();
        self.refit(&chosen.effects, &chosen.declared, locals, None)
            .unwrap_or_else(|_| chosen.clone())
    }

    /// Fit the declared model, with the effects that its file carries, from its declared values: over short
    /// windows, in which even a poor start does not diverge, then over longer ones. Parameters that the
    /// logs do not determine are found on the way and held from then on at the values reached: only those are
    /// sure to be compatible with the bounds of the others.
    ///
    /// # Errors
    /// No window, or a model that diverges even over short windows.
    pub fn fit_declared(&mut self) -> Result<Fitted, StudyError> {
        let declared: Vec<f64> = self.system.parameters.iter().map(|p| p.value).collect();
        let short = Shooting::new(self.logs, cut(self.logs, SHORT_S), &self.shooting.noise);
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

    /// Fit a set of effects, starting from the values that they and the declared parameters carry.
    ///
    /// # Errors
    /// As [`Study::fit_declared`].
    pub fn refit(
        &self,
        effects: &[FittedEffect],
        declared: &[f64],
        locals: Vec<Vec<f64>>,
        scale: Option<f64>,
    ) -> Result<Fitted, FitError> {
        self.fit_on(&self.shooting, effects, declared, locals, scale)
    }

    fn fit_on(
        &self,
        shooting: &Shooting<'_>,
        effects: &[FittedEffect],
        declared: &[f64],
        locals: Vec<Vec<f64>>,
        scale: Option<f64>,
    ) -> Result<Fitted, FitError> {
        let dynamics = self.system.dynamics_with(effects, &self.sign);
        let values = values_on(self.logs, declared, effects);
        let fit = fit(
            shooting,
            &dynamics,
            &self.active(&dynamics),
            values,
            locals,
            scale,
        )?;
        Ok(Fitted::new(
            dynamics,
            effects,
            fit,
            declared.len(),
            self.logs,
        ))
    }

    /// Parameters that a fit may change.
    pub fn active(&self, dynamics: &Dynamics) -> Vec<usize> {
        let free =
            |k: &usize| !dynamics.parameters[*k].fixed && !self.identifiability.hold.contains(k);
        (0..dynamics.parameters.len()).filter(free).collect()
    }
}

fn smooth(widths: &[f64]) -> Vec<SignForm> {
    let smooth = |&width: &f64| SignForm::Smooth { width };
    widths.iter().map(smooth).collect()
}

/// Declared values, then those of the effects: all parameters of the model, in its order, as they are in a log
/// without values of its own.
pub fn joined(declared: &[f64], effects: &[FittedEffect]) -> Vec<f64> {
    let of_effects = effects
        .iter()
        .flat_map(|effect| effect.values.iter().map(|(value, _)| *value));
    declared.iter().copied().chain(of_effects).collect()
}

impl Fitted {
    fn new(
        dynamics: Dynamics,
        effects: &[FittedEffect],
        fit: Fit,
        declared: usize,
        logs: &[Log],
    ) -> Self {
        let mut effects = effects.to_vec();
        let mut values = fit.values[declared..].iter();
        for slot in effects.iter_mut().flat_map(|effect| &mut effect.values) {
            slot.0 = *values
                .next()
                .expect("the model has a value for each parameter");
        }
        let mut first = declared;
        for effect in &mut effects {
            let range = first..first + effect.values.len();
            first = range.end;
            take_over(effect, range, &fit, logs);
        }
        Self {
            declared: fit.values[..declared].to_vec(),
            effects,
            dynamics,
            fit,
        }
    }

    /// All parameters as they are in a log; one that the fit has not seen has no values of its own.
    pub fn values_in(&self, log: &Log) -> Vec<f64> {
        let mut values = joined(&self.declared, &self.effects);
        put_own(&mut values, self.declared.len(), &self.effects, log);
        values
    }

    /// Where the parameters of the k-th effect stand among all parameters.
    pub fn range_of(&self, k: usize) -> std::ops::Range<usize> {
        let before: usize = self.effects[..k]
            .iter()
            .map(|effect| effect.values.len())
            .sum();
        let start = self.declared.len() + before;
        start..start + self.effects[k].values.len()
    }
}
