use std::sync::{Arc, Mutex, OnceLock, PoisonError};

use rayon::prelude::*;

use super::balance::{Acting, Balance, Rows};
use super::normal_equations::WindowTerms;
use super::pack::{Given, Pack};
use super::prior::Prior;
use super::sensitivity::{LANES, Local, Tangent};
use super::values::{Column, Values};
use crate::data::{Log, half_width_s};
use crate::model::{Dynamics, Model};
use crate::sim::{
    Case, Commands, Course, InternalRates, LoggedMotion, Point, Steps, Window, cut, initial_state,
};

/// Least squares over windows of logs.
///
/// By multiple shooting: in each window the model is integrated from a free start state and compared with the logged
/// positions at every row; the start state is compared with its estimate from the rows around it. Or by inverse
/// dynamics: the torques that the logged motion needs are compared with the logged ones.
///
/// A copy shares the batches of windows and the smoothed rows with its original.
#[derive(Clone)]
pub struct Shooting<'l> {
    pub logs: &'l [Log],
    pub windows: Vec<Window>,
    /// Standard deviation per joint: of the position noise in rad (or m), or of the torque in N m (or N).
    pub noise: Vec<f64>,
    /// The longest step of the integrator, in s.
    steps: Steps,
    measure: Measure,
    prior: Prior,
    /// The same logs cut into windows of other lengths, for each length requested so far: shared by all copies.
    cuts: Arc<Mutex<Vec<Cut>>>,
    /// How the logs move, once internal states have been asked for: shared by all copies.
    motions: Arc<OnceLock<Vec<LoggedMotion>>>,
}

/// What the model is compared with, window by window.
#[derive(Clone)]
enum Measure {
    Motion(Arc<Vec<Pack>>),
    Torques {
        /// One per log.
        rows: Arc<Vec<Rows>>,
        packs: Arc<Vec<Balance>>,
    },
}

/// Logs in windows of one length.
struct Cut {
    length_s: f64,
    windows: Vec<Window>,
    measure: Measure,
}

impl<'l> Shooting<'l> {
    /// # Panics
    /// If `noise` does not have one entry per joint of the logs.
    pub fn new(logs: &'l [Log], windows: Vec<Window>, noise: &[f64]) -> Self {
        let mut order: Vec<usize> = (0..windows.len()).collect();
        // Windows of similar length share a pack, which keeps the padding small.
        order.sort_by_key(|&w| windows[w].rows());
        let half_widths = half_widths(logs);
        let pack = |chunk| Pack::new(logs, &windows, chunk, noise, &half_widths);
        let packs = order.chunks(LANES).map(pack).collect();
        let measure = Measure::Motion(Arc::new(packs));
        Self::of(logs, windows, noise, measure)
    }

    fn of(logs: &'l [Log], windows: Vec<Window>, noise: &[f64], measure: Measure) -> Self {
        Self {
            logs,
            windows,
            noise: noise.to_vec(),
            steps: Steps::FIT,
            measure,
            prior: Prior::default(),
            cuts: Arc::default(),
            motions: Arc::default(),
        }
    }

    /// The torques of the logged motion, for models compiled by [`Model::smoothed_torque_balance`]. Windows in which no
    /// row is used are dropped. Friction reverses over the speeds `smoothing_velocities`.
    ///
    /// # Panics
    /// If `noise` or `smoothing_velocities` do not have one entry per joint of the logs.
    pub fn of_torques(
        logs: &'l [Log],
        windows: Vec<Window>,
        noise: &[f64],
        smoothing_velocities: &[f64],
    ) -> Self {
        let of_log = |log| Rows::of(log, smoothing_velocities);
        let rows = logs.par_iter().map(of_log).collect();
        Self::of_rows(logs, Arc::new(rows), windows, noise)
    }

    fn of_rows(
        logs: &'l [Log],
        rows: Arc<Vec<Rows>>,
        mut windows: Vec<Window>,
        noise: &[f64],
    ) -> Self {
        let within = |window: &Window| rows[window.log].within(&logs[window.log], window);
        windows.retain(|window| !within(window).is_empty());
        let order: Vec<usize> = (0..windows.len()).collect();
        let pack = |chunk| Balance::new(logs, &rows, &windows, chunk, noise);
        let packs = Arc::new(order.chunks(LANES).map(pack).collect());
        Self::of(logs, windows, noise, Measure::Torques { rows, packs })
    }

