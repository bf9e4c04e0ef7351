//! The design of a motion: many random ones are improved side by side, and the best counts.

use std::io::{self, Write};
use std::ops::Range;
use std::sync::atomic::{AtomicUsize, Ordering};

use nalgebra::DMatrix;
use rayon::prelude::*;
use serde::Serialize;

use residyn_core::data::{Joint, Log, Quantity};
use residyn_core::decomposition::eigen;
use residyn_core::model::Model;
use residyn_core::sim::{Commands, internal_along};
use residyn_core::streams::{Purpose, stream};

use crate::balance::Equation;
use crate::bounds::{LIMITED, Use};
use crate::criterion::{Criterion, log_determinant};
use crate::descent::descend;
use crate::error::ExciteError;
use crate::fourier::{Motion, Series};
use crate::limits::Limits;
use crate::motion;
use crate::parameters::{Base, Sum};
use crate::problem::{NO_EVIDENCE, Problem};
use crate::record::{Reference, record};

/// How a motion is sought.
#[derive(Debug, Clone)]
pub struct Settings {
    /// Most harmonics of a joint's motion.
    pub harmonics: usize,
    /// Random motions that are improved.
    pub starts: usize,
    /// Steps of descent of each in every stage; the best ones take more.
    pub steps: usize,
    /// What is minimised.
    pub criterion: Criterion,
}

impl Default for Settings {
    /// With four times the starts or steps, intervals of arms of two to twelve joints shrank by 3 % at most; with 25 harmonics
    /// by 6 to 10 %, at higher frequencies than some rigs like.
    fn default() -> Self {
        Self {
            harmonics: 15,
            starts: 12,
            steps: 100,
            criterion: log_determinant,
        }
    }
}

/// Weights of squared excesses, one stage of the search after the other: a limit is exceeded by a percent in the last, and
/// the motion is then made smaller.
const STAGES: [f64; 3] = [10.0, 100.0, 2000.0];
/// How many of the improved motions are improved further, and how many times the steps of a stage these take.
const FINALISTS: usize = 2;
const MORE_STEPS: usize = 3;
/// By how much a simulated motion that exceeds a limit is made smaller at a time, and how often at most.
const SMALLER: f64 = 0.98;
const TIMES: usize = 60;
/// Quantile of the normal distribution for 95 %.
const QUANTILE: f64 = 1.959_964;

/// How far a design is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Progress {
    /// Motions that have been improved, of `all`.
    pub done: usize,
    pub all: usize,
}

/// What residuals are compared: it decides which noise counts.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Compared {
    /// The torques of the motion.
    Torques,
    /// The angles of the simulated motion, in windows of half a second with free starts.
    Angles,
}

/// What is to be expected of one sum of parameters.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Expected {
    #[serde(flatten)]
    pub sum: Sum,
    /// Standard deviation of an estimate, in the sum's unit.
    pub deviation: f64,
    /// Half width of the 95 % interval, in the sum's unit.
    pub half_width: f64,
}

/// A motion, and what it is expected to tell. Channels are `[joint][row]`.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Design {
    pub step_s: f64,
    pub duration_s: f64,
    /// Periods in the duration.
    pub harmonics: Vec<usize>,
    /// s
    pub time: Vec<f64>,
    /// The reference: rad (or m), per s and per s^2.
    pub q: Vec<Vec<f64>>,
    pub qd: Vec<Vec<f64>>,
    pub qdd: Vec<Vec<f64>>,
    /// What drives each row until the next: its value in the middle.
    pub command: Vec<Vec<f64>>,
    pub driven_by: Drives,
    pub compared: Compared,
    /// Logarithm of the determinant of the information on the sums, each in units of its size.
    pub log_determinant: f64,
    /// Condition number of the regressor of the sums in the same units: of each joint's torque over its noise.
    pub condition: f64,
    pub expected: Vec<Expected>,
    /// Free parameters that no motion within the limits shows.
    pub unseen: Vec<String>,
    /// For each alternative: the sum of squared residuals over the noise that the model leaves after its fit, if the
    /// alternative is true. Twice the expected logarithm of the likelihood ratio.
    pub evidence: Vec<f64>,
    /// How much of each limit the motion uses.
    pub uses: Vec<Use>,
    /// The least distance between spheres, or between them and boxes, m; `None` without any.
    pub clearance_m: Option<f64>,
}

/// What a given motion tells: see [`Design`].
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Judged {
    pub log_determinant: f64,
    pub condition: f64,
    pub expected: Vec<Expected>,
    /// At its rows.
    pub uses: Vec<Use>,
}

/// What `command` holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Drives {
    Torque,
    Command,
}

