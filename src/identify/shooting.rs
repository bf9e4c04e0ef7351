use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

use super::sensitivity::{LANES, Lane, Tangent, TangentStepper};
use super::values::Values;
use crate::data::{Log, half_width_s};
use crate::lanes::{Row, Simd, WithSimd};
use crate::model::Dynamics;
use crate::sim::{Commands, FIT_S, Hold, Point, RK4, Simulator, Window, initial_state, substeps};

/// Residuals larger than this many scales enter the loss linearly instead of quadratically (Huber 1964). Outliers
/// lose their influence, while only 0.3 % of a normal sample are affected.
const HUBER: f64 = 3.0;

/// Multiple shooting: least squares over windows of logs. In each window the model is integrated from a free start
/// state and compared with the logged positions at every row.
pub struct Shooting<'l> {
    pub logs: &'l [Log],
    pub windows: Vec<Window>,
    /// Standard deviation of the position noise, per joint, in rad (or m).
    pub noise: Vec<f64>,
    packs: Vec<Pack>,
}

/// The normal equations of a window: shared parameters first, then the window's own free values.
#[derive(Debug, Clone)]
pub struct WindowTerms {
    /// Sum of the Huber losses of the residuals.
    pub cost: f64,
    pub gradient: DVector<f64>,
    pub hessian: DMatrix<f64>,
}

impl WindowTerms {
    /// Zero normal equations of this many free values.
    pub fn zeros(values: usize) -> Self {
        Self {
            cost: 0.0,
            gradient: DVector::zeros(values),
            hessian: DMatrix::zeros(values, values),
        }
    }
}

/// Up to [`LANES`] windows integrated side by side. Shorter windows are padded with steps of zero length and rows of
/// zero weight.
struct Pack {
    windows: Vec<usize>,
    /// The log of each lane.
    logs: [usize; LANES],
    /// `[row][lane]`: the row of the lane's log.
    at: Vec<[usize; LANES]>,
    time: Vec<Lane>,
    dt: Vec<Lane>,
    substeps: Vec<usize>,
    /// `[row][joint]`
    tau: Vec<Vec<Lane>>,
    q: Vec<Vec<Lane>>,
    /// `[row][joint]`: 1 / noise, or 0 where the lane has no such row.
    weight: Vec<Vec<Lane>>,
}

impl<'l> Shooting<'l> {
    /// # Panics
    /// When `noise` has not one entry a joint of the logs.
    pub fn new(logs: &'l [Log], windows: Vec<Window>, noise: &[f64]) -> Self {
        let mut order: Vec<usize> = (0..windows.len()).collect();
        // Windows of similar length share a pack, which keeps the padding small.
        order.sort_by_key(|&w| windows[w].rows());
        let packs = order
            .chunks(LANES)
            .map(|chunk| Pack::new(logs, &windows, chunk, noise))
            .collect();
        Self {
            logs,
            windows,
            noise: noise.to_vec(),
            packs,
        }
    }

    /// The same windows, integrated in substeps of at most `longest_s`.
    #[must_use]
    pub fn in_steps_of(mut self, longest_s: f64) -> Self {
        for pack in &mut self.packs {
            pack.cut(longest_s);
        }
        self
    }

    /// Initial guess of each window's start state, followed by `extra` zeros.
    pub fn initial_locals(&self, extra: usize) -> Vec<Vec<f64>> {
        let half_widths: Vec<f64> = self
            .logs
            .iter()
            .map(|log| half_width_s(log.median_step()))
            .collect();
        let guess = |window: &Window| {
            let log = &self.logs[window.log];
            let mut state = initial_state(log, half_widths[window.log], window.first)
                .expect("cut() checks this");
            state.resize(state.len() + extra, 0.0);
            state
        };
        self.windows.iter().map(guess).collect()
    }

    /// Normalised residuals (model - log) / noise of every window: `[window][row * n + joint]`.
    pub fn residuals(
        &self,
        dynamics: &Dynamics,
        values: &Values,
        locals: &[Vec<f64>],
    ) -> Vec<Vec<f64>> {
        let n = dynamics.joints;
        let commands = self.commands(dynamics, values);
        let per_pack: Vec<Vec<(usize, Vec<f64>)>> = self
            .packs
            .par_iter()
            .map(|pack| {
                let mut all: Vec<(usize, Vec<f64>)> =
                    pack.windows.iter().map(|&w| (w, Vec::new())).collect();
                pack.roll(dynamics, values, &commands, locals, |row, q| {
                    for (lane, (window, residuals)) in all.iter_mut().enumerate() {
                        if row < self.windows[*window].rows() {
                            residuals.extend((0..n).map(|j| {
                                (q[j][lane] - pack.q[row][j][lane]) * pack.weight[row][j][lane]
                            }));
                        }
                    }
                });
                all
            })
            .collect();
        let mut out = vec![Vec::new(); self.windows.len()];
        for (window, residuals) in per_pack.into_iter().flatten() {
            out[window] = residuals;
        }
        out
    }