    /// The logs cut into windows of this length in s; each length is cut only once, however often it is requested.
    #[must_use]
    pub fn cut_into(&self, length_s: f64) -> Self {
        let mut cuts = self.cuts.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(known) = cuts.iter().find(|cut| cut.length_s == length_s) {
            return Self {
                windows: known.windows.clone(),
                measure: known.measure.clone(),
                ..self.clone()
            };
        }
        let new = self.over(cut(self.logs, length_s));
        cuts.push(Cut {
            length_s,
            windows: new.windows.clone(),
            measure: new.measure.clone(),
        });
        new
    }

    /// Other windows of the same logs, of the same rig.
    #[must_use]
    pub fn over(&self, windows: Vec<Window>) -> Self {
        self.with(windows, &self.noise)
    }

    /// The same windows with other joint noise.
    #[must_use]
    pub fn with_noise(&self, noise: &[f64]) -> Self {
        self.with(self.windows.clone(), noise)
    }

    fn with(&self, windows: Vec<Window>, noise: &[f64]) -> Self {
        let mut other = match &self.measure {
            Measure::Motion(_) => Self::new(self.logs, windows, noise),
            Measure::Torques { rows, .. } => {
                Self::of_rows(self.logs, Arc::clone(rows), windows, noise)
            }
        };
        other.prior = self.prior.clone();
        other.motions = Arc::clone(&self.motions);
        match self.steps == Steps::FIT {
            true => other,
            false => other.in_steps(self.steps),
        }
    }

    /// What is free in each window, judged by these values.
    pub(super) fn local(&self, start_states: &[Vec<f64>]) -> Local {
        let states = 2 * self.noise.len();
        match &self.measure {
            Measure::Torques { .. } => Local::Nothing,
            Measure::Motion(_) if start_states.first().is_some_and(|l| l.len() > states) => {
                Local::StateAndForce
            }
            Measure::Motion(_) => Local::State,
        }
    }

    /// The same windows without estimates of their start states.
    #[must_use]
    pub fn with_free_starts(mut self) -> Self {
        if let Measure::Motion(packs) = &mut self.measure {
            Arc::make_mut(packs).iter_mut().for_each(Pack::free_starts);
        }
        self
    }

    /// The same windows, for a rig whose parameters are known to be near the declared ones in size.
    #[must_use]
    pub fn near(mut self, declared: &Model) -> Self {
        self.prior = Prior::near(declared);
        self
    }

    /// The cost of the free values' departure from the declared ones.
    pub(super) fn prior_cost(&self, columns: &[Column], values: &Values) -> f64 {
        (self.prior).cost(columns, values, self.residuals_of_a_window())
    }

    /// Its gradient and Gauss-Newton matrix.
    pub(super) fn prior_terms(&self, columns: &[Column], values: &Values) -> WindowTerms {
        (self.prior).terms(columns, values, self.residuals_of_a_window())
    }

    /// What is declared of bodies, as information on the free values, with the cost of their departure.
    pub(super) fn declared_bodies(&self, columns: &[Column], values: &Values) -> WindowTerms {
        (self.prior).terms_of_bodies(columns, values, self.residuals_of_a_window())
    }

    /// The number of residuals that say as much as the declared values do: residuals are correlated, and a few windows
    /// overrule the declared values. In a motion the joints depend on each other; joint torques err independently.
    fn residuals_of_a_window(&self) -> f64 {
        let residuals = match &self.measure {
            Measure::Motion(_) => {
                let rows: usize = self.windows.iter().map(Window::rows).sum();
                rows * self.noise.len()
            }
            Measure::Torques { packs, .. } => packs.iter().map(Balance::rows).sum(),
        };
        residuals as f64 / self.windows.len().max(1) as f64
    }

    /// How motion is integrated.
    pub fn steps(&self) -> Steps {
        self.steps
    }