/// Design a motion of `duration_s` that tells most about a model's free parameters and about its alternatives, each of which
/// is the model with other effects. The same seed gives the same motion; `progress` is called from several threads.
///
/// # Errors
/// Limits that allow no motion, or a model for which none can be designed.
pub fn design(
    model: &Model,
    alternatives: &[Model],
    limits: &Limits,
    duration_s: f64,
    settings: &Settings,
    seed: u64,
    progress: &(dyn Fn(Progress) + Sync),
) -> Result<Design, ExciteError> {
    Designer::new(model, alternatives, limits, duration_s, settings)?.best(seed, progress)
}

/// Motions of one model within limits: the best one, random ones and given ones.
pub struct Designer<'a> {
    settings: Settings,
    model: &'a Model,
    alternatives: &'a [Model],
    limits: &'a Limits,
    problem: Problem,
    /// Places of the alternatives that the search itself compares: those without states of their own.
    compared: Vec<usize>,
}

impl<'a> Designer<'a> {
    /// See [`design`].
    ///
    /// # Errors
    /// As [`design`].
    pub fn new(
        model: &'a Model,
        alternatives: &'a [Model],
        limits: &'a Limits,
        duration_s: f64,
        settings: &Settings,
    ) -> Result<Self, ExciteError> {
        let has_states =
            |effect: &&residyn_core::model::FittedEffect| !effect.effect.states.is_empty();
        if let Some(effect) = model.effects.iter().find(has_states) {
            return Err(ExciteError::State(effect.label()));
        }
        let wrong = alternatives
            .iter()
            .position(|other| other.joints != model.joints);
        if let Some(k) = wrong {
            return Err(ExciteError::Alternative {
                alternative: k + 1,
                found: alternatives[k].joints,
                expected: model.joints,
            });
        }
        let plain = |k: &usize| {
            !alternatives[*k]
                .effects
                .iter()
                .any(|effect| has_states(&effect))
        };
        let compared: Vec<usize> = (0..alternatives.len()).filter(plain).collect();
        let own: Vec<Model> = compared.iter().map(|k| alternatives[*k].clone()).collect();
        let series = Series::new(&limits.joints, duration_s, settings.harmonics);
        // The sums of parameters do not depend on the seed of a design.
        let mut rng = stream(0, Purpose::Other(0));
        let way = (series, settings.criterion);
        let problem = Problem::new(model, &own, limits, duration_s, way, &mut rng)?;
        Ok(Self {
            settings: settings.clone(),
            model,
            alternatives,
            limits,
            problem,
            compared,
        })
    }

    /// The best motion found from a seed.
    ///
    /// # Errors
    /// A rig whose simulation diverges or leaves its limits at rest.
    pub fn best(
        &self,
        seed: u64,
        progress: &(dyn Fn(Progress) + Sync),
    ) -> Result<Design, ExciteError> {
        self.outcome(&self.coefficients(seed, progress)?)
    }

    /// A random motion within the limits, which it reaches: what designs are compared with.
    ///
    /// # Errors
    /// As [`Designer::best`].
    pub fn random(&self, seed: u64) -> Result<Design, ExciteError> {
        let mut rng = stream(seed, Purpose::Other(0));
        self.outcome(&self.problem.random(&mut rng))
    }

    /// The best of the random motions of these seeds, by their torques.
    ///
    /// # Errors
    /// As [`Designer::best`].
    pub fn best_random(&self, seeds: Range<u64>) -> Result<Design, ExciteError> {
        let problem = &self.problem;
        let cost = |x: &[f64]| {
            problem
                .value(x, 0.0)
                .map_or(f64::INFINITY, |(cost, _)| cost)
        };
        let all = seeds.into_par_iter().map(|seed| {
            let x = problem.random(&mut stream(seed, Purpose::Other(0)));
            (cost(&x), seed, x)
        });
        let best = all.min_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        let (_, _, x) = best.ok_or(ExciteError::NothingShown)?;
        self.outcome(&x)
    }

