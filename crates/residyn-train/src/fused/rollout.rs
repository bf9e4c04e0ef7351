use std::ops::Range;

use pulp::Simd;

use super::problem::{Problem, Weights};
use super::record::{Layout, StageRecord};
use super::rows::update;
use residyn_core::expr::Tape;
use residyn_core::lanes::Vector;
use residyn_core::sim::batch::{Rows, W};

/// The rollout of a chunk of blocks on one thread: what the forward and the reverse sweep share.
pub(super) struct Rollout<'a, S> {
    pub simd: S,
    pub problem: &'a Problem,
    pub weights: &'a Weights,
    pub chunk: Range<usize>,
    pub layout: Layout,
}

/// The place of a stage in the rollout.
#[derive(Clone, Copy)]
pub(super) struct StageIndex {
    pub step: usize,
    pub substep: usize,
    pub stage: usize,
}

impl<S: Simd> Rollout<'_, S> {
    /// Sets state, input and time of a stage in a program; `begun` is the state in which its substep begins.
    #[inline(always)]
    pub(super) fn set_inputs(
        &self,
        program: &mut Tape<f32, W>,
        at: StageIndex,
        block: usize,
        [state, begun]: [&[Rows]; 2],
    ) {
        let layout = self.problem.structure.layout;
        let data = self.problem.blocks.step(block, at.step);
        let inputs = program.moving();
        for (to, from) in inputs.iter_mut().zip(state.iter().chain(data.input)) {
            *to = *from;
        }
        let time = self.problem.integrator.scheme().stages[at.stage].time as f32;
        #[allow(clippy::cast_precision_loss)] // few substeps
        let elapsed = self.part_of_substep(block, at.step, at.substep as f32 + time);
        let mut time = *data.time;
        update(self.simd, &mut time, [&elapsed], |time, [elapsed]| {
            time + elapsed
        });
        inputs[layout.time()] = time;
        if !layout.internal().is_empty() {
            inputs[layout.starts()].copy_from_slice(&begun[layout.internal()]);
            inputs[layout.step()] = self.part_of_substep(block, at.step, 1.0);
        }
    }

    /// `part` times the length of a substep, s.
    #[inline(always)]
    pub(super) fn part_of_substep(&self, block: usize, step: usize, part: f32) -> Rows {
        #[allow(clippy::cast_precision_loss)] // few substeps
        let part = Vector::splat(self.simd, part / self.problem.integrator.substeps() as f32);
        let mut length = *self.problem.blocks.step(block, step).dt;
        update(self.simd, &mut length, [], |dt, []| dt * part);
        length
    }

    /// The record of a stage.
    #[inline(always)]
    pub(super) fn stage<'r>(&self, record: &'r mut [Rows], at: StageIndex) -> StageRecord<'r> {
        let (substeps, stages) = (
            self.problem.integrator.substeps(),
            self.problem.integrator.scheme().stages.len(),
        );
        let index = (at.step * substeps + at.substep) * stages + at.stage;
        self.layout.stage(record, index, &self.weights.networks)
    }

    /// Whether the residual is penalised here: at the start of each step.
    pub(super) fn is_penalised(&self, at: StageIndex) -> bool {
        self.problem.structure.has_residual && at.substep == 0 && at.stage == 0
    }

    /// Number of states.
    pub(super) fn states(&self) -> usize {
        self.problem.structure.states()
    }

    /// Number of positions and velocities.
    pub(super) fn of_motion(&self) -> usize {
        2 * self.problem.structure.joints
    }
}

impl StageIndex {
    /// Whether the state is the segment's first, which is data and depends on nothing learnable.
    pub(super) fn is_first(self) -> bool {
        (self.step, self.substep, self.stage) == (0, 0, 0)
    }
}
