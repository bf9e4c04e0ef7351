use super::Dynamics;
use crate::expr::Tape;
use crate::lanes::{Element, Row};

/// Open-loop integration of `W` independent trajectories of one model, by the classical Runge-Kutta
/// method of order 4 with the torque held over each step or substep.
pub struct Rollout<'d, T, const W: usize> {
    tape: Tape<'d, T, W>,
    joints: usize,
    slopes: [Vec<Row<T, W>>; 4],
    inner: Vec<Row<T, W>>,
}

impl<'d, T: Element, const W: usize> Rollout<'d, T, W> {
    /// Working memory for `dynamics` with parameters `values`, in its order.
    ///
    /// # Panics
    /// When `values` has not one entry a parameter.
    pub fn new(dynamics: &'d Dynamics, values: &[f64]) -> Self {
        assert_eq!(
            values.len(),
            dynamics.parameters.len(),
            "one value for each parameter"
        );
        let mut tape = dynamics.program.tape();
        let joints = dynamics.joints;
        for (slot, value) in tape.inputs()[3 * joints + 1..].iter_mut().zip(values) {
            *slot = Row::splat(T::from_f64(*value).expect("every f64 has a nearest float"));
        }
        let states = || vec![Row::splat(T::zero()); 2 * joints];
        Self {
            tape,
            joints,
            slopes: std::array::from_fn(|_| states()),
            inner: states(),
        }
    }

    /// Let a parameter have another value in one lane.
    pub fn set_in_lane(&mut self, parameter: usize, lane: usize, value: f64) {
        let first = 3 * self.joints + 1;
        self.tape.inputs()[first + parameter][lane] =
            T::from_f64(value).expect("every f64 has a nearest float");
    }

    /// Advance `state` (`[2n][lane]`: angles, then velocities) from `time` by `dt` seconds in `substeps`
    /// equal steps under the torque `tau` (`[n][lane]`) or, where it differs, one such after the other for each
    /// substep.
    pub fn advance(
        &mut self,
        state: &mut [Row<T, W>],
        tau: &[Row<T, W>],
        time: Row<T, W>,
        dt: Row<T, W>,
        substeps: usize,
    ) {
        let n = self.joints;
        let parts = T::from_usize(substeps).expect("few substeps");
        let h = Row(dt.map(|dt| dt / parts));
        let mut now = time;
        for tau in tau.chunks(n).cycle().take(substeps) {
            self.tape.inputs()[2 * n..3 * n].copy_from_slice(tau);
            self.step(state, now, h);
            now = Row(std::array::from_fn(|lane| now[lane] + h[lane]));
        }
    }

    fn step(&mut self, state: &mut [Row<T, W>], time: Row<T, W>, h: Row<T, W>) {
        let number = |value: f64| T::from_f64(value).expect("a small constant");
        let stages = [(0.0, None), (0.5, Some(0)), (0.5, Some(1)), (1.0, Some(2))];
        for (k, (part, previous)) in stages.into_iter().enumerate() {
            let part = number(part);
            for (i, inner) in self.inner.iter_mut().enumerate() {
                *inner = state[i];
                if let Some(previous) = previous {
                    let slope = &self.slopes[previous][i];
                    for lane in 0..W {
                        inner[lane] = inner[lane] + part * h[lane] * slope[lane];
                    }
                }
            }
            let stage_time = Row(std::array::from_fn(|lane| time[lane] + part * h[lane]));
            self.derivative(stage_time, k);
        }
        let (sixth, two) = (number(1.0 / 6.0), number(2.0));
        for (i, value) in state.iter_mut().enumerate() {
            let [a, b, c, d] = [0, 1, 2, 3].map(|k| &self.slopes[k][i]);
            for lane in 0..W {
                let mean = a[lane] + two * (b[lane] + c[lane]) + d[lane];
                value[lane] = value[lane] + sixth * h[lane] * mean;
            }
        }
    }

    /// Slope number `k` at the inner state.
    fn derivative(&mut self, time: Row<T, W>, k: usize) {
        let n = self.joints;
        let inputs = self.tape.inputs();
        inputs[..2 * n].copy_from_slice(&self.inner);
        inputs[3 * n] = time;
        self.tape.run();
        for (i, slope) in self.slopes[k].iter_mut().enumerate() {
            *slope = *self.tape.output(i);
        }
    }
}
