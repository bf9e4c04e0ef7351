//! The experiment that tells two explanations apart which the logs do not.

mod menu;
mod motion;
mod payload;

use serde::Serialize;

use self::menu::{Proposal, as_logged, proposals, spread};
use self::motion::{Motion, is_turn, start_of, windows};
use self::payload::{Payload, SHARE};
use super::search::Rival;
use super::study::{Fitted, Study, WINDOW_S, joined};
use crate::data::Log;
use crate::identify::{Fit, Shooting, fit, uncertainty};
use crate::model::{Dynamics, FittedEffect};

/// How far two explanations differ in the experiment that tells them apart best.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Separation {
    /// What to do; `None` where nothing that was simulated tells them apart.
    pub experiment: Option<String>,
    /// Joint, counted from 1, on which the difference shows most.
    pub joint: usize,
    /// Difference of the positions, root mean square over half a second ahead, after one has been refitted to what
    /// the other does, in rad (or m).
    pub difference_rad: f64,
    /// The same in the present logs.
    pub present_difference_rad: f64,
    /// What the model of the present logs does not explain of a position, standard deviation in rad (or m).
    pub noise_rad: f64,
    /// Length in s of logs of the experiment that suffice.
    pub seconds: Option<f64>,
    #[serde(skip)]
    slides: bool,
}

/// Twice the loss by which the true model must lead for the other to fall behind by two standard errors with a
/// probability of 95 %: the lead has the mean of half and the standard deviation of the root of this number.
const NEEDED: f64 = 4.0 * (2.0 + 1.645) * (2.0 + 1.645);
/// Below this length in s an experiment is not worth shortening.
const SHORT_S: f64 = 10.0;
/// Nobody records for longer than this (s) to tell two explanations.
const LONG_S: f64 = 600.0;
/// Motion faster than so many times the top speed of the logs is not what the rig was built for.
const FASTEST: f64 = 5.0;
/// A difference below this share of the noise is less than what no model has right.
const VISIBLE: f64 = 0.1;
/// Windows by which the present logs are represented.
const PRESENT: usize = 40;
/// Finer than this (rad or m) no position is measured.
const FINEST: f64 = 1e-6;
/// Scale of the residuals in refits: so large that the robust loss is plain least squares.
const SCALE: f64 = 100.0;

/// The experiment that would tell a rival from the model chosen, by T-optimality (Atkinson and Fedorov 1975): each
/// experiment of the menu is simulated with one of the two, the other is refitted to it and to the present logs
/// together, all its parameters and start states free, and what then still differs is weighed against the noise.
/// A rival that contains the chosen effect is the one simulated, at the size fitted: it could follow the other anywhere.
/// `None` where not even the present motion can be simulated.
pub(super) fn separation(study: &Study<'_>, model: &Fitted, rival: &Rival) -> Option<Separation> {
    let chosen = Contender::new(study, &model.effects, &model.declared);
    let other = Contender::of_rival(study, model, rival);
    let contest = if rival.contains_chosen() {
        Contest::new(study, model, other, chosen)
    } else {
        Contest::new(study, model, chosen, other)
    }?;
    let mut joints = vec![rival.effect.joint, rival.instead_of.joint];
    joints.dedup();
    let tests: Vec<Test> = contest.tests(model, &joints);
    let telling = tests.iter().filter(|test| test.tells());
    let best = telling.min_by(|a, b| a.worth().total_cmp(&b.worth()));
    let widest = (tests.iter()).max_by(|a, b| a.deviation().total_cmp(&b.deviation()))?;
    let shown = best.unwrap_or(widest);
    Some(Separation {
        experiment: best.map(|test| test.text.clone()),
        joint: shown.joint + 1,
        difference_rad: shown.difference,
        present_difference_rad: shown.present,
        noise_rad: shown.noise,
        seconds: best.map(|test| test.worth().ceil()),
        slides: study.system.prismatic[shown.joint],
    })
}

impl Separation {
    /// In a sentence.
    pub fn text(&self) -> String {
        let milli = |x: f64| {
            let x = 1e3 * x;
            let digits = if x < 0.995 { 2 } else { 1 };
            format!("{x:.digits$}")
        };
        let unit = if self.slides { "mm" } else { "mrad" };
        let (difference, noise) = (milli(self.difference_rad), milli(self.noise_rad));
        match (&self.experiment, self.seconds) {
            (Some(experiment), Some(seconds)) => format!(
                "{experiment}; the two then differ by {difference} {unit} on joint {} (rms over half a second, after \
                 refitting; in these logs {}, noise {noise}), and {seconds:.0} s are enough",
                self.joint,
                milli(self.present_difference_rad)
            ),
            _ => format!(
                "no change of torque, speed, load or duration that was simulated separates them (largest difference \
                 {difference} {unit}, noise {noise}): for this rig they are the same; fix one by an independent \
                 measurement"
            ),
        }
    }
}

/// One of two explanations.
struct Contender {
    dynamics: Dynamics,
    values: Vec<f64>,
}