    /// The same windows, integrated in such steps.
    #[must_use]
    pub fn in_steps(mut self, steps: Steps) -> Self {
        (self.steps, self.cuts) = (steps, Arc::default());
        if let Measure::Motion(packs) = &mut self.measure {
            let packs = Arc::make_mut(packs).iter_mut();
            packs.for_each(|pack| pack.cut(steps));
        }
        self
    }

    /// Initial guess of each window's start state, followed by `extra` zeros.
    pub fn initial_start_states(&self, extra: usize) -> Vec<Vec<f64>> {
        if let Measure::Torques { .. } = self.measure {
            return vec![Vec::new(); self.windows.len()];
        }
        let half_widths = half_widths(self.logs);
        let guess = |window: &Window| {
            let log = &self.logs[window.log];
            let mut state = initial_state(log, half_widths[window.log], window.first)
                .expect("cut() checks this");
            state.resize(state.len() + extra, 0.0);
            state
        };
        self.windows.iter().map(guess).collect()
    }

    /// Normalised residuals (model - log) / noise of every window: `[window][row * n + joint]`. Those of torques at which
    /// a joint rests do not count and are zero.
    pub fn residuals(
        &self,
        dynamics: &Dynamics,
        values: &Values,
        start_states: &[Vec<f64>],
    ) -> Vec<Vec<f64>> {
        let n = dynamics.joints;
        let of_motion = |pack: &Pack, given: &Given<'_>| {
            let mut all: Vec<(usize, Vec<f64>)> =
                pack.windows.iter().map(|&w| (w, Vec::new())).collect();
            pack.roll(dynamics, values, given, start_states, |row, q| {
                for (lane, (window, residuals)) in all.iter_mut().enumerate() {
                    if row < self.windows[*window].rows() {
                        residuals.extend((0..n).map(|j| {
                            (q[j][lane] - pack.q[row][j][lane]) * pack.weight[row][j][lane]
                        }));
                    }
                }
            });
            all
        };
        let per_pack = self.per_pack(dynamics, values, None, of_motion, |pack, data| {
            pack.residuals(dynamics, values, data)
        });
        let mut out = vec![Vec::new(); self.windows.len()];
        for (window, residuals) in per_pack {
            out[window] = residuals;
        }
        out
    }

    /// Root mean square of a model's residual on each joint, in the unit of the noise.
    pub fn left_by(
        &self,
        dynamics: &Dynamics,
        values: &Values,
        start_states: &[Vec<f64>],
    ) -> Vec<f64> {
        let residuals = self.residuals(dynamics, values, start_states);
        let shares = rms_by_joint(&residuals, dynamics.joints);
        let noise = self.noise.iter().zip(shares);
        let left = |(noise, share): (&f64, f64)| match share > 0.0 {
            true => noise * share.max(1e-12),
            // No residual counts.
            false => *noise,
        };
        noise.map(left).collect()
    }

    /// The Huber loss of each window at residual scale `scale`, including its start state; infinite if the model
    /// diverges.
    pub fn costs(
        &self,
        dynamics: &Dynamics,
        values: &Values,
        start_states: &[Vec<f64>],
        scale: f64,
    ) -> Vec<f64> {
        let per_pack = self.per_pack(
            dynamics,
            values,
            None,
            |pack, given| pack.costs(dynamics, values, given, start_states, scale),
            |pack, data| pack.costs(dynamics, values, data, scale),
        );
        let mut out = vec![f64::INFINITY; self.windows.len()];
        let finite = |(_, cost): &(usize, f64)| cost.is_finite();
        for (window, cost) in per_pack.into_iter().filter(finite) {
            out[window] = cost;
        }
        out
    }

    /// The result of each window, computed for all packs at once; with the slopes of what logs give if there is a tangent.
    fn per_pack<T: Send>(
        &self,
        dynamics: &Dynamics,
        values: &Values,
        tangent: Option<&Tangent>,
        of_motion: impl Fn(&Pack, &Given<'_>) -> Vec<(usize, T)> + Sync,
        of_torques: impl Fn(&Balance, (&[Rows], &Acting)) -> Vec<(usize, T)> + Sync,
    ) -> Vec<(usize, T)> {
        match &self.measure {
            Measure::Motion(packs) => {
                let commands = self.commands(dynamics, values);
                let courses = self.courses(dynamics, values, tangent, &commands);
                let given = Given { commands, courses };
                let packs = packs.par_iter();
                packs.flat_map(|pack| of_motion(pack, &given)).collect()
            }
            Measure::Torques { rows, packs } => {
                let courses = match &dynamics.internal {
                    Some(_) => {
                        let commands = self.commands(dynamics, values);
                        self.courses(dynamics, values, tangent, &commands)
                    }
                    None => Vec::new(),
                };
                let slopes_of = tangent.map_or(&[][..], |_| &dynamics.filters);
                let acting = Acting::of(
                    dynamics,
                    values,
                    (self.logs, rows, &self.windows),
                    (&courses, slopes_of),
                );
                let packs = packs.par_iter();
                packs
                    .flat_map(|pack| of_torques(pack, (rows.as_slice(), &acting)))
                    .collect()
            }
        }
    }

    /// The torques of each log as filtered by the model's delays and lags.
    fn commands(&self, dynamics: &Dynamics, values: &Values) -> Vec<Commands<'l>> {
        let of_log = |(index, log)| {
            let point = Point::new(dynamics, values.of_log(index));
            Commands::of_log(&point, log)
        };
        self.logs.iter().enumerate().map(of_log).collect()
    }

    /// The internal states along each log, with their slopes if there is a tangent; none of a model without any.
    fn courses(
        &self,
        dynamics: &Dynamics,
        values: &Values,
        tangent: Option<&Tangent>,
        commands: &[Commands<'_>],
    ) -> Vec<Course> {
        let plain = || InternalRates::plain(dynamics);
        let rates = tangent.map_or_else(plain, |tangent| tangent.internal.clone());
        let Some(rates) = rates else {
            return Vec::new();
        };
        let of_logs = || self.logs.par_iter().map(LoggedMotion::of).collect();
        let motions = self.motions.get_or_init(of_logs);
        let points = (0..self.logs.len()).map(|log| Point::new(dynamics, values.of_log(log)));
        let points: Vec<Point<'_>> = points.collect();
        let each = self.logs.iter().zip(&points).zip(motions).zip(commands);
        let case = |(((log, point), motion), commands)| Case {
            log,
            point,
            motion,
            commands,
        };
        rates.along(&each.map(case).collect::<Vec<_>>())
    }

    /// Cost, gradient and Gauss-Newton matrix of each window.
    pub(super) fn linearise(
        &self,
        dynamics: &Dynamics,
        tangent: &Tangent,
        values: &Values,
        start_states: &[Vec<f64>],
        scale: f64,
    ) -> Vec<WindowTerms> {
        let mut all = self.per_pack(
            dynamics,
            values,
            Some(tangent),
            |pack, given| pack.linearise(tangent, values, given, start_states, scale),
            |pack, data| pack.linearise(tangent, values, data, scale),
        );
        all.sort_by_key(|(window, _)| *window);
        for (window, terms) in &mut all {
            let given = values.given_in(self.windows[*window].log);
            let is_given = |k: usize| tangent.active.iter().position(|active| *active == k);
            given.filter_map(is_given).for_each(|k| terms.forget(k));
        }
        all.into_iter().map(|(_, terms)| terms).collect()
    }
}