    /// What a given motion tells by its torques: `[joint][row]` of position, speed and acceleration, one row each step of the
    /// limits.
    ///
    /// # Errors
    /// A motion that shows too little.
    pub fn judge(&self, given: [&[Vec<f64>]; 3]) -> Result<Judged, ExciteError> {
        let problem = &self.problem;
        let rows = given[0].first().map_or(0, Vec::len);
        let step_s = self.limits.step_s;
        let jerk = |joint: usize, row: usize| {
            let channel = &given[2][joint];
            let (before, after) = (row.saturating_sub(1), (row + 1).min(rows - 1));
            (channel[after] - channel[before]) / (step_s * (after - before).max(1) as f64)
        };
        let motion: Motion = std::array::from_fn(|derivative| {
            let at = |row: usize, joint: usize| match given.get(derivative) {
                Some(channel) => channel[joint][row],
                None => jerk(joint, row),
            };
            let joints = self.model.joints;
            let rows = (0..rows).flat_map(|row| (0..joints).map(move |joint| (row, joint)));
            rows.map(|(row, joint)| at(row, joint)).collect()
        });
        let times: Vec<f64> = (0..rows).map(|row| row as f64 * step_s).collect();
        let along = problem.balance.along(&times, &motion);
        let own = problem
            .base
            .of(&problem.told_along(&along, 1.0).information);
        let (mean, _) = log_determinant(&own).ok_or(ExciteError::NothingShown)?;
        Ok(Judged {
            log_determinant: -mean * own.nrows() as f64,
            condition: condition(&own),
            expected: expected(&problem.base, &own),
            uses: problem.bounds.uses(&motion, &along.drive),
        })
    }

    /// The coefficients of the best motion.
    fn coefficients(
        &self,
        seed: u64,
        progress: &(dyn Fn(Progress) + Sync),
    ) -> Result<Vec<f64>, ExciteError> {
        let settings = &self.settings;
        let problem = &self.problem;
        let done = AtomicUsize::new(0);
        let all = settings.starts + FINALISTS.min(settings.starts);
        let tell = || {
            let done = 1 + done.fetch_add(1, Ordering::Relaxed);
            progress(Progress { done, all });
        };
        let descended = |start: Vec<f64>, strictness: f64, steps: usize| {
            let value = |x: &[f64]| problem.value(x, strictness);
            descend(value, start.clone(), steps).map_or(start, |(x, _)| x)
        };
        let improved = |k: usize| -> (f64, Vec<f64>) {
            let mut rng = stream(seed, Purpose::Other(1 + k));
            let start = problem.random(&mut rng);
            let stages = STAGES.iter();
            let end = stages.fold(start, |x, strictness| {
                descended(x, *strictness, settings.steps)
            });
            tell();
            let cost = problem.value(&end, STAGES[2]);
            (cost.map_or(f64::INFINITY, |(cost, _)| cost), end)
        };
        let mut ends: Vec<(f64, Vec<f64>)> = (0..settings.starts.max(1))
            .into_par_iter()
            .map(improved)
            .collect();
        ends.sort_by(|a, b| a.0.total_cmp(&b.0));
        ends.truncate(FINALISTS);
        let finals: Vec<(f64, Vec<f64>)> = (ends.into_par_iter())
            .map(|(_, x)| {
                let x = descended(x, STAGES[2], MORE_STEPS * settings.steps);
                let x = problem.within(&x);
                tell();
                (self.left_open(&x, settings.criterion), x)
            })
            .collect();
        let best = finals.into_iter().min_by(|a, b| a.0.total_cmp(&b.0));
        let (cost, x) = best.ok_or(ExciteError::NothingShown)?;
        match cost.is_finite() {
            true => Ok(x),
            false => Err(ExciteError::NothingShown),
        }
    }

    /// The criterion of an admissible motion by what fits will compare, the least evidence included; infinite if it cannot
    /// be told.
    fn left_open(&self, x: &[f64], criterion: Criterion) -> f64 {
        let cost = || -> Option<f64> {
            let (information, evidence) = self.told(x).ok()?;
            let (cost, _) = criterion(&self.base_of(&information).of(&information))?;
            let mut evidence = evidence.into_iter();
            let Some(first) = evidence.next() else {
                return Some(cost);
            };
            // A difference that is not a number stays one: such a motion ranks last.
            let least = evidence.fold(first, |a, b| if b < a || b.is_nan() { b } else { a });
            let cost = cost - (least + NO_EVIDENCE).ln();
            (!cost.is_nan()).then_some(cost)
        };
        cost().unwrap_or(f64::INFINITY)
    }

    /// The sums that this information shows: those of torques, or fewer where angles alone show less.
    fn base_of(&self, information: &DMatrix<f64>) -> Base {
        let problem = &self.problem;
        match log_determinant(&problem.base.of(information)) {
            Some(_) => problem.base.clone(),
            None => problem.parameters.base(information),
        }
    }

