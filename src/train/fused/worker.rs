use std::ops::Range;

use pulp::Simd;

use super::plan::{CHUNK, Numbers, Plan};
use super::record::{Layout, Stage as Recorded};
use super::tapes::Tapes;
use crate::expr::Tape;
use crate::lanes::{Element, Vector};
use crate::sim::Stage;
use crate::sim::batch::{Network, Rows, W};
use crate::train::Frame;

/// One thread at work on a chunk of blocks.
pub(super) struct Worker<'a, S> {
    pub simd: S,
    pub plan: &'a Plan,
    pub numbers: &'a Numbers,
    pub chunk: Range<usize>,
    pub layout: Layout,
}

/// Where a stage stands in the rollout.
#[derive(Clone, Copy)]
pub(super) struct Place {
    pub step: usize,
    pub substep: usize,
    pub stage: usize,
}

/// Working memory of the way back.
#[derive(Debug, Default)]
pub(super) struct Desk {
    pub scratch: Scratch,
    /// For each network the derivatives by its features, `[block][feature]`.
    by_features: Vec<Vec<Rows>>,
    /// For each network the derivatives by its numbers, a register each.
    pub network_sums: Vec<Vec<f32>>,
    /// The derivative by each parameter that is not fixed.
    pub parameter_sums: Vec<Rows>,
}

/// Working memory of both ways, each part `[block][state]`.
#[derive(Debug, Default)]
pub(super) struct Scratch {
    state: Vec<Rows>,
    rates: Vec<Rows>,
    mean: Vec<Rows>,
    other: Vec<Rows>,
}

impl Desk {
    /// Room for a chunk.
    pub(super) fn begin(&mut self, frame: &Frame, networks: &[Network]) {
        let Scratch {
            state,
            rates,
            mean,
            other,
        } = &mut self.scratch;
        for part in [state, rates, mean, other] {
            part.resize(CHUNK * 2 * frame.joints, Rows::splat(0.0));
        }
        self.by_features.resize(networks.len(), Vec::new());
        for (by, network) in self.by_features.iter_mut().zip(networks) {
            by.resize(CHUNK * network.features(), Rows::splat(0.0));
        }
    }

    pub(super) fn clear_sums<S: Simd>(&mut self, frame: &Frame, networks: &[Network]) {
        let free = frame.parameters().iter().filter(|p| !p.fixed).count();
        self.parameter_sums.clear();
        self.parameter_sums.resize(free, Rows::splat(0.0));
        self.network_sums.resize(networks.len(), Vec::new());
        for (sums, network) in self.network_sums.iter_mut().zip(networks) {
            sums.clear();
            sums.resize(network.numbers() * f32::lanes::<S>(), 0.0);
        }
    }
}

/// `to` becomes `value(to, of)`, lane by lane.
#[inline(always)]
pub(super) fn update<S: Simd, const N: usize>(
    simd: S,
    to: &mut Rows,
    of: [&Rows; N],
    value: impl Fn(Vector<S, f32>, [Vector<S, f32>; N]) -> Vector<S, f32>,
) {
    let to = f32::registers_mut::<S>(&mut to.0);
    for (k, to) in to.iter_mut().enumerate() {
        let mut operands = [Vector::splat(simd, 0.0); N];
        for n in 0..N {
            operands[n] = of[n].get(simd, k);
        }
        *to = value(Vector::new(simd, *to), operands).register;
    }
}

/// The sum over all lanes.
#[inline(always)]
pub(super) fn total<S: Simd>(simd: S, rows: &Rows) -> f64 {
    let mut total = 0.0;
    for register in f32::registers::<S>(&rows.0) {
        total += f64::from(Vector::<S, f32>::new(simd, *register).sum());
    }
    total
}

