use std::ops::Range;
use std::sync::{Arc, OnceLock};

use super::error_model::ErrorModel;
use super::fitted::Fitted;
use super::settings::Settings;
use super::smoothing::width;
use super::split::by_numbers;
use crate::data::statistics::ends;
use crate::data::{Audit, Joint, JointAudit, Log, audit};
use crate::identify::{
    Fit, FitError, Identifiability, LevenbergMarquardt, Shooting, Solver, Values, cut, fit_below,
    fit_by, free_parameters,
};
use crate::model::{Dynamics, Effect, FittedEffect, Library, Logged, Model, Parameter};

/// A declared model, the effects that it may lack, and the logs to learn from, with what follows from them.
///
/// It is never changed: a stage returns its results in a copy. Copies share the large parts: the audits, the smoothed
/// logs and the batches of windows.
#[derive(Clone)]
pub struct Problem<'a> {
    /// With the values in its file.
    pub declared: &'a Model,
    /// The effects that it may lack.
    pub library: &'a Library,
    pub error_model: ErrorModel,
    pub settings: &'a Settings,
    /// Finds the minimum of each fit.
    pub solver: &'a dyn Solver,
    pub logs: &'a [Log],
    /// One per log, made on first use.
    pub(super) audits: Arc<OnceLock<Vec<Audit>>>,
    /// Speed of each joint over which dry friction reverses, in rad/s (or m/s).
    pub smoothing_velocities: Vec<f64>,
    /// Each joint's top speed, top torque and largest torque or command in the logs.
    pub top_speed: Vec<f64>,
    pub top_torque: Vec<f64>,
    pub top_driving: Vec<f64>,
    /// From each joint's lowest angle in the logs to its highest, rad or m.
    pub travel: Vec<f64>,
    /// What the declared equations give each joint, kg m^2 or kg, worked out on first use: of many joints it takes long, and
    /// few effects ask.
    pub(super) inertias: Arc<OnceLock<Vec<f64>>>,
    pub shooting: Shooting<'a>,
    /// A few of its windows, spread evenly, for comparing starting points.
    pub sample: Sample<'a>,
    /// The first optimum: the declared model with the friction and a constant torque of every joint. On a rig that has
    /// them, the optimum of a model without them may lie anywhere.
    pub first: Option<Arc<Fitted>>,
    /// The declared model with the usual friction, fitted on first use, see [`Problem::with_usual_friction`]; unknown again
    /// in every copy that would fit it differently.
    pub(super) usual: Arc<OnceLock<Option<Fitted>>>,
    /// The free declared parameters at the starting values of their fit, if the model diverges at the values in its
    /// file; else empty.
    pub moved_to: Vec<Parameter>,
    /// What the logs determine of the declared parameters.
    pub identifiability: Identifiability,
    /// Declared parameters that are held in every fit.
    pub held: Vec<usize>,
}

/// Some of a problem's windows.
#[derive(Clone)]
pub struct Sample<'a> {
    pub shooting: Shooting<'a>,
    /// Which of the problem's windows they are.
    members: Vec<usize>,
}

impl<'a> Sample<'a> {
    pub(super) fn of(shooting: &Shooting<'a>, size: usize) -> Self {
        let every = shooting.windows.len().div_ceil(size).max(1);
        let members: Vec<usize> = (0..shooting.windows.len()).step_by(every).collect();
        let windows = members.iter().map(|&w| shooting.windows[w]).collect();
        Self {
            shooting: shooting.over(windows),
            members,
        }
    }

    /// The start states of these windows, out of those of all windows.
    pub fn start_states(&self, all: &[Vec<f64>]) -> Vec<Vec<f64>> {
        self.members.iter().map(|&w| all[w].clone()).collect()
    }
}