/// Root mean square of each joint's residuals, `[window][row * joints + joint]`; those that do not count are zero.
pub(crate) fn rms_by_joint(residuals: &[Vec<f64>], joints: usize) -> Vec<f64> {
    let mut sums = vec![(0.0, 0.0_f64); joints];
    let rows = residuals
        .iter()
        .flat_map(|window| window.chunks_exact(joints));
    for row in rows {
        for (sum, residual) in sums.iter_mut().zip(row) {
            *sum = (
                sum.0 + residual * residual,
                sum.1 + f64::from(u8::from(*residual != 0.0)),
            );
        }
    }
    let root = |(squares, rows): (f64, f64)| (squares / rows.max(1.0)).sqrt();
    sums.into_iter().map(root).collect()
}

/// Half width of the cubics that estimate start states, in s, one per log.
fn half_widths(logs: &[Log]) -> Vec<f64> {
    let of_log = |log: &Log| half_width_s(log.median_step());
    logs.iter().map(of_log).collect()
}

#[cfg(test)]
mod tests {

    use std::sync::Arc;

    use super::{Measure, Pack, Shooting, Values};
    use crate::data::{Joint, Log};
    use crate::identify::sensitivity::{Local, Tangent};
    use crate::identify::{cut, free_parameters};
    use crate::model::{Dynamics, FittedEffect, Library, Model, elastic};
    use crate::sim::{Steps, bristles};

