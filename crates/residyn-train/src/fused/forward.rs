//! The forward sweep: the rollout of a chunk, recorded stage by stage, and the sums that the loss is made of.

use pulp::Simd;

use super::programs::Programs;
use super::record::StageRecord;
use super::rollout::{Rollout, StageIndex};
use super::rows::{total, update};
use super::workspace::Scratch;
use residyn_core::expr::Tape;
use residyn_core::lanes::Vector;
use residyn_core::sim::Stage;
use residyn_core::sim::batch::{Rows, W};

impl<S: Simd> Rollout<'_, S> {
    /// Rolls the chunk out. Returns the sums of the squared error and of the squared residual over its rows and steps.
    #[inline(always)]
    pub(super) fn forward(
        &self,
        programs: &mut Programs,
        scratch: &mut Scratch,
        record: &mut [Rows],
    ) -> [f64; 2] {
        let (blocks, states) = (&self.problem.blocks, self.states());
        let mut sums = [Rows::splat(0.0); 2];
        let first = scratch.state.chunks_exact_mut(states);
        for (block, state) in self.chunk.clone().zip(first) {
            state.copy_from_slice(blocks.step(block, 0).state);
        }
        for step in 0..blocks.steps {
            for substep in 0..self.problem.integrator.substeps() {
                self.substep(programs, scratch, record, (step, substep), &mut sums[1]);
            }
            let end = self.layout.end(record, step);
            end.copy_from_slice(&scratch.state[..end.len()]);
            self.add_error(step, end, &mut sums[0]);
        }
        [total(self.simd, &sums[0]), total(self.simd, &sums[1])]
    }

    /// Adds the squared errors of the states at the end of a step.
    #[inline(always)]
    fn add_error(&self, step: usize, end: &[Rows], sum: &mut Rows) {
        let blocks = &self.problem.blocks;
        for (block, end) in self.chunk.clone().zip(end.chunks_exact(self.states())) {
            let (next, counted) = (blocks.step(block, step).next, blocks.counted(block));
            for ((found, wanted), precision) in end.iter().zip(next).zip(&*self.problem.precision) {
                let of = [found, wanted, counted];
                update(self.simd, sum, of, |sum, [found, wanted, counted]| {
                    let zero = Vector::splat(self.simd, 0.0);
                    let off = (found - wanted) * Vector::splat(self.simd, *precision);
                    // Selected, not multiplied by `counted`: an infinite error in a row that counts stays infinite.
                    let off = zero.if_less(counted, off, zero);
                    off.mul_add(off, sum)
                });
            }
        }
    }

    #[inline(always)]
    fn substep(
        &self,
        programs: &mut Programs,
        scratch: &mut Scratch,
        record: &mut [Rows],
        (step, substep): (usize, usize),
        residual: &mut Rows,
    ) {
        for (stage, coefficients) in self.problem.integrator.scheme().stages.iter().enumerate() {
            let at = StageIndex {
                step,
                substep,
                stage,
            };
            let mut record = self.stage(record, at);
            self.set_states(at, coefficients, scratch, record.states);
            let Scratch { state, rates, .. } = &mut *scratch;
            self.rates(&mut programs.program, at, &mut record, (state, rates));
            if self.is_penalised(at) {
                self.add_residual(&record, residual);
            }
            let weight = Vector::splat(self.simd, coefficients.weight as f32);
            for (mean, rate) in scratch.mean.iter_mut().zip(&scratch.rates) {
                update(self.simd, mean, [rate], |mean, [rate]| {
                    if stage == 0 {
                        rate * weight
                    } else {
                        rate.mul_add(weight, mean)
                    }
                });
            }
        }
        self.advance(step, scratch);
    }

    /// Records the states of a stage.
    #[inline(always)]
    fn set_states(&self, at: StageIndex, stage: &Stage, scratch: &Scratch, to: &mut [Rows]) {
        let states = self.states();
        for (b, block) in self.chunk.clone().enumerate() {
            let h = self.part_of_substep(block, at.step, stage.time as f32);
            for k in b * states..(b + 1) * states {
                let of = [&scratch.state[k], &scratch.rates[k], &h];
                update(self.simd, &mut to[k], of, |_, [state, rate, h]| {
                    if at.stage == 0 {
                        state
                    } else {
                        rate.mul_add(h, state)
                    }
                });
            }
        }
    }

    /// Moves the state to the end of the substep along the mean rates.
    #[inline(always)]
    fn advance(&self, step: usize, scratch: &mut Scratch) {
        let states = self.states();
        let Scratch { state, mean, .. } = scratch;
        for (b, block) in self.chunk.clone().enumerate() {
            let h = self.part_of_substep(block, step, 1.0);
            let state = &mut state[b * states..][..states];
            let mean = &mean[b * states..][..states];
            for (state, mean) in state.iter_mut().zip(mean) {
                update(self.simd, state, [mean, &h], |state, [rate, h]| {
                    rate.mul_add(h, state)
                });
            }
            if self.problem.integrator.scheme().semi_implicit {
                let joints = self.of_motion() / 2;
                let (q, gains) = (&mut state[..joints], &mean[joints..]);
                for (q, gain) in q.iter_mut().zip(gains) {
                    update(self.simd, q, [gain, &h], |q, [gain, h]| {
                        (gain * h).mul_add(h, q)
                    });
                }
            }
        }
    }

    /// The rates at a stage, whose states are in its record, of a substep that begins in `begun`.
    #[inline(always)]
    fn rates(
        &self,
        program: &mut Tape<f32, W>,
        at: StageIndex,
        record: &mut StageRecord,
        (begun, rates): (&[Rows], &mut [Rows]),
    ) {
        let (states, of_motion) = (self.states(), self.of_motion());
        for (b, block) in self.chunk.clone().enumerate() {
            let of_block = [&*record.states, begun].map(|all| &all[b * states..][..states]);
            self.set_inputs(program, at, block, of_block);
            program.run();
            let rates = &mut rates[b * states..][..states];
            for (k, rate) in rates.iter_mut().enumerate() {
                *rate = *program.output(k);
            }
            let mut output = states;
            for (network, part) in self.weights.networks.iter().zip(&mut record.networks) {
                let features = &mut part.features[b * network.features()..][..network.features()];
                for feature in &mut *features {
                    *feature = *program.output(output);
                    output += 1;
                }
                let values = &mut part.values[b * network.activations()..][..network.activations()];
                network.forward(self.simd, features, values);
                let outputs = &values[network.outputs()];
                let first = of_motion - outputs.len();
                for (rate, output) in rates[first..].iter_mut().zip(outputs) {
                    update(self.simd, rate, [output], |rate, [output]| rate + output);
                }
            }
        }
    }

    /// Adds the squares of the residual's outputs.
    #[inline(always)]
    fn add_residual(&self, record: &StageRecord, sum: &mut Rows) {
        let last = self.weights.networks.len() - 1;
        let network = &self.weights.networks[last];
        let values = record.networks[last]
            .values
            .chunks_exact(network.activations());
        for (block, values) in self.chunk.clone().zip(values) {
            let counted = self.problem.blocks.counted(block);
            for output in &values[network.outputs()] {
                let of = [output, counted];
                update(self.simd, sum, of, |sum, [output, counted]| {
                    (output * counted).mul_add(output, sum)
                });
            }
        }
    }
}