impl<'a> Problem<'a> {
    /// A problem of the motion.
    pub fn new(
        declared: &'a Model,
        library: &'a Library,
        logs: &'a [Log],
        settings: &'a Settings,
    ) -> Self {
        let audits = logs.iter().map(|log| audit(log, &declared.columns));
        let logs = (logs, audits.collect());
        Self::audited(declared, library, ErrorModel::OutputError, logs, settings)
    }

    /// A problem of logs with their audits.
    pub(super) fn audited(
        declared: &'a Model,
        library: &'a Library,
        error_model: ErrorModel,
        (logs, audits): (&'a [Log], Vec<Audit>),
        settings: &'a Settings,
    ) -> Self {
        let top = |f: &dyn Fn(usize, usize) -> f64| -> Vec<f64> {
            (0..declared.joints)
                .map(|j| (0..logs.len()).map(|l| f(l, j)).fold(0.0, f64::max))
                .collect()
        };
        let top_speed = top(&|l, j| audits[l].joints[j].fast_rad_s);
        let torques: Vec<Vec<Vec<f64>>> =
            logs.iter().map(|log| declared.drive_torques(log)).collect();
        let largest = |channel: &[f64]| channel.iter().fold(0.0, |top: f64, x| top.max(x.abs()));
        let top_torque = top(&|l, j| largest(&torques[l][j]));
        let top_driving = top(&|l, j| largest(&logs[l].tau[j]));
        let travel = |j: usize| {
            let angles = audits.iter().map(|audit| &audit.joints[j].q);
            let extremes: Vec<f64> = angles.flat_map(|q| [q.min, q.max]).collect();
            let [lowest, highest] = ends(&extremes);
            highest - lowest
        };
        let travel = (0..declared.joints).map(travel).collect();
        // Encoders finer than their noise show it; coarse ones add quantisation error.
        let noise = top(&|l, j| {
            let channel = &audits[l].joints[j].q;
            let rounding = channel.resolution / 12.0_f64.sqrt();
            channel.noise_std.max(rounding).max(1e-9)
        });
        let of_joint = |top: &f64| width(settings.fit.smoothing_velocity_share, *top);
        let by_speed = || top_speed.iter().map(of_joint).collect();
        let smoothing_velocities: Vec<f64> =
            declared.smoothing_velocity.clone().unwrap_or_else(by_speed);
        // Torque noise is unknown before the first fit, so start from 1.
        let noise = match error_model {
            ErrorModel::OutputError => noise,
            ErrorModel::InverseDynamics => vec![1.0; declared.joints],
        };
        let windows = cut(logs, settings.fit.window_s);
        let shooting = error_model.shooting(logs, windows, &noise, &smoothing_velocities);
        let shooting = shooting.near(declared);
        Self {
            declared,
            library,
            error_model,
            solver: &LevenbergMarquardt::USUAL,
            settings,
            logs,
            audits: Arc::new(audits.into()),
            smoothing_velocities,
            sample: Sample::of(&shooting, settings.fit.sample_windows),
            shooting,
            top_speed,
            top_torque,
            top_driving,
            travel,
            inertias: Arc::default(),
            first: None,
            usual: Arc::default(),
            moved_to: Vec::new(),
            identifiability: Identifiability::default(),
            held: Vec::new(),
        }
    }

    /// In how many parts models are judged, see [`ErrorModel::parts`].
    pub(super) fn parts(&self) -> usize {
        self.error_model.parts(self.declared.joints)
    }

    /// The joints in the order of their logged motion: random draws in this order do not depend on how the model
    /// numbers them.
    pub(super) fn joints_by_motion(&self) -> Vec<usize> {
        let motion = |joint: usize| self.logs.iter().flat_map(move |log| &log.q[joint]);
        let mut joints: Vec<usize> = (0..self.declared.joints).collect();
        joints.sort_by(|a, b| by_numbers(motion(*a), motion(*b)));
        joints
    }

    /// A share of the loss of one part, as a share of the whole loss.
    pub(super) fn of_whole(&self, share: f64) -> f64 {
        share / self.parts() as f64
    }

    /// An effect with bounds and starting values in a joint's own units.
    pub fn measured(&self, effect: &Effect, joint: Joint) -> Effect {
        let durations = self.logs.iter().map(Log::duration);
        let measured = effect.measured_by(&Logged {
            reversal: self.smoothing_velocities[joint],
            top_speed: self.top_speed[joint],
            top_torque: self.top_torque[joint],
            inertia: &|| self.inertias.get_or_init(|| self.declared.joint_inertias())[joint],
            duration_s: durations.fold(0.0, f64::max),
            travel: self.travel[joint],
        });
        match &self.declared.sides {
            Some(sides) => measured.read_on(sides[joint]),
            None => measured,
        }
    }

    /// The effects that the model may lack.
    pub(super) fn effects(&self) -> &'a [Effect] {
        self.library.effects()
    }

