//! Stage 3: fit the declared model.

use std::collections::BTreeSet;
use std::sync::{Arc, LazyLock};

use super::error::StudyError;
use super::error_model::ErrorModel;
use super::fitted::Fitted;
use super::prepare::Prepared;
use super::problem::Problem;
use super::select::{baseline_friction, usual_forces};
use super::smoothing::width;
use super::stage::{Stage, Watch};
use super::start::around;
use crate::identify::{
    FitError, Identifiability, Open, Shooting, Values, cut, fit_by, fit_torques, identifiability,
    open, stable_steps, uncertainty,
};
use crate::model::{FittedEffect, Library, Model};

/// The declared model, fitted.
#[derive(Clone)]
pub struct Declared<'a> {
    /// The problem to explain, with what the fit adds: the smoothing velocities, the torque noise, and what the logs
    /// determine.
    pub problem: Problem<'a>,
    pub fitted: Fitted,
}

impl<'a> Declared<'a> {
    /// The same, with what is to be found taken from another library.
    #[must_use]
    pub(super) fn with_library(mut self, library: &'a Library) -> Self {
        self.problem.library = library;
        self
    }
}

/// The declared model, fitted to its motion, and what the logs determine of it.
type ByMotion = (Fitted, Identifiability);

/// An empty library, in which nothing can be found.
pub(super) static NOTHING: LazyLock<Library> = LazyLock::new(Library::empty);

fn cost((fitted, _): &ByMotion) -> f64 {
    fitted.loss()
}

/// Choose the errors that say more about the logs, unless they are given, and fit the declared model by them. If no
/// joint moves, anything could be found, so no effect is looked for.
///
/// # Errors
/// Test logs without a window to score, torques that cannot be compared, and as [`Problem::fit_declared`].
pub fn fit<'a>(prepared: &'a Prepared<'_>, watch: &dyn Watch) -> Result<Declared<'a>, StudyError> {
    prepared.check()?;
    let mut problem = prepared.problem(prepared.error_model.unwrap_or(ErrorModel::OutputError));
    watch.see(Stage::Fit.into());
    if prepared.error_model.is_none() {
        problem = match problem.is_prescribed() {
            true => prepared.problem(ErrorModel::InverseDynamics),
            false => problem.with_first_optimum(),
        };
        if problem.is_imposed() {
            problem = prepared.problem(ErrorModel::InverseDynamics);
        }
    }
    if !problem.moves() {
        problem.library = &NOTHING;
    }
    problem.fit_declared()
}