    /// The Huber loss of each window at residual scale `scale`; infinite where the model diverges.
    pub fn costs(
        &self,
        dynamics: &Dynamics,
        values: &Values,
        locals: &[Vec<f64>],
        scale: f64,
    ) -> Vec<f64> {
        self.residuals(dynamics, values, locals)
            .iter()
            .map(|residuals| residuals.iter().map(|r| loss(r / scale).0).sum::<f64>())
            .map(|cost| {
                if cost.is_finite() {
                    cost
                } else {
                    f64::INFINITY
                }
            })
            .collect()
    }

    /// The torques of each log as filtered by the model's delays and lags.
    fn commands(&self, dynamics: &Dynamics, values: &Values) -> Vec<Commands<'l>> {
        let of_log = |(index, log)| {
            let point = Point::new(dynamics, values.of_log(index));
            Commands::of_log(&point, log)
        };
        self.logs.iter().enumerate().map(of_log).collect()
    }

    /// Cost, gradient and Gauss-Newton matrix of each window.
    pub(super) fn linearise(
        &self,
        dynamics: &Dynamics,
        tangent: &Tangent,
        values: &Values,
        locals: &[Vec<f64>],
        scale: f64,
    ) -> Vec<WindowTerms> {
        let commands = self.commands(dynamics, values);
        let per_pack: Vec<Vec<(usize, WindowTerms)>> = self
            .packs
            .par_iter()
            .map(|pack| pack.linearise(tangent, values, &commands, locals, scale))
            .collect();
        let mut all: Vec<_> = per_pack.into_iter().flatten().collect();
        all.sort_by_key(|(window, _)| *window);
        all.into_iter().map(|(_, terms)| terms).collect()
    }
}

/// Huber's loss, and the weight with which iteratively reweighted least squares has the same gradient.
fn loss(residual: f64) -> (f64, f64) {
    let size = residual.abs();
    if size <= HUBER {
        (0.5 * residual * residual, 1.0)
    } else {
        (HUBER * (size - 0.5 * HUBER), HUBER / size)
    }
}

impl Pack {
    fn new(logs: &[Log], windows: &[Window], members: &[usize], noise: &[f64]) -> Self {
        let n = noise.len();
        let rows = members
            .iter()
            .map(|&w| windows[w].rows())
            .max()
            .unwrap_or(0);
        let zeros = || vec![vec![Row::splat(0.0); n]; rows];
        let mut pack = Self {
            windows: members.to_vec(),
            logs: std::array::from_fn(|lane| windows[members[lane.min(members.len() - 1)]].log),
            at: vec![[0; LANES]; rows],
            time: vec![Row::splat(0.0); rows],
            dt: vec![Row::splat(0.0); rows],
            substeps: Vec::new(),
            tau: zeros(),
            q: zeros(),
            weight: zeros(),
        };
        for lane in 0..LANES {
            // Empty lanes repeat the last window, without weight.
            let window = windows[members[lane.min(members.len() - 1)]];
            let log = &logs[window.log];
            for row in 0..rows {
                let at = (window.first + row).min(window.last);
                pack.at[row][lane] = at;
                pack.time[row][lane] = log.time[at];
                pack.dt[row][lane] = if at < window.last {
                    log.time[at + 1] - log.time[at]
                } else {
                    0.0
                };
                for j in 0..n {
                    pack.tau[row][j][lane] = log.tau[j][at];
                    pack.q[row][j][lane] = log.q[j][at];
                    let counts = lane < members.len() && row < window.rows();
                    pack.weight[row][j][lane] = if counts { 1.0 / noise[j] } else { 0.0 };
                }
            }
        }
        pack.cut(FIT_S);
        pack
    }

    /// Cut the steps between rows into substeps of at most `longest_s`.
    fn cut(&mut self, longest_s: f64) {
        self.substeps = self.dt.iter().map(|dt| substeps(dt, longest_s)).collect();
    }

    fn rows(&self) -> usize {
        self.time.len()
    }