    /// Two seconds of an arbitrary motion and torque at 100 Hz.
    fn log() -> Log {
        let time: Vec<f64> = (0..200).map(|row| 0.01 * f64::from(row)).collect();
        let column = |f: fn(f64) -> f64| vec![time.iter().map(|t| f(*t)).collect::<Vec<f64>>()];
        Log {
            q: column(|t| 0.01 * (3.0 * t).sin()),
            qd: column(|t| 0.03 * (3.0 * t).cos()),
            tau: column(|t| (20.0 * t).sin() + (31.0 * t).cos()),
            time,
            ..Log::empty(1)
        }
    }

    /// The same with a second joint that moves like the first.
    fn two_joints() -> Log {
        let mut log = log();
        for channels in [&mut log.q, &mut log.qd, &mut log.tau] {
            let second = channels[0].iter().map(|x| 0.7 * x + 0.1).collect();
            channels.push(second);
        }
        log.masked.push(Vec::new());
        log
    }

    fn packs(shooting: &Shooting<'_>) -> Arc<Vec<Pack>> {
        match &shooting.measure {
            Measure::Motion(packs) => Arc::clone(packs),
            Measure::Torques { .. } => panic!("of a motion"),
        }
    }

    #[test]
    fn copies_share_their_windows_until_one_is_changed() {
        let logs = [log()];
        let shooting = Shooting::new(&logs, cut(&logs, 0.5), &[0.05]);
        let copy = shooting.clone();
        assert!(Arc::ptr_eq(&packs(&shooting), &packs(&copy)));
        let [first, again] = [&shooting, &copy].map(|of| of.cut_into(0.15));
        assert_eq!(first.windows, cut(&logs, 0.15));
        assert!(Arc::ptr_eq(&packs(&first), &packs(&again)));
        let fine = copy.in_steps(Steps::FIT.at_most(1e-3));
        assert!(!Arc::ptr_eq(&packs(&shooting), &packs(&fine)));
    }

