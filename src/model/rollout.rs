use super::Dynamics;
use crate::expr::Tape;
use crate::lanes::{Element, Row, Simd, WithSimd};

/// Open-loop integration of `W` independent trajectories of one model, by the classical Runge-Kutta
/// method of order 4 with the torque held over each step or substep.
pub struct Rollout<'d, T, const W: usize> {
    tape: Tape<'d, T, W>,
    joints: usize,
    slope: Vec<Row<T, W>>,
    sum: Vec<Row<T, W>>,
}

/// The classical Runge-Kutta method: weight of a stage's slope in the sum, and time and reach of the next stage.
const STAGES: [(f64, f64); 4] = [
    (1.0 / 6.0, 0.5),
    (1.0 / 3.0, 0.5),
    (1.0 / 3.0, 1.0),
    (1.0 / 6.0, 0.0),
];

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
        let joints = dynamics.joints;
        let mut tape = dynamics.program.tape_with_held(3 * joints + 1);
        for (slot, value) in tape.inputs()[3 * joints + 1..].iter_mut().zip(values) {
            *slot = Row::splat(T::from_f64(*value).expect("every f64 has a nearest float"));
        }
        let states = || vec![Row::splat(T::zero()); 2 * joints];
        Self {
            tape,
            joints,
            slope: states(),
            sum: states(),
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
        Row::<T, W>::dispatch(Advance {
            rollout: self,
            state,
            tau,
            time,
            dt,
            substeps,
        });
    }

    #[inline(always)]
    fn step<S: Simd>(
        &mut self,
        simd: S,
        state: &mut [Row<T, W>],
        time: &mut Row<T, W>,
        h: &Row<T, W>,
    ) {
        let n = self.joints;
        self.tape.moving()[..2 * n].copy_from_slice(state);
        self.sum.copy_from_slice(state);
        self.tape.moving()[3 * n] = *time;
        for (weight, reach) in STAGES {
            self.tape.run_on(simd);
            for (k, slope) in self.slope.iter_mut().enumerate() {
                *slope = *self.tape.output(k);
            }
            let inputs = self.tape.moving();
            for part in 0..Row::<T, W>::parts::<S>() {
                let h = h.get(simd, part);
                let (weighed, reached) = (h * h.like(weight), h * h.like(reach));
                let rows = self.sum.iter_mut().zip(&mut inputs[..2 * n]);
                for (((sum, inner), now), slope) in rows.zip(&*state).zip(&self.slope) {
                    let slope = slope.get(simd, part);
                    sum.set(part, slope.mul_add(weighed, sum.get(simd, part)));
                    inner.set(part, slope.mul_add(reached, now.get(simd, part)));
                }
                inputs[3 * n].set(part, time.get(simd, part) + reached);
            }
        }
        state.copy_from_slice(&self.sum);
        for part in 0..Row::<T, W>::parts::<S>() {
            time.set(part, time.get(simd, part) + h.get(simd, part));
        }
    }
}

struct Advance<'a, 'd, T, const W: usize> {
    rollout: &'a mut Rollout<'d, T, W>,
    state: &'a mut [Row<T, W>],
    tau: &'a [Row<T, W>],
    time: Row<T, W>,
    dt: Row<T, W>,
    substeps: usize,
}

impl<T: Element, const W: usize> WithSimd for Advance<'_, '_, T, W> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(mut self, simd: S) {
        let n = self.rollout.joints;
        let parts = T::from_usize(self.substeps).expect("few substeps");
        let h = Row(self.dt.map(|dt| dt / parts));
        for tau in self.tau.chunks(n).cycle().take(self.substeps) {
            self.rollout.tape.moving()[2 * n..3 * n].copy_from_slice(tau);
            self.rollout.step(simd, self.state, &mut self.time, &h);
        }
    }
}
