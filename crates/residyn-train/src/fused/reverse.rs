//! The reverse sweep: the derivatives of the sums with respect to all learnable numbers, from the record of the forward
//! sweep.

use pulp::Simd;

use super::programs::Programs;
use super::record::StageRecord;
use super::rollout::{Rollout, StageIndex};
use super::rows::update;
use super::workspace::{Scratch, Workspace};
use residyn_core::lanes::Vector;
use residyn_core::sim::Stage;
use residyn_core::sim::batch::Rows;

impl<S: Simd> Rollout<'_, S> {
    /// Goes back through the rollout that [`Rollout::forward`] recorded. `seeds` are the derivatives of a quantity by the
    /// two sums that it returned; the quantity's derivatives by the learnable numbers are added to the sums of
    /// `workspace`.
    #[inline(always)]
    pub(super) fn reverse(
        &self,
        programs: &mut Programs,
        workspace: &mut Workspace,
        record: &mut [Rows],
        seeds: [f32; 2],
    ) {
        workspace.scratch.state.fill(Rows::splat(0.0));
        for step in (0..self.problem.blocks.steps).rev() {
            let end = self.layout.end(record, step);
            self.add_error_slope(step, end, &mut workspace.scratch.state, seeds[0]);
            for substep in (0..self.problem.integrator.substeps()).rev() {
                self.substep_back(programs, workspace, record, (step, substep), seeds[1]);
            }
        }
    }

    /// Adds the derivative of the squared error by the states at the end of a step.
    #[inline(always)]
    fn add_error_slope(&self, step: usize, end: &[Rows], by_state: &mut [Rows], seed: f32) {
        let (blocks, states) = (&self.problem.blocks, self.states());
        let ends = end.chunks_exact(states);
        for ((b, block), end) in self.chunk.clone().enumerate().zip(ends) {
            let (next, counted) = (blocks.step(block, step).next, blocks.counted(block));
            let by_state = &mut by_state[b * states..][..states];
            for (k, precision) in self.problem.precision.iter().enumerate() {
                let seed = Vector::splat(self.simd, 2.0 * seed * precision * precision);
                let of = [&end[k], &next[k], counted];
                update(
                    self.simd,
                    &mut by_state[k],
                    of,
                    |sum, [found, wanted, counted]| ((found - wanted) * counted).mul_add(seed, sum),
                );
            }
        }
    }

    /// Takes `scratch.state` from the derivative by the state at the substep's end to the derivative by the state at
    /// its start.
    #[inline(always)]
    fn substep_back(
        &self,
        programs: &mut Programs,
        workspace: &mut Workspace,
        record: &mut [Rows],
        (step, substep): (usize, usize),
        seed: f32,
    ) {
        let stages = self.problem.integrator.scheme().stages;
        self.advance_back(step, &mut workspace.scratch);
        let first = StageIndex {
            step,
            substep,
            stage: 0,
        };
        let begun = self.stage(record, first).states;
        workspace.scratch.begun[..begun.len()].copy_from_slice(begun);
        for (stage, coefficients) in stages.iter().enumerate().rev() {
            let at = StageIndex {
                step,
                substep,
                stage,
            };
            let last = stage + 1 == stages.len();
            self.seed_rates(at, coefficients, last, &mut workspace.scratch);
            let mut record = self.stage(record, at);
            self.networks_back(at, &mut record, workspace, seed);
            self.program_back(programs, at, record.states, workspace);
            if !at.is_first() {
                let Scratch {
                    state, by_stage, ..
                } = &mut workspace.scratch;
                for (state, by_stage) in state.iter_mut().zip(&*by_stage) {
                    update(self.simd, state, [by_stage], |state, [by_stage]| {
                        state + by_stage
                    });
                }
            }
        }
    }

    /// From the derivative by the state at the substep's end to that by the mean rates.
    #[inline(always)]
    fn advance_back(&self, step: usize, scratch: &mut Scratch) {
        let states = self.states();
        for (b, block) in self.chunk.clone().enumerate() {
            let h = self.part_of_substep(block, step, 1.0);
            let by_state = &scratch.state[b * states..][..states];
            let mean = &mut scratch.mean[b * states..][..states];
            for (mean, by_state) in mean.iter_mut().zip(by_state) {
                update(self.simd, mean, [by_state, &h], |_, [by_state, h]| {
                    by_state * h
                });
            }
            if self.problem.integrator.scheme().semi_implicit {
                let (of_q, of_v) = mean.split_at_mut(self.of_motion() / 2);
                for (v, q) in of_v.iter_mut().zip(of_q) {
                    update(self.simd, v, [q, &h], |v, [q, h]| q.mul_add(h, v));
                }
            }
        }
    }

    /// The derivative by a stage's rates: through their mean and, except in the last stage, through the next stage's
    /// states.
    #[inline(always)]
    fn seed_rates(&self, at: StageIndex, stage: &Stage, last: bool, scratch: &mut Scratch) {
        let states = self.states();
        let Scratch {
            rates,
            mean,
            by_stage,
            ..
        } = scratch;
        for (b, block) in self.chunk.clone().enumerate() {
            let h = self.part_of_substep(block, at.step, stage.reach as f32);
            for k in b * states..(b + 1) * states {
                let weight = Vector::splat(self.simd, stage.weight as f32);
                let of = [&mean[k], &by_stage[k], &h];
                update(self.simd, &mut rates[k], of, |_, [mean, by_stage, h]| {
                    if last {
                        mean * weight
                    } else {
                        by_stage.mul_add(h, mean * weight)
                    }
                });
            }
        }
    }

    /// From the derivative by a stage's rates to that by the features and the weights of each network.
    #[inline(always)]
    fn networks_back(
        &self,
        at: StageIndex,
        record: &mut StageRecord,
        workspace: &mut Workspace,
        seed: f32,
    ) {
        let (states, of_motion) = (self.states(), self.of_motion());
        let networks = self.weights.networks.iter().zip(&mut record.networks);
        for (k, (network, activations)) in networks.enumerate() {
            let penalised = self.is_penalised(at) && k + 1 == self.weights.networks.len();
            let seed = Vector::splat(self.simd, if penalised { 2.0 * seed } else { 0.0 });
            let values = activations.values.chunks_exact_mut(network.activations());
            let slopes = workspace.scratch.rates.chunks_exact(states);
            for ((block, values), slopes) in self.chunk.clone().zip(values).zip(slopes) {
                let counted = self.problem.blocks.counted(block);
                let outputs = &mut values[network.outputs()];
                let slopes = &slopes[of_motion - outputs.len()..];
                for (output, slope) in outputs.iter_mut().zip(slopes) {
                    let of = [slope, counted];
                    update(self.simd, output, of, |output, [slope, counted]| {
                        (output * counted).mul_add(seed, slope)
                    });
                }
            }
            let by_features: &mut [Rows] = match at.is_first() {
                true => &mut [],
                false => &mut workspace.by_features[k][..activations.features.len()],
            };
            network.backward(
                self.simd,
                activations.features,
                activations.values,
                by_features,
                &mut workspace.network_sums[k],
            );
        }
    }

    /// From the derivatives by a stage's rates and features to those by its states, in `scratch.by_stage`, by the internal
    /// states at the start of its substep, which are added in `scratch.state`, and by the parameters.
    #[inline(always)]
    fn program_back(
        &self,
        programs: &mut Programs,
        at: StageIndex,
        recorded: &[Rows],
        workspace: &mut Workspace,
    ) {
        let states = self.states();
        let layout = self.problem.structure.layout;
        let internal = layout.internal();
        let (adjoint, by_states, by_begun) = match at.is_first() {
            true => (&mut programs.parameter_adjoint, 0, 0),
            false => (&mut programs.adjoint, states, internal.len()),
        };
        if by_states + workspace.parameter_sums.len() == 0 {
            return;
        }
        let first = layout.parameters();
        for (b, block) in self.chunk.clone().enumerate() {
            let of_block = [recorded, &workspace.scratch.begun];
            let of_block = of_block.map(|all| &all[b * states..][..states]);
            self.set_inputs(adjoint, at, block, of_block);
            let seeds = &mut adjoint.moving()[first..];
            let rates = &workspace.scratch.rates[b * states..][..states];
            let features = (self.weights.networks.iter().zip(&workspace.by_features))
                .flat_map(|(network, by)| &by[b * network.features()..][..network.features()]);
            for (to, seed) in seeds.iter_mut().zip(rates.iter().chain(features)) {
                *to = *seed;
            }
            adjoint.run();
            let by_stage = &mut workspace.scratch.by_stage[b * states..][..by_states];
            for (k, by) in by_stage.iter_mut().enumerate() {
                *by = *adjoint.output(k);
            }
            let begun = &mut workspace.scratch.state[b * states..][internal.clone()];
            for (k, by) in begun[..by_begun].iter_mut().enumerate() {
                let slope = adjoint.output(by_states + k);
                update(self.simd, by, [slope], |by, [slope]| by + slope);
            }
            for (k, sum) in workspace.parameter_sums.iter_mut().enumerate() {
                let slope = adjoint.output(by_states + by_begun + k);
                update(self.simd, sum, [slope], |sum, [slope]| sum + slope);
            }
        }
    }
}