    /// Information on the columns in units of their magnitudes, and the evidence for each alternative.
    fn told(&self, x: &[f64]) -> Result<(DMatrix<f64>, Vec<f64>), ExciteError> {
        let problem = &self.problem;
        let reference = self.reference(x);
        if motion::compares_motion(self.model) {
            let log = record(self.model, &reference)?;
            let information = motion::information(self.model, &log, self.limits)?;
            let evidence = self.alternatives.iter().map(|other| {
                let log = record(other, &reference)?;
                motion::evidence(self.model, &log, self.limits)
            });
            let evidence = evidence.collect::<Result<_, _>>()?;
            return Ok((problem.parameters.relative(&information), evidence));
        }
        let told = problem.told(x);
        let mut evidence = vec![f64::NAN; self.alternatives.len()];
        for (place, found) in self.compared.iter().zip(&told.evidence) {
            evidence[*place] = *found;
        }
        for (place, evidence) in evidence.iter_mut().enumerate() {
            if !self.compared.contains(&place) {
                *evidence = self.evidence_with_states(&self.alternatives[place], x)?;
            }
        }
        Ok((told.information, evidence))
    }

    /// The evidence for an alternative with states of its own, which follow the motion from rest.
    fn evidence_with_states(&self, other: &Model, x: &[f64]) -> Result<f64, ExciteError> {
        let problem = &self.problem;
        let rows = self.rows();
        let grid = problem.series.even_grid(rows);
        let motion = problem.series.motion(&grid, x);
        let along = problem.balance.along(&grid.times, &motion);
        let log = self.log_of(&grid.times, &motion, &along.drive.command);
        let equation = Equation::of(other)?;
        let dynamics = &equation.dynamics;
        let point = dynamics.into();
        let states = internal_along(&point, &log, &Commands::of_log(dynamics, &log));
        let values = dynamics.values();
        let n = self.model.joints;
        let mut difference = Vec::with_capacity(n * rows);
        for row in 0..rows {
            let at = |channel: &Vec<f64>| -> Vec<f64> { channel[n * row..][..n].to_vec() };
            let [q, qd, qdd] = [0, 1, 2].map(|derivative| at(&motion[derivative]));
            let internal: Vec<f64> = states.iter().map(|state| state[row]).collect();
            let command = at(&along.drive.command);
            let time_s = grid.times[row];
            difference.extend(equation.at([&q, &qd, &qdd], &internal, &command, time_s, &values));
        }
        Ok(problem.evidence_of(&along, &difference, 1.0))
    }

    /// The rows of a motion as a log.
    fn log_of(&self, times: &[f64], motion: &Motion, command: &[f64]) -> Log {
        let n = self.model.joints;
        let by_joint = |channel: &[f64]| by_joint(channel, n);
        Log {
            time: times.to_vec(),
            q: by_joint(&motion[0]),
            qd: by_joint(&motion[1]),
            tau: by_joint(command),
            driven_by: self.model.driven_by(),
            ..Log::empty(n)
        }
    }

    fn rows(&self) -> usize {
        let rows = self.limits.rows(self.problem.series.duration_s);
        rows.expect("checked when the problem was made")
    }

    /// The rows of a motion, each driven until the next as in its middle.
    fn reference(&self, x: &[f64]) -> Reference {
        let problem = &self.problem;
        let grid = problem.series.even_grid(self.rows());
        let motion = problem.series.motion(&grid, x);
        let half_s = self.limits.step_s / 2.0;
        let later = grid
            .times
            .iter()
            .map(|time| (time + half_s).min(problem.series.duration_s));
        let later = problem.series.grid(later.collect());
        let drive = problem
            .balance
            .drive(&later.times, &problem.series.motion(&later, x));
        let n = self.model.joints;
        Reference {
            q: by_joint(&motion[0], n),
            qd: by_joint(&motion[1], n),
            command: by_joint(&drive.command, n),
            time: grid.times,
        }
    }

    /// The motion made so small that the simulated rig keeps the limits as well, and how much of them it uses.
    fn kept(&self, x: &[f64]) -> Result<(Vec<f64>, Vec<Use>), ExciteError> {
        let problem = &self.problem;
        let n = self.model.joints;
        let mut x = problem.within(x);
        if self.model.drive_program().is_none() {
            let uses = problem.uses(&x);
            return Ok((x, uses));
        }
        for _ in 0..TIMES {
            let log = record(self.model, &self.reference(&x))?;
            let mut uses = problem.uses(&x);
            problem.bounds.widen(&mut uses, [&log.q, &log.qd]);
            if uses.iter().all(|one| one.share <= 1.0) {
                return Ok((x, uses));
            }
            x[n..]
                .iter_mut()
                .for_each(|coefficient| *coefficient *= SMALLER);
        }
        Err(ExciteError::Rest(format!(
            "the simulated rig leaves the range of {} or {} however small the motion is",
            LIMITED[0], LIMITED[1]
        )))
    }