    /// The same model on other logs of the same rig: noise, speeds and smoothing velocities stay.
    pub fn on<'b>(&self, logs: &'b [Log]) -> Problem<'b>
    where
        'a: 'b,
    {
        let windows = cut(logs, self.settings.fit.window_s);
        let noise = &self.shooting.noise;
        let shooting =
            (self.error_model).shooting(logs, windows, noise, &self.smoothing_velocities);
        let shooting = shooting.in_steps(self.shooting.steps());
        let same: &Problem<'b> = self;
        Problem {
            logs,
            audits: Arc::default(),
            moved_to: Vec::new(),
            identifiability: Identifiability::default(),
            held: Vec::new(),
            ..same.over(shooting.near(self.declared))
        }
    }

    /// The same problem over other windows of its logs, or with other noise on its joints.
    pub(super) fn over(&self, shooting: Shooting<'a>) -> Self {
        Self {
            sample: Sample::of(&shooting, self.settings.fit.sample_windows),
            shooting,
            first: None,
            usual: Arc::default(),
            ..self.clone()
        }
    }

    /// The same problem with this identifiability known.
    pub(super) fn knowing(&self, identifiability: Identifiability) -> Self {
        Self {
            identifiability,
            ..self.clone()
        }
    }

    /// The same problem with these smoothing velocities. For torques the logs are smoothed with them, so they need
    /// other windows as well.
    pub(super) fn with_smoothing_velocities(&self, smoothing_velocities: Vec<f64>) -> Self {
        Self {
            smoothing_velocities,
            first: None,
            usual: Arc::default(),
            ..self.clone()
        }
    }

    /// Its logs, cut into windows of this length in s.
    pub(super) fn windows_of(&self, length_s: f64) -> Shooting<'a> {
        self.shooting.cut_into(length_s)
    }

    /// The declared model at the starting values of its fit.
    pub(super) fn started_from(&self) -> Model {
        let mut model = self.declared.clone();
        for parameter in &mut model.parameters {
            let mut moved = self.moved_to.iter();
            let moved = moved.find(|moved| moved.name == parameter.name);
            *parameter = moved.unwrap_or(parameter).clone();
        }
        model
    }

    /// The audits of the logs, in their order.
    pub fn audits(&self) -> &[Audit] {
        let of_log = |log| audit(log, &self.declared.columns);
        self.audits
            .get_or_init(|| self.logs.iter().map(of_log).collect())
    }

    /// Whether any joint moves visibly in any of the logs.
    pub(super) fn moves(&self) -> bool {
        let moves = |audit: &Audit| audit.joints.iter().any(JointAudit::moves);
        self.audits().iter().any(moves)
    }

    /// Fit a model, starting from its values, with the problem's smoothing of friction.
    ///
    /// # Errors
    /// As [`Problem::fit_declared`].
    pub fn refit(
        &self,
        model: &Model,
        start_states: Vec<Vec<f64>>,
        scale: Option<f64>,
    ) -> Result<Fitted, FitError> {
        self.fitted_by(model, |dynamics, active| {
            let (solver, shooting) = (self.solver, &self.shooting);
            fit_by(solver, shooting, dynamics, active, start_states, scale)
        })
    }

    /// A model with the problem's smoothing of friction, fitted by `fit`, which is given the parameters that it may
    /// change.
    pub(super) fn fitted_by<E>(
        &self,
        model: &Model,
        fit: impl FnOnce(&Dynamics, &[usize]) -> Result<(Values, Fit), E>,
    ) -> Result<Fitted, E> {
        let model = self.smoothed(model);
        let dynamics = self.error_model.compile(&model);
        let found = fit(&dynamics, &self.active(&dynamics))?;
        Ok(Fitted::new(&model, &dynamics, found, self.logs))
    }

    /// Fit a model anew, starting from its values; the scale of its residuals is estimated again.
    ///
    /// # Errors
    /// As [`Problem::fit_declared`].
    pub fn estimate(&self, fitted: &Fitted) -> Result<Fitted, FitError> {
        self.refit(&fitted.model, fitted.fit.start_states.clone(), None)
    }

    /// Fit a model with these effects in place of its own, starting from its values, at its scale of the residuals, so
    /// that the losses of the two can be compared.
    ///
    /// # Errors
    /// As [`Problem::fit_declared`].
    pub(super) fn with_effects(
        &self,
        fitted: &Fitted,
        effects: Vec<FittedEffect>,
    ) -> Result<Fitted, FitError> {
        let start_states = fitted.fit.start_states.clone();
        let model = fitted.model.with_effects(effects);
        self.refit(&model, start_states, Some(fitted.fit.scale))
    }

    /// As [`Problem::with_effects`], if only a loss below `below` is of use: `None` if the model cannot be fitted or
    /// does not reach it.
    pub(super) fn with_better_effects(
        &self,
        fitted: &Fitted,
        effects: Vec<FittedEffect>,
        below: f64,
    ) -> Option<Fitted> {
        let start_states = fitted.fit.start_states.clone();
        let aim = (fitted.fit.scale, below);
        let model = fitted.model.with_effects(effects);
        let fitted = self.fitted_by(&model, |dynamics, active| {
            let (solver, shooting) = (self.solver, &self.shooting);
            let found = fit_below(solver, shooting, dynamics, active, start_states, aim);
            found.ok().flatten().ok_or(())
        });
        fitted.ok()
    }

    /// The same without the k-th effect of a model.
    pub(super) fn without_effect(&self, fitted: &Fitted, k: usize) -> Result<Fitted, FitError> {
        let mut effects = fitted.model.effects.clone();
        effects.remove(k);
        self.with_effects(fitted, effects)
    }

    /// Places of the effects that a model has and the declared model lacks.
    pub fn added(&self, model: &Model) -> Range<usize> {
        self.declared.effects.len()..model.effects.len()
    }

    /// A model with the problem's smoothing of friction.
    pub(super) fn smoothed(&self, model: &Model) -> Model {
        model.with_smoothing_velocities(self.smoothing_velocities.clone())
    }

    /// A fitted model with more effects, compiled with the problem's smoothing of friction.
    pub(super) fn extended(&self, fitted: &Fitted, more: &[FittedEffect]) -> Dynamics {
        let model = fitted.model.with_effects(fitted.effects_and(more));
        self.compiled(&model)
    }

    /// A model compiled for the errors that the problem compares, with its smoothing of friction.
    pub(super) fn compiled(&self, model: &Model) -> Dynamics {
        self.error_model.compile(&self.smoothed(model))
    }

    /// Whether the logs determine a parameter; if not, they do not distinguish its value from others.
    pub(super) fn is_identifiable(&self, parameter: usize) -> bool {
        !self.identifiability.hold.contains(&parameter)
    }

    /// Parameters that a fit may change.
    pub fn active(&self, dynamics: &Dynamics) -> Vec<usize> {
        let mut active = free_parameters(dynamics);
        active.retain(|k| !self.held.contains(k));
        active
    }
}