    /// Each free parameter with the gradient of the cost, and the cost after a step of that parameter.
    fn gradients<'a>(
        shooting: &'a Shooting<'_>,
        model: &'a Dynamics,
        tangent: &'a Tangent,
        values: &'a [f64],
        start_states: &'a [Vec<f64>],
    ) -> impl Iterator<Item = (usize, f64, impl Fn(f64) -> f64 + 'a)> + 'a {
        let point = |common: Vec<f64>| {
            let own = Vec::new();
            Values { common, own }
        };
        let terms = shooting.linearise(model, tangent, &point(values.to_vec()), start_states, 1.0);
        assert!(terms.len() > 1);
        tangent.active.iter().enumerate().map(move |(column, &k)| {
            let found = terms.iter().map(|terms| terms.gradient[column]).sum();
            let cost = move |step: f64| -> f64 {
                let mut moved = values.to_vec();
                moved[k] += step;
                let costs = shooting.costs(model, &point(moved), start_states, 1.0);
                costs.iter().sum()
            };
            (k, found, cost)
        })
    }

    #[test]
    fn gradients_of_torques_are_slopes_of_the_cost() {
        let library = Library::built_in();
        let effects = ["actuator_delay", "actuator_lag", "coulomb_friction"]
            .map(|name| FittedEffect::absent(library.effect(name).unwrap(), Joint::at(0)));
        let arm = library.model("acrobot").unwrap();
        let model = arm.with_effects(effects.to_vec());
        let model = model.smoothed_torque_balance().unwrap();
        let logs = [two_joints()];
        let shooting = Shooting::of_torques(&logs, cut(&logs, 0.5), &[0.5, 0.2], &[0.01; 2]);
        let start_states = shooting.initial_start_states(0);
        let tangent = Tangent::new(&model, &free_parameters(&model), Local::Nothing);
        let mut values = model.values();
        let first = values.len() - 3;
        values[first..].copy_from_slice(&[0.0073, 0.015, 0.1]);
        for (k, found, cost) in gradients(&shooting, &model, &tangent, &values, &start_states) {
            let wanted = (cost(1e-6) - cost(-1e-6)) / 2e-6;
            let off = (found - wanted).abs() / wanted.abs().max(1e-6);
            assert!(off < 1e-2, "{}: {found} {wanted}", model.parameters[k].name);
        }
    }

    #[test]
    fn gradients_by_effects_with_memory_are_slopes_of_the_cost() {
        let library = Library::built_in();
        let effects = ["actuator_delay", "actuator_lag", "backlash"]
            .map(|name| FittedEffect::absent(library.effect(name).unwrap(), Joint::at(0)));
        let pendulum = library.model("pendulum").unwrap();
        let model = pendulum.with_effects(effects.to_vec()).dynamics();
        let logs = [log()];
        let shooting = Shooting::new(&logs, cut(&logs, 0.5), &[0.05]);
        for local in [Local::State, Local::StateAndForce] {
            let start_states =
                shooting.initial_start_states(usize::from(local == Local::StateAndForce));
            let tangent = Tangent::new(&model, &[1, 2, 3, 4], local);
            for (delay, lag) in [(0.0, 0.0), (0.0073, 0.015)] {
                let values = [15.0, 3.0, delay, lag, 0.01, 0.0];
                for (k, found, cost) in
                    gradients(&shooting, &model, &tangent, &values, &start_states)
                {
                    let wanted = (cost(1e-7) - cost(0.0)) / 1e-7;
                    let off = (found - wanted).abs() / wanted.abs();
                    assert!(
                        off < 1e-4,
                        "{local:?}, {k} at {delay}, {lag}: {found} {wanted}"
                    );
                }
            }
        }
    }

    #[test]
    fn gradients_through_internal_states_are_slopes_of_the_cost() {
        let library = Library::built_in();
        let delay = library.effect("actuator_delay").unwrap();
        let mut delay = FittedEffect::absent(delay, Joint::at(0));
        delay.values[0].0 = 0.0073;
        let arm = library.model("acrobot").unwrap();
        for sides in [None, Some([0.0, 1.0]), Some([1.0, 0.0])] {
            let elastic = sides.map(|sides| elastic(Joint::at(1), sides));
            let effects = [bristles(Joint::at(0)), delay.clone()]
                .into_iter()
                .chain(elastic);
            gradients_are_slopes(&arm.with_effects(effects.collect()));
        }
    }

    fn gradients_are_slopes(model: &Model) {
        let (motion, torques) = (model.dynamics(), model.smoothed_torque_balance().unwrap());
        let mut log = two_joints();
        log.q[0].iter_mut().for_each(|q| *q *= 20.0);
        let logs = [log];
        let windows = || cut(&logs, 0.5);
        let of_motion = Shooting::new(&logs, windows(), &[0.05; 2]);
        let of_torques = Shooting::of_torques(&logs, windows(), &[0.5; 2], &[0.01; 2]);
        for (shooting, model, local) in [
            (of_motion, motion, Local::State),
            (of_torques, torques, Local::Nothing),
        ] {
            let start_states = shooting.initial_start_states(0);
            let tangent = Tangent::new(&model, &free_parameters(&model), local);
            let values = model.values();
            for (k, found, cost) in gradients(&shooting, &model, &tangent, &values, &start_states) {
                let wanted = (cost(1e-6) - cost(-1e-6)) / 2e-6;
                let off = (found - wanted).abs() / wanted.abs().max(1e-3);
                let name = &model.parameters[k].name;
                assert!(off < 1e-3, "{local:?}, {name}: {found} {wanted}");
            }
        }
    }
}