impl Contender {
    fn new(study: &Study<'_>, effects: &[FittedEffect], declared: &[f64]) -> Self {
        Self {
            dynamics: study.system.dynamics_with(effects, &study.sign),
            values: joined(declared, effects),
        }
    }

    /// The rival without effects that were taken back from the model since.
    fn of_rival(study: &Study<'_>, model: &Fitted, rival: &Rival) -> Self {
        let stands = |effect: &&FittedEffect| {
            let mut known = model.effects.iter().chain([&rival.effect]);
            known.any(|other| other.label() == effect.label())
        };
        let effects: Vec<FittedEffect> =
            rival.model.effects.iter().filter(stands).cloned().collect();
        Self::new(study, &effects, &rival.model.declared)
    }

    fn with(&self, payload: Option<&Payload>) -> Self {
        Self {
            dynamics: payload.map_or_else(|| self.dynamics.clone(), |p| p.on(&self.dynamics)),
            values: self.values.clone(),
        }
    }

    /// Fit to logs, every parameter free that the file does not fix: an experiment may determine what the present
    /// logs do not.
    fn refit(&self, shooting: &Shooting<'_>, locals: Vec<Vec<f64>>) -> Option<Fit> {
        let parameters = &self.dynamics.parameters;
        let active: Vec<usize> = (0..parameters.len())
            .filter(|&k| !parameters[k].fixed)
            .collect();
        fit(
            shooting,
            &self.dynamics,
            &active,
            &self.values,
            locals,
            Some(SCALE),
        )
        .ok()
    }
}

/// One of two explanations taken for the truth, the other for what is to be told from it.
struct Contest<'a> {
    study: &'a Study<'a>,
    truth: Contender,
    /// Fitted to the present logs as the truth has them.
    other: Contender,
    noise: Vec<f64>,
    /// The motion of the present logs as the truth has it, one log a window.
    present: Vec<Log>,
    /// Start states that the other takes there.
    locals: Vec<Vec<f64>>,
    /// Twice the loss that is left there, and the difference on each joint.
    loss: f64,
    differences: Vec<f64>,
    /// How many times more data it takes than independent normal residuals would.
    inflation: f64,
}

/// What came of simulating one experiment.
struct Test {
    text: String,
    joint: usize,
    difference: f64,
    present: f64,
    noise: f64,
    seconds: f64,
}

impl Test {
    /// What the best experiment has least of: seconds, as far as they matter.
    fn worth(&self) -> f64 {
        self.seconds.max(SHORT_S)
    }

    fn tells(&self) -> bool {
        self.seconds < LONG_S && self.deviation() > VISIBLE
    }

    fn deviation(&self) -> f64 {
        self.difference / self.noise
    }
}

impl<'a> Contest<'a> {
    fn new(
        study: &'a Study<'a>,
        model: &Fitted,
        truth: Contender,
        other: Contender,
    ) -> Option<Self> {
        let scale = model.fit.scale;
        let noise: Vec<f64> = study
            .shooting
            .noise
            .iter()
            .map(|noise| (noise * scale).max(FINEST))
            .collect();
        let motions = spread(study.shooting.windows.len(), PRESENT)
            .into_iter()
            .map(|w| window_of(study, model, w));
        let present: Option<Vec<Log>> = motions
            .map(|motion| motion.simulate(&truth.dynamics, &truth.values))
            .collect();
        let present = present?;
        let parts = windows(&present, WINDOW_S);
        let shooting = Shooting::new(&present, parts, &noise);
        let starts = shooting
            .windows
            .iter()
            .map(|w| start_of(&present, w))
            .collect();
        let found = other.refit(&shooting, starts)?;
        let loss = loss_of(&found);
        let all_s: f64 = study
            .shooting
            .windows
            .iter()
            .map(|w| w.duration_s(study.logs))
            .sum();
        // The logs did not tell, whatever the noise says: they hold no more than was needed.
        let too_sure = loss / duration_s(&shooting) * all_s / NEEDED;
        let differences = differences(&shooting, &other, &found, 0);
        Some(Self {
            inflation: inflation(study, model).max(too_sure),
            other: Contender {
                values: found.values,
                ..other
            },
            locals: found.locals,
            differences,
            study,
            truth,
            noise,
            present,
            loss,
        })
    }

    fn tests(&self, model: &Fitted, joints: &[usize]) -> Vec<Test> {
        let mut tests: Vec<Test> = proposals(self.study, model, joints)
            .iter()
            .filter_map(|proposal| self.test(proposal, None))
            .collect();
        let latest = self
            .present
            .iter()
            .flat_map(|log| &log.time)
            .fold(0.0_f64, |a, b| a.max(b.abs()));
        let delay_s = 2.0 * latest + 10.0;
        let declared = self.study.system.parameters.len();
        let payloads = Payload::all(&self.truth.dynamics, &self.truth.values, declared, delay_s);
        tests.extend(payloads.iter().filter_map(|payload| {
            let parameter = &self.truth.dynamics.parameters[payload.parameter];
            let text = format!(
                "a payload that raises `{}` by a known {:.3} {} ({:.0} %)",
                parameter.name,
                payload.extra,
                parameter.unit,
                100.0 * SHARE
            );
            let mut motions = as_logged(self.study, model);
            motions
                .iter_mut()
                .flat_map(|motion| &mut motion.time)
                .for_each(|time| *time += delay_s);
            self.test(
                &Proposal {
                    text,
                    motions,
                    turns: None,
                },
                Some(payload),
            )
        }));
        tests
    }

