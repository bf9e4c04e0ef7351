use super::{Point, Scheme};
use crate::expr::Tape;
use crate::lanes::{Row, Simd, WithSimd};
use crate::model::InputLayout;

/// Integration of `W` independent states of one model side by side, by one scheme.
pub struct Stepper<const W: usize> {
    scheme: &'static Scheme,
    tape: Tape<f64, W>,
    joints: usize,
    layout: InputLayout,
    slope: Vec<Row<f64, W>>,
    sum: Vec<Row<f64, W>>,
}

impl<const W: usize> Stepper<W> {
    /// A stepper of one model.
    pub fn new<'d>(model: impl Into<Point<'d>>, scheme: &'static Scheme) -> Self {
        let model = model.into();
        let dynamics = model.dynamics;
        let states = vec![Row::splat(0.0); dynamics.states()];
        let layout = dynamics.layout();
        Self {
            scheme,
            tape: (dynamics.program).tape_at(layout.parameters(), model.values()),
            joints: dynamics.joints,
            layout,
            slope: states.clone(),
            sum: states,
        }
    }

    /// Set the value of a parameter in one lane.
    pub fn set_in_lane(&mut self, parameter: usize, lane: usize, value: f64) {
        let first = self.layout.parameters();
        self.tape.inputs()[first + parameter][lane] = value;
    }

    /// Advance `state` (`[state][lane]`: positions, velocities, then internal states) from `time` by `length` seconds in
    /// `substeps` equal substeps. What is `given`, torques and then the model's further measured columns (`[channel][lane]`), holds over all
    /// of them or, if it differs between them, `[substep * channels + channel][lane]`.
    pub fn advance(
        &mut self,
        state: &mut [Row<f64, W>],
        given: &[Row<f64, W>],
        time: Row<f64, W>,
        length: Row<f64, W>,
        substeps: usize,
    ) {
        Row::<f64, W>::dispatch(Advance {
            stepper: self,
            state,
            given,
            time,
            length,
            substeps,
        });
    }

    #[inline(always)]
    fn step<S: Simd>(
        &mut self,
        simd: S,
        state: &mut [Row<f64, W>],
        time: &mut Row<f64, W>,
        h: &Row<f64, W>,
    ) {
        let layout = self.layout;
        self.tape.moving()[layout.states()].copy_from_slice(state);
        if !layout.internal().is_empty() {
            self.tape.moving()[layout.starts()].copy_from_slice(&state[layout.internal()]);
            self.tape.moving()[layout.step()] = *h;
        }
        self.sum.copy_from_slice(state);
        self.tape.moving()[layout.time()] = *time;
        for stage in self.scheme.stages {
            self.tape.run_on(simd);
            for (k, slope) in self.slope.iter_mut().enumerate() {
                *slope = *self.tape.output(k);
            }
            let inputs = self.tape.moving();
            for part in 0..Row::<f64, W>::parts::<S>() {
                let h = h.get(simd, part);
                let (weighed, reached) = (h * h.like(stage.weight), h * h.like(stage.reach));
                let rows = self.sum.iter_mut().zip(&mut inputs[layout.states()]);
                for (((sum, inner), now), slope) in rows.zip(&*state).zip(&self.slope) {
                    let slope = slope.get(simd, part);
                    sum.set(part, slope.mul_add(weighed, sum.get(simd, part)));
                    inner.set(part, slope.mul_add(reached, now.get(simd, part)));
                }
                inputs[layout.time()].set(part, time.get(simd, part) + reached);
            }
        }
        if self.scheme.semi_implicit {
            self.move_with_new_velocities(simd, state, h);
        }
        state.copy_from_slice(&self.sum);
        for part in 0..Row::<f64, W>::parts::<S>() {
            time.set(part, time.get(simd, part) + h.get(simd, part));
        }
    }

    /// v' = v + h f_v, q' = q + h (f_q + h f_v)
    #[inline(always)]
    fn move_with_new_velocities<S: Simd>(
        &mut self,
        simd: S,
        state: &[Row<f64, W>],
        h: &Row<f64, W>,
    ) {
        let n = self.joints;
        for part in 0..Row::<f64, W>::parts::<S>() {
            let h = h.get(simd, part);
            for j in 0..n {
                let gain = h * self.slope[n + j].get(simd, part);
                let moved = h * (self.slope[j].get(simd, part) + gain);
                self.sum[j].set(part, state[j].get(simd, part) + moved);
                self.sum[n + j].set(part, state[n + j].get(simd, part) + gain);
            }
        }
    }
}

struct Advance<'a, const W: usize> {
    stepper: &'a mut Stepper<W>,
    state: &'a mut [Row<f64, W>],
    given: &'a [Row<f64, W>],
    time: Row<f64, W>,
    length: Row<f64, W>,
    substeps: usize,
}

impl<const W: usize> WithSimd for Advance<'_, W> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(mut self, simd: S) {
        let places = self.stepper.layout.given();
        #[allow(clippy::cast_precision_loss)] // few substeps
        let h = Row(self.length.map(|length| length / self.substeps as f64));
        let parts = self.given.chunks(places.len()).cycle();
        for given in parts.take(self.substeps) {
            self.stepper.tape.moving()[places.clone()].copy_from_slice(given);
            self.stepper.step(simd, self.state, &mut self.time, &h);
        }
    }
}
