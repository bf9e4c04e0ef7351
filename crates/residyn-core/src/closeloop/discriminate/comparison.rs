use rayon::prelude::*;

use super::menu::{Experiment, as_logged, experiments, spread};
use super::motion::{Motion, Record, is_turn};
use super::payload::Payload;
use crate::closeloop::fitted::Fitted;
use crate::closeloop::problem::Problem;
use crate::closeloop::select::Rival;
use crate::closeloop::settings::DiscriminateSettings;
use crate::data::{Joint, Log};
use crate::identify::{Fit, Shooting, Values, fit_by, free_parameters, rms_by_joint, uncertainty};
use crate::model::{Dynamics, FittedEffect, Model};

/// An explanation, with the problem's smoothing of friction.
pub(super) fn explanation(problem: &Problem<'_>, model: &Model) -> Dynamics {
    problem.smoothed(model).dynamics()
}

/// The rival without effects that have since been withdrawn from the model.
pub(super) fn rival_explanation(problem: &Problem<'_>, fitted: &Fitted, rival: &Rival) -> Dynamics {
    let stands = |effect: &&FittedEffect| {
        let mut known = fitted.model.effects.iter().chain([&rival.effect]);
        known.any(|other| other.is_same(effect))
    };
    let model = &rival.fitted.model;
    let effects = model.effects.iter().filter(stands).cloned().collect();
    explanation(problem, &model.with_effects(effects))
}

/// The motion that an explanation predicts; `None` if it diverges.
fn simulate(problem: &Problem<'_>, dynamics: &Dynamics, motions: &[Motion]) -> Option<Record> {
    let settings = problem.settings;
    let lengths_s = (settings.fit.window_s, settings.discriminate.pause_s);
    Record::of(motions, problem.logs, dynamics, lengths_s)
}

/// Fit an explanation to a record, with every parameter free that the file does not fix: an experiment may determine
/// parameters that the present logs do not.
fn refit(
    problem: &Problem<'_>,
    dynamics: &Dynamics,
    shooting: &Shooting<'_>,
    start_states: Vec<Vec<f64>>,
) -> Option<(Values, Fit)> {
    let (solver, active) = (problem.solver, free_parameters(dynamics));
    let scale = Some(problem.settings.discriminate.refit_scale);
    fit_by(solver, shooting, dynamics, &active, start_states, scale).ok()
}

/// Two explanations: one is simulated as the truth, and the other is fitted to it.
pub(super) struct Comparison<'a> {
    problem: &'a Problem<'a>,
    truth: Dynamics,
    /// The other explanation, fitted to the present logs as the truth simulates them.
    other: Dynamics,
    noise: Vec<f64>,
    /// The motion of the present logs as the truth simulates it.
    present: Record,
    /// The other explanation's start states in the present logs.
    start_states: Vec<Vec<f64>>,
    /// Twice the loss that the other leaves in the present logs; then the difference on each joint.
    loss: f64,
    differences: Vec<f64>,
    /// How many times more data are needed than with independent normal residuals.
    inflation: f64,
}

/// The result of simulating one experiment.
pub(super) struct Trial {
    /// What to do.
    pub text: String,
    /// The joint on which the difference is largest relative to the noise.
    pub joint: Joint,
    /// Root mean square difference on that joint after refitting, in rad (or m): in the experiment, and in the present
    /// logs.
    pub difference: f64,
    pub present: f64,
    /// Standard deviation of the noise, in rad (or m).
    pub noise: f64,
    /// Length of logs that suffices, in s; infinite if none does.
    pub seconds: f64,
}

impl<'a> Comparison<'a> {
    /// `fitted` is fitted to the problem's logs and has their start states. `None` if the truth cannot follow the logs.
    pub fn new(
        problem: &'a Problem<'a>,
        fitted: &Fitted,
        truth: Dynamics,
        other: Dynamics,
    ) -> Option<Self> {
        let settings = &problem.settings.discriminate;
        let noise = &problem.shooting.noise;
        let noise: Vec<f64> = (noise.iter())
            .map(|noise| (noise * fitted.fit.scale).max(settings.finest_position))
            .collect();
        let chosen = spread(problem.shooting.windows.len(), settings.present_windows).into_iter();
        let motions: Vec<Motion> = chosen.map(|w| window_of(problem, fitted, w)).collect();
        let present = simulate(problem, &truth, &motions)?;
        let shooting =
            Shooting::new(&present.logs, present.windows.clone(), &noise).with_free_starts();
        let (values, found) = refit(problem, &other, &shooting, present.starts(0..))?;
        let loss = loss_of(&found);
        let windows = problem.shooting.windows.iter();
        let all_s: f64 = windows.map(|w| w.duration_s(problem.logs)).sum();
        // The present logs did not discriminate, whatever the noise suggests: they hold no more data than needed.
        let too_sure = loss / present.duration_s(0..) * all_s / settings.lead;
        let differences = differences(&shooting, &other, &values, &found.start_states, 0);
        Some(Self {
            inflation: inflation(problem, fitted).max(too_sure),
            other: values.put_into(&other, &present.logs),
            start_states: found.start_states,
            differences,
            problem,
            truth,
            noise,
            present,
            loss,
        })
    }