    /// Simulate an experiment; `None` where the rig cannot do it.
    fn test(&self, proposal: &Proposal, payload: Option<&Payload>) -> Option<Test> {
        let (truth, other) = (self.truth.with(payload), self.other.with(payload));
        let simulate = |motion: &Motion| motion.simulate(&truth.dynamics, &truth.values);
        let proposed: Option<Vec<Log>> = proposal.motions.iter().map(simulate).collect();
        let proposed = proposed.filter(|logs| self.is_possible(logs, proposal.turns))?;
        let logs = [self.present.as_slice(), &proposed].concat();
        let shooting = Shooting::new(&logs, windows(&logs, WINDOW_S), &self.noise);
        let present = self.locals.len();
        let starts = shooting.windows[present..]
            .iter()
            .map(|w| start_of(&logs, w));
        let found = other.refit(
            &shooting,
            self.locals.iter().cloned().chain(starts).collect(),
        )?;
        let duration_s: f64 = shooting.windows[present..]
            .iter()
            .map(|w| w.duration_s(&logs))
            .sum();
        let rate = (loss_of(&found) - self.loss).max(0.0) / duration_s;
        let differences = differences(&shooting, &other, &found, present);
        let share = |j: &usize| differences[*j] / self.noise[*j];
        let joint = (0..differences.len()).max_by(|a, b| share(a).total_cmp(&share(b)))?;
        Some(Test {
            text: proposal.text.clone(),
            joint,
            difference: differences[joint],
            present: self.differences[joint],
            noise: self.noise[joint],
            seconds: NEEDED * self.inflation / rate,
        })
    }

    fn is_possible(&self, logs: &[Log], turns: Option<usize>) -> bool {
        let slow = |log: &Log| {
            let mut joints = log.qd.iter().zip(&self.study.top_speed);
            joints.all(|(qd, top)| qd.iter().all(|v| v.abs() <= FASTEST * top))
        };
        logs.iter().all(slow) && turns.is_none_or(|j| logs.iter().any(|log| is_turn(&log.q[j])))
    }
}

/// The motion of one window of the logs.
fn window_of(study: &Study<'_>, model: &Fitted, w: usize) -> Motion {
    let window = study.shooting.windows[w];
    let log = &study.logs[window.log];
    let rows = window.first..=window.last;
    Motion {
        start: model.fit.locals[w].clone(),
        time: log.time[rows.clone()].to_vec(),
        tau: rows
            .map(|row| log.tau.iter().map(|tau| tau[row]).collect())
            .collect(),
    }
}

/// Twice the loss of a fit, in units of the noise.
fn loss_of(fit: &Fit) -> f64 {
    2.0 * SCALE * SCALE * fit.cost
}

fn duration_s(shooting: &Shooting<'_>) -> f64 {
    shooting
        .windows
        .iter()
        .map(|w| w.duration_s(shooting.logs))
        .sum()
}

/// Difference of the positions that a fit leaves on each joint, root mean square over the windows from `first` on.
fn differences(shooting: &Shooting<'_>, model: &Contender, fit: &Fit, first: usize) -> Vec<f64> {
    let n = model.dynamics.joints;
    let residuals = shooting.residuals(&model.dynamics, &fit.found(), &fit.locals);
    let residuals: Vec<f64> = residuals[first..].concat();
    let square = |j: usize| {
        residuals
            .iter()
            .skip(j)
            .step_by(n)
            .map(|r| r * r)
            .sum::<f64>()
    };
    #[allow(clippy::cast_precision_loss)] // a few thousand rows
    let rows = (residuals.len() / n).max(1) as f64;
    (0..n)
        .map(|j| (square(j) / rows).sqrt() * shooting.noise[j])
        .collect()
}

/// How much more the estimates of a fit scatter than independent normal residuals of its scale would let them, as a
/// ratio of variances, at least 1: residuals of measured logs are correlated.
fn inflation(study: &Study<'_>, model: &Fitted) -> f64 {
    let size = model.fit.columns.len();
    let covariance = uncertainty(&study.shooting, &model.fit).covariance;
    let mut all = model.fit.nothing();
    for window in &model.fit.reduced {
        window.add_to(&mut all);
    }
    #[allow(clippy::cast_precision_loss)] // few parameters
    let mean = (covariance * all.hessian).trace() / size.max(1) as f64;
    mean.max(1.0)
}