    /// A motion within the limits, with what it tells.
    fn outcome(&self, x: &[f64]) -> Result<Design, ExciteError> {
        let problem = &self.problem;
        let (x, uses) = self.kept(x)?;
        let (information, evidence) = self.told(&x)?;
        let base = self.base_of(&information);
        let own = base.of(&information);
        let (mean, _) = log_determinant(&own).ok_or(ExciteError::NothingShown)?;
        let grid = problem.series.even_grid(self.rows());
        let motion = problem.series.motion(&grid, &x);
        let n = self.model.joints;
        let reference = self.reference(&x);
        Ok(Design {
            step_s: self.limits.step_s,
            duration_s: problem.series.duration_s,
            harmonics: problem.series.harmonics.clone(),
            qdd: by_joint(&motion[2], n),
            time: reference.time,
            q: reference.q,
            qd: reference.qd,
            command: reference.command,
            driven_by: match self.model.driven_by() {
                Quantity::Command => Drives::Command,
                _ => Drives::Torque,
            },
            compared: match motion::compares_motion(self.model) {
                true => Compared::Angles,
                false => Compared::Torques,
            },
            log_determinant: -mean * own.nrows() as f64,
            condition: condition(&own),
            expected: expected(&base, &own),
            unseen: problem.parameters.unseen(&base),
            evidence,
            uses,
            clearance_m: problem.least_distance(&x),
        })
    }
}

/// A channel by joints, from one by rows.
fn by_joint(channel: &[f64], joints: usize) -> Vec<Vec<f64>> {
    let own = |joint: usize| {
        channel
            .iter()
            .skip(joint)
            .step_by(joints)
            .copied()
            .collect()
    };
    (0..joints).map(own).collect()
}

/// The condition number of the regressor with this information.
pub(crate) fn condition(information: &DMatrix<f64>) -> f64 {
    eigen(information.clone()).map_or(f64::INFINITY, |eigen| {
        (eigen.eigenvalues.max() / eigen.eigenvalues.min()).sqrt()
    })
}

/// The intervals of sums with this information in units of their sizes.
pub(crate) fn expected(base: &Base, information: &DMatrix<f64>) -> Vec<Expected> {
    let covariance = information
        .clone()
        .cholesky()
        .map(|factor| factor.inverse());
    let deviation = |k: usize| {
        let variance = covariance
            .as_ref()
            .map_or(f64::INFINITY, |matrix| matrix[(k, k)]);
        variance.sqrt() * base.sums[k].size
    };
    let sums = base.sums.iter().enumerate();
    sums.map(|(k, sum)| Expected {
        sum: sum.clone(),
        deviation: deviation(k),
        half_width: QUANTILE * deviation(k),
    })
    .collect()
}

impl Design {
    /// The sum of the half widths of all intervals, each over its sum's size.
    pub fn relative_intervals(&self) -> f64 {
        let relative = self
            .expected
            .iter()
            .map(|one| one.half_width / one.sum.size);
        relative.sum()
    }

    /// Write the rows as a table with the columns `time,q1..,qd1..,qdd1..,tau1..` (or `cmd1..`).
    ///
    /// # Errors
    /// Those of `out`.
    pub fn write_csv(&self, out: &mut dyn Write) -> io::Result<()> {
        let stem = match self.driven_by {
            Drives::Torque => Quantity::Torque.key(),
            Drives::Command => Quantity::Command.key(),
        };
        let channels = [
            ("q", &self.q),
            ("qd", &self.qd),
            ("qdd", &self.qdd),
            (stem, &self.command),
        ];
        let named = channels.iter().flat_map(|(stem, channel)| {
            let joints = Joint::all(channel.len());
            joints.map(move |joint| joint.name(stem))
        });
        let names: Vec<String> = std::iter::once("time".to_owned()).chain(named).collect();
        writeln!(out, "{}", names.join(","))?;
        for (row, time) in self.time.iter().enumerate() {
            write!(out, "{time}")?;
            for channel in channels.iter().flat_map(|(_, channel)| channel.iter()) {
                write!(out, ",{}", channel[row])?;
            }
            writeln!(out)?;
        }
        Ok(())
    }

    /// The noise-free log of a rig, such as an alternative, that follows this motion.
    ///
    /// # Errors
    /// A rig that diverges.
    pub fn recorded_by(&self, rig: &Model) -> Result<Log, ExciteError> {
        let reference = Reference {
            time: self.time.clone(),
            q: self.q.clone(),
            qd: self.qd.clone(),
            command: self.command.clone(),
        };
        record(rig, &reference)
    }
}