    /// Simulate every experiment that the rig can do to distinguish effects on these joints.
    pub fn trials(&self, fitted: &Fitted, joints: &[Joint]) -> Vec<Trial> {
        let changes = experiments(self.problem, fitted, joints);
        let changes = (changes.par_iter()).filter_map(|change| self.test(change, None));
        let payloads = self.payloads();
        let loaded = (payloads.par_iter())
            .filter_map(|payload| self.test(&self.loaded(fitted, payload), Some(payload)));
        changes.chain(loaded).collect()
    }

    fn settings(&self) -> &DiscriminateSettings {
        &self.problem.settings.discriminate
    }

    fn payloads(&self) -> Vec<Payload> {
        let times = self.present.logs.iter().flat_map(|log| &log.time);
        let latest_s = times.fold(0.0_f64, |latest, time| latest.max(time.abs()));
        let declared = self.problem.declared.parameters.len();
        let (share, delay_s) = (self.settings().payload_share, 2.0 * latest_s + 10.0);
        Payload::all(&self.truth, declared, share, delay_s)
    }

    fn loaded(&self, fitted: &Fitted, payload: &Payload) -> Experiment {
        let mut motions = as_logged(self.problem, fitted);
        for time in motions.iter_mut().flat_map(|motion| &mut motion.time) {
            *time += payload.delay_s;
        }
        Experiment {
            text: payload.text(&self.truth),
            motions,
            turns: None,
        }
    }

    /// Simulate an experiment; `None` if the rig cannot do it.
    fn test(&self, experiment: &Experiment, payload: Option<&Payload>) -> Option<Trial> {
        let with = |model: &Dynamics| payload.map_or_else(|| model.clone(), |p| p.on(model));
        let [truth, other] = [&self.truth, &self.other].map(with);
        let proposed = simulate(self.problem, &truth, &experiment.motions)
            .filter(|record| self.is_possible(record, experiment.turns))?;
        let both = self.present.and(&proposed);
        let shooting =
            Shooting::new(&both.logs, both.windows.clone(), &self.noise).with_free_starts();
        let present = self.start_states.len();
        let start_states = [self.start_states.clone(), both.starts(present..)].concat();
        let (values, found) = refit(self.problem, &other, &shooting, start_states)?;
        let duration_s = both.duration_s(present..);
        let rate = (loss_of(&found) - self.loss).max(0.0) / duration_s;
        let differences = differences(&shooting, &other, &values, &found.start_states, present);
        let share = |joint: &Joint| differences[*joint] / self.noise[*joint];
        let joint = Joint::all(differences.len()).max_by(|a, b| share(a).total_cmp(&share(b)))?;
        Some(Trial {
            text: experiment.text.clone(),
            joint,
            difference: differences[joint],
            present: self.differences[joint],
            noise: self.noise[joint],
            seconds: self.settings().lead * self.inflation / rate,
        })
    }

    fn is_possible(&self, record: &Record, turns: Option<Joint>) -> bool {
        let fastest = self.settings().top_speeds;
        let slow = |log: &Log| {
            let mut joints = log.qd.iter().zip(&self.problem.top_speed);
            joints.all(|(qd, top)| qd.iter().all(|v| v.abs() <= fastest * top))
        };
        let turned = |joint: Joint| {
            let mut motions = record.motions.iter();
            motions.any(|m| is_turn(&record.logs[m.log].q[joint][m.first..=m.last]))
        };
        record.logs.iter().all(slow) && turns.is_none_or(turned)
    }
}

/// The motion of one window of the logs.
fn window_of(problem: &Problem<'_>, fitted: &Fitted, w: usize) -> Motion {
    let window = problem.shooting.windows[w];
    let log = &problem.logs[window.log];
    let rows = window.first..=window.last;
    let row = |row: usize| log.tau.iter().map(|tau| tau[row]).collect();
    Motion {
        log: window.log,
        start: fitted.fit.start_states[w].clone(),
        time: log.time[rows.clone()].to_vec(),
        tau: rows.clone().map(row).collect(),
        measured: rows.map(|row| log.measured_at(row)).collect(),
    }
}

/// Twice the loss of a fit, in units of the noise.
fn loss_of(fit: &Fit) -> f64 {
    2.0 * fit.scale * fit.scale * fit.cost
}

/// Root mean square position difference that a fit leaves on each joint, over the windows from `first` on.
fn differences(
    shooting: &Shooting<'_>,
    model: &Dynamics,
    values: &Values,
    start_states: &[Vec<f64>],
    first: usize,
) -> Vec<f64> {
    let residuals = shooting.residuals(model, values, start_states);
    let rms = rms_by_joint(&residuals[first..], model.joints);
    let both = rms.iter().zip(&shooting.noise);
    both.map(|(rms, noise)| rms * noise).collect()
}

/// How much more the estimates of a fit scatter than with independent normal residuals of its scale, as a ratio of
/// variances, at least 1: residuals of measured logs are correlated.
fn inflation(problem: &Problem<'_>, fitted: &Fitted) -> f64 {
    let size = fitted.fit.columns.len();
    let covariance = uncertainty(&problem.shooting, &fitted.fit).covariance;
    let all = fitted.fit.equations();
    let mean = (covariance * all.hessian).trace() / size.max(1) as f64;
    mean.max(1.0)
}