impl<S: Simd> Worker<'_, S> {
    /// The rollout of the chunk. Returns the sums over its rows and steps of the squared error and of the squared
    /// residual.
    #[inline(always)]
    pub(super) fn forward(
        &self,
        tapes: &mut Tapes,
        scratch: &mut Scratch,
        record: &mut [Rows],
    ) -> [f64; 2] {
        let (blocks, states) = (&self.plan.blocks, self.states());
        let mut sums = [Rows::splat(0.0); 2];
        for (block, state) in self
            .chunk
            .clone()
            .zip(scratch.state.chunks_exact_mut(states))
        {
            state.copy_from_slice(blocks.given(block, 0).state);
        }
        for step in 0..blocks.steps {
            for substep in 0..self.plan.integrator.substeps() {
                self.substep(tapes, scratch, record, (step, substep), &mut sums[1]);
            }
            let end = self.layout.end(record, step);
            end.copy_from_slice(&scratch.state[..end.len()]);
            for (block, end) in self.chunk.clone().zip(end.chunks_exact(states)) {
                let (next, counted) = (blocks.given(block, step).next, blocks.counted(block));
                for ((found, wanted), precision) in end.iter().zip(next).zip(&*self.plan.precision)
                {
                    update(
                        self.simd,
                        &mut sums[0],
                        [found, wanted, counted],
                        |sum, [found, wanted, counted]| {
                            let zero = Vector::splat(self.simd, 0.0);
                            let off = (found - wanted) * Vector::splat(self.simd, *precision);
                            // Not a product: what is infinite in a row that counts stays so.
                            let off = zero.if_less(counted, off, zero);
                            off.mul_add(off, sum)
                        },
                    );
                }
            }
        }
        [total(self.simd, &sums[0]), total(self.simd, &sums[1])]
    }

    #[inline(always)]
    fn substep(
        &self,
        tapes: &mut Tapes,
        scratch: &mut Scratch,
        record: &mut [Rows],
        (step, substep): (usize, usize),
        residual: &mut Rows,
    ) {
        let Scratch {
            state, rates, mean, ..
        } = scratch;
        let (scheme, states) = (self.plan.integrator.scheme(), self.states());
        for (stage, Stage { time, weight, .. }) in scheme.stages.iter().enumerate() {
            let (time, weight) = (*time as f32, *weight as f32);
            let place = Place {
                step,
                substep,
                stage,
            };
            let mut record = self.stage(record, place);
            for (b, block) in self.chunk.clone().enumerate() {
                let h = self.part_of_step(block, step, time);
                for k in b * states..(b + 1) * states {
                    let of = [&state[k], &rates[k], &h];
                    update(
                        self.simd,
                        &mut record.states[k],
                        of,
                        |_, [state, rate, h]| {
                            if stage == 0 {
                                state
                            } else {
                                rate.mul_add(h, state)
                            }
                        },
                    );
                }
            }
            self.rates(&mut tapes.program, place, &mut record, rates);
            if self.is_penalised(place) {
                self.add_residual(&record, residual);
            }
            let weight = Vector::splat(self.simd, weight);
            for (mean, rate) in mean.iter_mut().zip(&*rates) {
                update(self.simd, mean, [rate], |mean, [rate]| {
                    if stage == 0 {
                        rate * weight
                    } else {
                        rate.mul_add(weight, mean)
                    }
                });
            }
        }
        for (b, block) in self.chunk.clone().enumerate() {
            let h = self.part_of_step(block, step, 1.0);
            let (state, mean) = (
                &mut state[b * states..][..states],
                &mean[b * states..][..states],
            );
            for (state, mean) in state.iter_mut().zip(mean) {
                update(self.simd, state, [mean, &h], |state, [rate, h]| {
                    rate.mul_add(h, state)
                });
            }
            if scheme.semi_implicit {
                let (q, gains) = (&mut state[..states / 2], &mean[states / 2..]);
                for (q, gain) in q.iter_mut().zip(gains) {
                    update(self.simd, q, [gain, &h], |q, [gain, h]| {
                        (gain * h).mul_add(h, q)
                    });
                }
            }
        }
    }

    /// The rates at a stage, whose states are in its record.
    #[inline(always)]
    fn rates(
        &self,
        program: &mut Tape<f32, W>,
        place: Place,
        record: &mut Recorded,
        rates: &mut [Rows],
    ) {
        let states = self.states();
        for (b, block) in self.chunk.clone().enumerate() {
            self.set_inputs(
                program,
                place,
                block,
                &record.states[b * states..][..states],
            );
            program.run();
            let rates = &mut rates[b * states..][..states];
            for (k, rate) in rates.iter_mut().enumerate() {
                *rate = *program.output(k);
            }
            let mut output = states;
            for (network, part) in self.numbers.networks.iter().zip(&mut record.networks) {
                let features = &mut part.features[b * network.features()..][..network.features()];
                for feature in &mut *features {
                    *feature = *program.output(output);
                    output += 1;
                }
                let values = &mut part.values[b * network.activations()..][..network.activations()];
                network.forward(self.simd, features, values);
                let outputs = &values[network.outputs()];
                let first = states - outputs.len();
                for (rate, output) in rates[first..].iter_mut().zip(outputs) {
                    update(self.simd, rate, [output], |rate, [output]| rate + output);
                }
            }
        }
    }

    /// Add the squares of the residual's outputs.
    #[inline(always)]
    fn add_residual(&self, record: &Recorded, sum: &mut Rows) {
        let last = self.numbers.networks.len() - 1;
        let network = &self.numbers.networks[last];
        let values = record.networks[last]
            .values
            .chunks_exact(network.activations());
        for (block, values) in self.chunk.clone().zip(values) {
            let counted = self.plan.blocks.counted(block);
            for output in &values[network.outputs()] {
                update(
                    self.simd,
                    sum,
                    [output, counted],
                    |sum, [output, counted]| (output * counted).mul_add(output, sum),
                );
            }
        }
    }

    /// The way back through the rollout that [`Worker::forward`] recorded. `seeds` are the derivatives of a number by
    /// the sums that it returned; the number's derivatives by the learnable ones are added to those of `desk`.
    #[inline(always)]
    pub(super) fn backward(
        &self,
        tapes: &mut Tapes,
        desk: &mut Desk,
        record: &mut [Rows],
        seeds: [f32; 2],
    ) {
        let (blocks, states) = (&self.plan.blocks, self.states());
        desk.scratch.state.fill(Rows::splat(0.0));
        for step in (0..blocks.steps).rev() {
            let ends = self.layout.end(record, step).chunks_exact(states);
            for ((b, block), end) in self.chunk.clone().enumerate().zip(ends) {
                let (next, counted) = (blocks.given(block, step).next, blocks.counted(block));
                let adjoint = &mut desk.scratch.state[b * states..][..states];
                for k in 0..states {
                    let precision = self.plan.precision[k];
                    let seed = Vector::splat(self.simd, 2.0 * seeds[0] * precision * precision);
                    let of = [&end[k], &next[k], counted];
                    update(
                        self.simd,
                        &mut adjoint[k],
                        of,
                        |sum, [found, wanted, counted]| {
                            ((found - wanted) * counted).mul_add(seed, sum)
                        },
                    );
                }
            }
            for substep in (0..self.plan.integrator.substeps()).rev() {
                self.substep_back(tapes, desk, record, (step, substep), seeds[1]);
            }
        }
    }

    /// `scratch.state` goes from the derivative by the state at the substep's end to that at its start.
    #[inline(always)]
    fn substep_back(
        &self,
        tapes: &mut Tapes,
        desk: &mut Desk,
        record: &mut [Rows],
        (step, substep): (usize, usize),
        seed: f32,
    ) {
        let (scheme, states) = (self.plan.integrator.scheme(), self.states());
        for (b, block) in self.chunk.clone().enumerate() {
            let h = self.part_of_step(block, step, 1.0);
            let adjoint = &desk.scratch.state[b * states..][..states];
            let mean = &mut desk.scratch.mean[b * states..][..states];
            for (mean, adjoint) in mean.iter_mut().zip(adjoint) {
                update(self.simd, mean, [adjoint, &h], |_, [adjoint, h]| {
                    adjoint * h
                });
            }
            if scheme.semi_implicit {
                let (of_q, of_v) = mean.split_at_mut(states / 2);
                for (v, q) in of_v.iter_mut().zip(of_q) {
                    update(self.simd, v, [q, &h], |v, [q, h]| q.mul_add(h, v));
                }
            }
        }
        for (stage, Stage { reach, weight, .. }) in scheme.stages.iter().enumerate().rev() {
            let (reach, weight) = (*reach as f32, *weight as f32);
            let place = Place {
                step,
                substep,
                stage,
            };
            let last = stage + 1 == scheme.stages.len();
            let Scratch {
                rates, mean, other, ..
            } = &mut desk.scratch;
            for (b, block) in self.chunk.clone().enumerate() {
                let h = self.part_of_step(block, step, reach);
                for k in b * states..(b + 1) * states {
                    let weight = Vector::splat(self.simd, weight);
                    let of = [&mean[k], &other[k], &h];
                    update(self.simd, &mut rates[k], of, |_, [mean, other, h]| {
                        if last {
                            mean * weight
                        } else {
                            other.mul_add(h, mean * weight)
                        }
                    });
                }
            }
            let mut record = self.stage(record, place);
            self.rates_back(tapes, place, &mut record, desk, seed);
            if !place.is_start() {
                let Scratch { state, other, .. } = &mut desk.scratch;
                for (state, other) in state.iter_mut().zip(&*other) {
                    update(self.simd, state, [other], |state, [other]| state + other);
                }
            }
        }
    }

    /// From the derivative by a stage's rates, in `scratch.rates`, to that by its states, in `scratch.other`.
    #[inline(always)]
    fn rates_back(
        &self,
        tapes: &mut Tapes,
        place: Place,
        record: &mut Recorded,
        desk: &mut Desk,
        seed: f32,
    ) {
        let states = self.states();
        let networks = self.numbers.networks.iter().zip(&mut record.networks);
        for (k, (network, activations)) in networks.enumerate() {
            let penalised = self.is_penalised(place) && k + 1 == self.numbers.networks.len();
            let seed = Vector::splat(self.simd, if penalised { 2.0 * seed } else { 0.0 });
            let values = activations.values.chunks_exact_mut(network.activations());
            let slopes = desk.scratch.rates.chunks_exact(states);
            for ((block, values), slopes) in self.chunk.clone().zip(values).zip(slopes) {
                let counted = self.plan.blocks.counted(block);
                let outputs = &mut values[network.outputs()];
                let slopes = &slopes[states - outputs.len()..];
                for (output, slope) in outputs.iter_mut().zip(slopes) {
                    update(
                        self.simd,
                        output,
                        [slope, counted],
                        |output, [slope, counted]| (output * counted).mul_add(seed, slope),
                    );
                }
            }
            let by_features: &mut [Rows] = match place.is_start() {
                true => &mut [],
                false => &mut desk.by_features[k][..activations.features.len()],
            };
            network.backward(
                self.simd,
                activations.features,
                activations.values,
                by_features,
                &mut desk.network_sums[k],
            );
        }
        let by_states = if place.is_start() { 0 } else { states };
        let adjoint = match place.is_start() {
            true => &mut tapes.parameter_adjoint,
            false => &mut tapes.adjoint,
        };
        if by_states + desk.parameter_sums.len() == 0 {
            return;
        }
        let first = 3 * self.plan.frame.joints + 1;
        for (b, block) in self.chunk.clone().enumerate() {
            self.set_inputs(
                adjoint,
                place,
                block,
                &record.states[b * states..][..states],
            );
            let seeds = &mut adjoint.moving()[first..];
            let rates = &desk.scratch.rates[b * states..][..states];
            let features = (self.numbers.networks.iter().zip(&desk.by_features))
                .flat_map(|(network, by)| &by[b * network.features()..][..network.features()]);
            for (to, seed) in seeds.iter_mut().zip(rates.iter().chain(features)) {
                *to = *seed;
            }
            adjoint.run();
            for (k, by) in desk.scratch.other[b * states..][..by_states]
                .iter_mut()
                .enumerate()
            {
                *by = *adjoint.output(k);
            }
            for (k, sum) in desk.parameter_sums.iter_mut().enumerate() {
                let slope = adjoint.output(by_states + k);
                update(self.simd, sum, [slope], |sum, [slope]| sum + slope);
            }
        }
    }

    /// State, input and time of a stage for a program.
    #[inline(always)]
    fn set_inputs(&self, program: &mut Tape<f32, W>, place: Place, block: usize, state: &[Rows]) {
        let given = self.plan.blocks.given(block, place.step);
        let inputs = program.moving();
        for (to, from) in inputs.iter_mut().zip(state.iter().chain(given.input)) {
            *to = *from;
        }
        let time = self.plan.integrator.scheme().stages[place.stage].time as f32;
        #[allow(clippy::cast_precision_loss)] // few substeps
        let elapsed = self.part_of_step(block, place.step, place.substep as f32 + time);
        let mut time = *given.time;
        update(self.simd, &mut time, [&elapsed], |time, [elapsed]| {
            time + elapsed
        });
        inputs[state.len() + given.input.len()] = time;
    }

    /// So much of a substep's length, s.
    #[inline(always)]
    fn part_of_step(&self, block: usize, step: usize, part: f32) -> Rows {
        #[allow(clippy::cast_precision_loss)] // few substeps
        let part = Vector::splat(self.simd, part / self.plan.integrator.substeps() as f32);
        let mut length = *self.plan.blocks.given(block, step).dt;
        update(self.simd, &mut length, [], |dt, []| dt * part);
        length
    }

    #[inline(always)]
    fn stage<'r>(&self, record: &'r mut [Rows], place: Place) -> Recorded<'r> {
        let (substeps, stages) = (
            self.plan.integrator.substeps(),
            self.plan.integrator.scheme().stages.len(),
        );
        let index = (place.step * substeps + place.substep) * stages + place.stage;
        self.layout.stage(record, index, &self.numbers.networks)
    }

    /// Whether the residual counts here: at the start of each step.
    fn is_penalised(&self, place: Place) -> bool {
        self.plan.frame.has_residual && place.substep == 0 && place.stage == 0
    }

    fn states(&self) -> usize {
        2 * self.plan.frame.joints
    }
}

impl Place {
    /// Whether the state is the given one, which depends on nothing.
    fn is_start(self) -> bool {
        (self.step, self.substep, self.stage) == (0, 0, 0)
    }
}