impl<'a> Problem<'a> {
    /// Fit the declared model, with the effects that its file carries, from its declared values: over short windows, in
    /// which even a poor start does not diverge, then over longer ones. It is fitted twice: alone, and from the
    /// [first optimum](Problem::first). The better of the two counts. Parameters that the logs do not determine stay
    /// near the declared values. A model that diverges with its declared values is fitted from other values around them.
    ///
    /// # Errors
    /// No window, or a model that diverges even over short windows, from all starting values.
    pub fn fit_declared(&self) -> Result<Declared<'a>, StudyError> {
        if self.error_model == ErrorModel::InverseDynamics {
            return Ok(self.fitted_by_torques(&usual_forces(self))?);
        }
        let problem = match self.first {
            Some(_) => self.clone(),
            None => self.with_first_optimum(),
        };
        let (moved_to, found) = match problem.fitted_from(self.declared, problem.first.as_deref()) {
            Err(FitError::Diverged { diverged, windows }) => {
                let (start, found) = problem
                    .fitted_around()
                    .ok_or(FitError::Diverged { diverged, windows })?;
                let mut moved_to = start.parameters;
                moved_to.retain(|parameter| !parameter.fixed);
                (moved_to, found)
            }
            found => (Vec::new(), found?),
        };
        let (fitted, identifiability) = found;
        let problem = Self {
            moved_to,
            usual: Arc::default(),
            ..problem.knowing(identifiability)
        };
        Ok(Declared { problem, fitted })
    }

    /// The same problem with its first optimum, in steps in which the friction found there brings each joint to rest as
    /// it should. Without one if the model diverges or most rigs have nothing that the file lacks.
    pub(super) fn with_first_optimum(&self) -> Self {
        let found = self.near_first_optimum(self.declared);
        let stable = (found.first.as_ref()).and_then(|first| found.in_stable_steps(&first.model));
        match stable {
            Some(stable) => stable.near_first_optimum(self.declared),
            None => found,
        }
    }

    fn near_first_optimum(&self, start: &Model) -> Self {
        let forces = usual_forces(self);
        let is_motion = self.error_model == ErrorModel::OutputError && !forces.is_empty();
        let first = is_motion.then(|| self.fitted_beside(start, &forces).ok());
        Self {
            first: first.flatten().map(Arc::new),
            usual: Arc::default(),
            ..self.clone()
        }
    }

    /// The same problem in shorter steps, in which a model's friction brings each joint to rest as it should; `None` if
    /// its own are short enough.
    pub(super) fn in_stable_steps(&self, model: &Model) -> Option<Self> {
        let shortest_s = self.settings.fit.shortest_step_s;
        let steps = stable_steps(&self.shooting, &self.compiled(model), shortest_s);
        (steps != self.shooting.steps()).then(|| self.over(self.shooting.clone().in_steps(steps)))
    }

    /// The declared model, fitted to torques, in which it is so nearly linear that no start is poor. The residual of
    /// the model with the usual friction is the noise of each joint's torque.
    fn fitted_by_torques(&self, friction: &[FittedEffect]) -> Result<Declared<'a>, FitError> {
        let own = &self.declared.effects;
        let model = self.declared.with_effects([own, friction].concat());
        let problem = self.with_smoothing_velocities(self.best_smoothing_velocities(&model)?);
        let smoothed = problem.smoothed(&model);
        let beside = fit_torques(self.solver, &smoothed, self.declared, self.logs)?;
        // The logs there are already smoothed as needed here.
        let windows = cut(self.logs, self.settings.fit.window_s);
        let problem = problem.over(beside.shooting.over(windows));
        let alone = beside.model.effects[..own.len()].to_vec();
        let alone = beside.model.with_effects(alone);
        let fitted = problem.fitted_over(&problem.shooting, &alone)?;
        let problem = problem.knowing(problem.identifiability_of(&fitted));
        Ok(Declared { problem, fitted })
    }

    /// The smoothing velocities with which a model's torques fit best, joint by joint, unless the file gives them.
    fn best_smoothing_velocities(&self, model: &Model) -> Result<Vec<f64>, FitError> {
        let mut best = self.smoothing_velocities.clone();
        if self.declared.smoothing_velocity.is_some() {
            return Ok(best);
        }
        let fitted = |share: &f64| {
            let of_joint = |top: &f64| width(*share, *top);
            let widths: Vec<f64> = self.top_speed.iter().map(of_joint).collect();
            let model = model.with_smoothing_velocities(widths.clone());
            let found = fit_torques(self.solver, &model, self.declared, self.logs)?;
            Ok((found.shooting.noise, widths))
        };
        let shares = self.settings.fit.wider_sign_shares;
        let tried: Vec<(Vec<f64>, Vec<f64>)> =
            shares.iter().map(fitted).collect::<Result<_, FitError>>()?;
        for (j, width) in best.iter_mut().enumerate() {
            let least = tried.iter().min_by(|(a, _), (b, _)| a[j].total_cmp(&b[j]));
            *width = least.map_or(*width, |(_, widths)| widths[j]);
        }
        Ok(best)
    }

    /// The best of a few fits that begin at values around the declared ones, and where it began.
    fn fitted_around(&self) -> Option<(Model, ByMotion)> {
        let fit = |start: Model| {
            let first = self.near_first_optimum(&start).first;
            Some((self.fitted_from(&start, first.as_deref()).ok()?, start))
        };
        let found = around(self).filter_map(fit);
        let found = found.take(self.settings.fit.fitted_starts);
        let (found, start) = found.min_by(|(a, _), (b, _)| cost(a).total_cmp(&cost(b)))?;
        Some((start, found))
    }

    /// The declared model, fitted from these values and from a first optimum.
    fn fitted_from(&self, start: &Model, first: Option<&Fitted>) -> Result<ByMotion, FitError> {
        let alone = self.fitted_beside(start, &[]).map(|alone| {
            let identifiability = self.identifiability_of(&alone);
            (alone, identifiability)
        });
        let Some(first) = first else {
            return alone;
        };
        match (alone, self.declared_after(first)) {
            (Ok(alone), Ok(after)) if cost(&alone) <= cost(&after) => Ok(alone),
            (_, Ok(after)) => Ok(after),
            (alone, Err(_)) => alone,
        }
    }

    /// The declared model with baseline friction on every joint, fitted from the starting values of the declared one;
    /// `None` if it diverges.
    pub(super) fn with_usual_friction(&self) -> Option<Fitted> {
        let fit = || {
            let friction = baseline_friction(self);
            self.fitted_beside(&self.started_from(), &friction).ok()
        };
        self.usual.get_or_init(fit).clone()
    }

    /// The declared model with these effects, fitted from these values: over short windows, then over the problem's
    /// windows.
    pub(super) fn fitted_beside(
        &self,
        start: &Model,
        effects: &[FittedEffect],
    ) -> Result<Fitted, FitError> {
        let short = self.windows_of(self.settings.fit.short_window_s);
        let own = &self.declared.effects;
        let model = start.with_effects([own.as_slice(), effects].concat());
        let first = self.fitted_over(&short, &model)?;
        self.fitted_over(&self.shooting, &first.model)
    }

    /// The declared model, fitted alone from the values of a first optimum, and what the logs determine of it there.
    fn declared_after(&self, first: &Fitted) -> Result<ByMotion, FitError> {
        let own = first.model.effects[..self.declared.effects.len()].to_vec();
        let alone = self.fitted_over(&self.shooting, &first.model.with_effects(own))?;
        Ok((alone, self.identifiability_of(first)))
    }

    /// The declared model, fitted over short windows only, in which even a poor start does not diverge, from the
    /// starting values of its fit.
    ///
    /// # Errors
    /// As [`Problem::fit_declared`].
    pub(super) fn fitted_over_short_windows(&self) -> Result<Declared<'a>, FitError> {
        let short = self.over(self.windows_of(self.settings.fit.short_window_s));
        let fitted = short.fitted_over(&short.shooting, &short.started_from())?;
        let problem = short.knowing(short.identifiability_of(&fitted));
        Ok(Declared { problem, fitted })
    }

    fn fitted_over(&self, shooting: &Shooting<'_>, model: &Model) -> Result<Fitted, FitError> {
        self.fitted_by(model, |dynamics, active| {
            let start_states = shooting.initial_start_states(0);
            fit_by(self.solver, shooting, dynamics, active, start_states, None)
        })
    }

    /// What the logs determine of the declared parameters and of the file's effects, together with all effects of a
    /// fitted model.
    pub(super) fn identifiability_of(&self, fitted: &Fitted) -> Identifiability {
        let dynamics = self.compiled(&fitted.model);
        let values = Values::of(&dynamics, self.logs);
        let end = self.end_of_declared();
        let bodies = self.declared.inertias().concat();
        let mut verdict = identifiability(&dynamics, self.readiness(), &values, &fitted.fit);
        let known = verdict.hold.len() + verdict.determined;
        // Combinations that are neither determined nor held belong to bodies or, without bodies, to effects.
        let open = match bodies.is_empty() {
            true => 0,
            false => verdict.free - known,
        };
        let columns = fitted.fit.columns.iter();
        verdict.free = columns.filter(|column| column.parameter < end).count();
        verdict.determined = verdict.free.saturating_sub(verdict.hold.len() + open);
        verdict
    }

    /// A combination of declared parameters on which the blocks of the logs disagree, in a fit in which others are held
    /// already.
    pub(super) fn open_in(&self, fitted: &Fitted) -> Option<Open> {
        let dynamics = self.compiled(&fitted.model);
        let values = Values::of(&dynamics, self.logs);
        let covariance = uncertainty(&self.shooting, &fitted.fit).covariance;
        let fit = &fitted.fit;
        open(&dynamics, self.readiness(), &values, fit, &covariance)
    }

    /// Index after the parameters of the declared equations and of the file's effects.
    fn end_of_declared(&self) -> usize {
        self.declared.all_parameters().len()
    }

    /// Parameters of the equations are held before those of the file's effects, and nothing else is held. Whatever the
    /// logs do not determine of a body stays as declared without being held.
    fn readiness(&self) -> impl Fn(usize) -> Option<usize> {
        let (of_equations, end) = (self.declared.parameters.len(), self.end_of_declared());
        let bodies: BTreeSet<usize> = self.declared.inertias().into_iter().flatten().collect();
        move |parameter| {
            let is_held = parameter < end && !bodies.contains(&parameter);
            is_held.then(|| usize::from(parameter >= of_equations))
        }
    }
}
