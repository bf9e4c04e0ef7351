use rand::{Rng, RngExt};

use crate::closeloop::fitted::Fitted;
use crate::closeloop::problem::Problem;
use crate::data::{Log, half_width_s, row_from};
use crate::identify::{FitError, Values, Window, blocks, count, fit};
use crate::model::FittedEffect;

/// The training logs as they would be if an accepted model were the truth.
///
/// A rig that balances upright cannot be simulated open loop over a whole log. Each window is simulated from its fitted
/// start state instead, under the logged torques, and the windows are separated in time: cutting such logs into windows
/// finds the same windows again, and no motion jumps within one.
pub(super) struct SimulatedLogs<'a> {
    problem: &'a Problem<'a>,
    accepted: &'a Fitted,
    /// The windows of each training log, a pause before each.
    apart: Vec<Log>,
    windows: Vec<Window>,
    start_states: Vec<Vec<f64>>,
    /// Model minus log in units of the noise: `[window][row * joints + joint]`.
    residuals: Vec<Vec<f64>>,
    /// The block that each window belongs to.
    members: Vec<usize>,
}

impl<'a> SimulatedLogs<'a> {
    /// # Errors
    /// A model that diverges on the logs, or logs without a window.
    pub fn new(problem: &'a Problem<'a>, accepted: &'a Fitted) -> Result<Self, FitError> {
        let apart = apart(problem);
        let rig = problem.on(&apart);
        let dynamics = accepted.model.dynamics();
        let values = Values::of(&dynamics, &apart);
        let states = rig.shooting.initial_start_states(0);
        let scale = Some(accepted.fit.scale);
        let (_, fit) = fit(&rig.shooting, &dynamics, &[], states, scale)?;
        let start_states = fit.start_states;
        Ok(Self {
            problem,
            accepted,
            windows: rig.shooting.windows.clone(),
            residuals: rig.shooting.residuals(&dynamics, &values, &start_states),
            members: blocks(&rig.shooting),
            start_states,
            apart,
        })
    }

    /// Logs of the accepted model with `more` effects. The noise is the residuals of the accepted model, with the sign
    /// of each block drawn at random (the wild cluster bootstrap of Cameron, Gelbach and Miller 2008): colour, rounding
    /// and size stay, anything systematic vanishes. `None` if the motion diverges.
    pub fn draw(&self, more: &[FittedEffect], rng: &mut impl Rng) -> Option<Vec<Log>> {
        let dynamics = self.problem.extended(self.accepted, more);
        let values = Values::of(&dynamics, &self.apart);
        let rig = self.problem.on(&self.apart);
        let motion = (rig.shooting).residuals(&dynamics, &values, &self.start_states);
        if motion.iter().flatten().any(|x| !x.is_finite()) {
            return None;
        }
        let mut sign = |_| if rng.random::<bool>() { 1.0 } else { -1.0 };
        let signs: Vec<f64> = (0..count(&self.members)).map(&mut sign).collect();
        let mut logs = self.apart.clone();
        for (w, window) in self.windows.iter().enumerate() {
            let sign = signs[self.members[w]];
            let mut cells = motion[w].iter().zip(&self.residuals[w]);
            for row in window.first..=window.last {
                for (q, noise) in logs[window.log].q.iter_mut().zip(&rig.shooting.noise) {
                    let (motion, residual) =
                        cells.next().expect("a residual for each row and joint");
                    q[row] += noise * (motion - sign * residual);
                }
            }
        }
        Some(logs)
    }
}

/// Only the rows of the windows. Each window is preceded by one row at the edge of the range that the estimate of its
/// start state reads, and before that by a pause that no estimate or window spans.
fn apart(problem: &Problem<'_>) -> Vec<Log> {
    let pause = problem.settings.calibrate.pause_half_widths;
    let windows = &problem.shooting.windows;
    let block = |(index, log): (usize, &Log)| {
        let reach = half_width_s(log.median_step());
        let mut out = Log {
            path: log.path.clone(),
            driven_by: log.driven_by,
            notes: log.notes.clone(),
            measured: log.empty_measured(),
            ..Log::empty(log.joints())
        };
        for window in windows.iter().filter(|window| window.log == index) {
            let before = row_from(&log.time, log.time[window.first] - reach);
            let later = out
                .time
                .last()
                .map_or(0.0, |last| last + pause * reach - log.time[before]);
            for row in std::iter::once(before).chain(window.first..=window.last) {
                out.time.push(log.time[row] + later);
                for j in 0..log.joints() {
                    out.q[j].push(log.q[j][row]);
                    out.qd[j].push(log.qd[j][row]);
                    out.tau[j].push(log.held(j, row));
                }
                for (own, value) in out.measured.iter_mut().zip(log.measured_at(row)) {
                    own.values.push(value);
                }
            }
        }
        out
    };
    problem.logs.iter().enumerate().map(block).collect()
}