    /// The local values of the pack's windows, one row per value.
    fn gather(&self, locals: &[Vec<f64>]) -> Vec<Lane> {
        let lane_of = |lane: usize| &locals[self.windows[lane.min(self.windows.len() - 1)]];
        (0..lane_of(0).len())
            .map(|k| Row(std::array::from_fn(|lane| lane_of(lane)[k])))
            .collect()
    }

    /// Call `set(parameter, lane, value)` for every value that belongs to the log of a single lane.
    fn own_values(&self, values: &Values, mut set: impl FnMut(usize, usize, f64)) {
        for own in &values.own {
            for lane in (0..LANES).filter(|&lane| self.logs[lane] == own.log) {
                set(own.parameter, lane, own.value);
            }
        }
    }

    /// The hold from `row` to the next. `force` holds the windows' own forces, if they have any.
    fn hold<'a>(
        &'a self,
        commands: &'a [Commands<'a>],
        row: usize,
        force: &'a [Lane],
    ) -> Hold<'a, LANES> {
        Hold {
            commands: self.logs.map(|log| &commands[log]),
            held: &self.tau[row],
            force,
            from: self.time[row],
            to: *self.time.get(row + 1).unwrap_or(&self.time[row]),
            length: self.dt[row],
            substeps: self.substeps[row],
        }
    }

    /// The torque that acted just before `row`.
    fn torque_before(&self, commands: &[Commands<'_>], row: usize) -> Vec<Lane> {
        Commands::just_before(self.logs.map(|log| &commands[log]), self.at[row])
    }

    /// Integrate the windows, calling `see(row, angles)` with the measured angles at each row.
    fn roll(
        &self,
        dynamics: &Dynamics,
        values: &Values,
        commands: &[Commands<'_>],
        locals: &[Vec<f64>],
        mut see: impl FnMut(usize, &[Lane]),
    ) {
        let mut state = self.gather(locals);
        let forces = state.split_off(dynamics.states());
        let model = Point::new(dynamics, values.common.as_slice());
        let mut simulator = Simulator::<LANES>::new(&model, RK4);
        simulator.state = state;
        self.own_values(values, |parameter, lane, value| {
            simulator.set_in_lane(parameter, lane, value);
        });
        for row in 0..self.rows() {
            let at = self.logs.map(|log| &commands[log]);
            let [angles, _] = simulator.shown(at, self.at[row]);
            see(row, angles);
            simulator.advance(&self.hold(commands, row, &forces));
        }
    }

    fn linearise(
        &self,
        tangent: &Tangent,
        values: &Values,
        commands: &[Commands<'_>],
        locals: &[Vec<f64>],
        scale: f64,
    ) -> Vec<(usize, WindowTerms)> {
        let (n, columns) = (tangent.joints, tangent.columns());
        let states = self.gather(locals);
        let mut sums = Sums::new(columns);
        let mut stepper = TangentStepper::new(tangent, &values.common, RK4);
        self.own_values(values, |parameter, lane, value| {
            stepper.set_in_lane(parameter, lane, value);
        });
        stepper.start(&states);
        for row in 0..self.rows() {
            let before = || self.torque_before(commands, row);
            let (angles, slopes) = stepper.shown(before, self.time[row]);
            for j in 0..n {
                let weight = Row(self.weight[row][j].map(|w| w / scale));
                let residual = Row(std::array::from_fn(|l| {
                    (angles[j][l] - self.q[row][j][l]) * weight[l]
                }));
                sums.add(&residual, &slopes[j * columns..][..columns], &weight);
            }
            stepper.advance(&self.hold(commands, row, &states[2 * n..]));
        }
        self.windows
            .iter()
            .enumerate()
            .map(|(lane, &window)| (window, sums.lane(lane)))
            .collect()
    }
}

/// Running sums of the normal equations of all lanes. The matrix is stored as its upper triangle.
struct Sums {
    columns: usize,
    cost: Lane,
    gradient: Vec<Lane>,
    triangle: Vec<Lane>,
}

impl Sums {
    fn new(columns: usize) -> Self {
        Self {
            columns,
            cost: Row::splat(0.0),
            gradient: vec![Row::splat(0.0); columns],
            triangle: vec![Row::splat(0.0); columns * (columns + 1) / 2],
        }
    }

    /// Add one measurement: its normalised residual, the sensitivities of the angle, and 1 / (noise scale).
    fn add(&mut self, residual: &Lane, sensitivities: &[Lane], weight: &Lane) {
        let losses = residual.map(loss);
        for lane in 0..LANES {
            self.cost[lane] += losses[lane].0;
        }
        Lane::dispatch(Add {
            sums: self,
            // Both are multiplied by the weight of Huber's loss.
            residual: Row(std::array::from_fn(|l| {
                losses[l].1 * weight[l] * residual[l]
            })),
            weight: Row(std::array::from_fn(|l| losses[l].1 * weight[l] * weight[l])),
            sensitivities,
        });
    }

    fn lane(&self, lane: usize) -> WindowTerms {
        let mut hessian = DMatrix::zeros(self.columns, self.columns);
        let mut entries = self.triangle.iter();
        for i in 0..self.columns {
            for j in i..self.columns {
                let value = entries.next().expect("the triangle has this entry")[lane];
                hessian[(i, j)] = value;
                hessian[(j, i)] = value;
            }
        }
        WindowTerms {
            cost: self.cost[lane],
            gradient: DVector::from_iterator(self.columns, self.gradient.iter().map(|g| g[lane])),
            hessian,
        }
    }
}

struct Add<'a> {
    sums: &'a mut Sums,
    residual: Lane,
    weight: Lane,
    sensitivities: &'a [Lane],
}

impl WithSimd for Add<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Sums {
            gradient, triangle, ..
        } = self.sums;
        for part in 0..Lane::parts::<S>() {
            let (residual, weight) = (self.residual.get(simd, part), self.weight.get(simd, part));
            let mut entries = triangle.as_mut_slice();
            for (i, sum) in gradient.iter_mut().enumerate() {
                let rest = &self.sensitivities[i..];
                let a = rest[0].get(simd, part);
                sum.set(part, a.mul_add(residual, sum.get(simd, part)));
                let scaled = a * weight;
                let (own, others) = entries.split_at_mut(rest.len());
                for (b, entry) in rest.iter().zip(own) {
                    let b = b.get(simd, part);
                    entry.set(part, b.mul_add(scaled, entry.get(simd, part)));
                }
                entries = others;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::{Shooting, Values};
    use crate::data::{Joint, Log};
    use crate::identify::cut;
    use crate::identify::sensitivity::{Local, Tangent};
    use crate::model::{FittedEffect, Library};

    /// Two seconds of an arbitrary motion and torque at 100 Hz.
    fn log() -> Log {
        let time: Vec<f64> = (0..200).map(|row| 0.01 * f64::from(row)).collect();
        let column = |f: fn(f64) -> f64| vec![time.iter().map(|t| f(*t)).collect::<Vec<f64>>()];
        Log {
            path: "some.csv".into(),
            q: column(|t| 0.01 * (3.0 * t).sin()),
            qd: column(|t| 0.03 * (3.0 * t).cos()),
            tau: column(|t| (20.0 * t).sin() + (31.0 * t).cos()),
            leave_out: Vec::new(),
            notes: Vec::new(),
            time,
        }
    }

    #[test]
    fn gradients_by_effects_with_memory_are_slopes_of_the_cost() {
        let library = Library::built_in();
        let effects = ["actuator_delay", "actuator_lag", "backlash"]
            .map(|name| FittedEffect::absent(library.effect(name).unwrap(), Joint::at(0)));
        let pendulum = library.model(Path::new("pendulum")).unwrap();
        let model = pendulum.with_effects(effects.to_vec()).dynamics();
        let logs = [log()];
        let shooting = Shooting::new(&logs, cut(&logs, 0.5), &[0.05]);
        for local in [Local::State, Local::StateAndForce] {
            let locals = shooting.initial_locals(usize::from(local == Local::StateAndForce));
            let tangent = Tangent::new(&model, &[1, 2, 3, 4], local);
            for (delay, lag) in [(0.0, 0.0), (0.0073, 0.015)] {
                let values = [15.0, 3.0, delay, lag, 0.01, 0.0];
                let point = |values: &[f64]| Values {
                    common: values.to_vec(),
                    own: Vec::new(),
                };
                let cost = |values: &[f64]| -> f64 {
                    shooting
                        .costs(&model, &point(values), &locals, 1.0)
                        .iter()
                        .sum()
                };
                let terms = shooting.linearise(&model, &tangent, &point(&values), &locals, 1.0);
                for (column, k) in [1, 2, 3, 4].into_iter().enumerate() {
                    let found: f64 = terms.iter().map(|terms| terms.gradient[column]).sum();
                    let mut moved = values;
                    moved[k] += 1e-7;
                    let wanted = (cost(&moved) - cost(&values)) / 1e-7;
                    assert!(
                        (found - wanted).abs() < 1e-4 * wanted.abs(),
                        "{local:?}, parameter {k} at {delay}, {lag}: {found} {wanted}"
                    );
                }
            }
        }
    }
}
