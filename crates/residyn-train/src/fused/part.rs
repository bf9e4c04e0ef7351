use std::ops::Range;

use pulp::{Simd, WithSimd};

use super::problem::{CHUNK, Problem, Weights};
use super::programs::Programs;
use super::record::Layout;
use super::rollout::Rollout;
use super::rows::total;
use super::workspace::Workspace;
use crate::Structure;
use residyn_core::lanes::Vector;
use residyn_core::sim::batch::Rows;

/// One thread's share of a loss, with buffers that are reused for the next loss.
#[derive(Debug)]
pub(super) struct Part {
    blocks: Range<usize>,
    /// The records of all chunks or, if these are not kept, of one chunk at a time.
    records: Vec<Rows>,
    programs: Programs,
    workspace: Workspace,
    /// Sums of the squared errors and of the squared residuals.
    pub sums: [f64; 2],
    /// Derivatives by the weights of each network.
    pub by_networks: Vec<Vec<f32>>,
    /// Derivatives by the free parameters, in their units.
    pub by_parameters: Vec<f64>,
}

#[derive(Debug, Clone, Copy)]
pub(super) enum Pass {
    /// The sums that the loss is made of.
    Forward,
    /// The derivatives by all learnable numbers, from the derivatives by the two sums.
    Reverse([f32; 2]),
}

/// A pass over the blocks of a part.
pub(super) struct PassOver<'a> {
    pub pass: Pass,
    pub part: &'a mut Part,
    pub problem: &'a Problem,
    pub weights: &'a Weights,
}

impl WithSimd for PassOver<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self {
            pass,
            part,
            problem,
            weights,
        } = self;
        match pass {
            Pass::Forward => part.forward(simd, problem, weights),
            Pass::Reverse(seeds) => part.reverse(simd, problem, weights, seeds),
        }
    }
}

impl Part {
    pub(super) fn new(structure: &Structure) -> Self {
        Self {
            blocks: 0..0,
            records: Vec::new(),
            programs: Programs::new(structure),
            workspace: Workspace::default(),
            sums: [0.0; 2],
            by_networks: Vec::new(),
            by_parameters: Vec::new(),
        }
    }

    /// Prepares for the loss on these blocks.
    pub(super) fn begin(&mut self, blocks: Range<usize>, problem: &Problem, weights: &Weights) {
        let kept = match problem.keeps_records(&weights.networks) {
            true => blocks.len(),
            false => blocks.len().min(CHUNK),
        };
        let rows = kept * problem.recorded(&weights.networks);
        self.records.resize(rows, Rows::splat(0.0));
        self.workspace.begin(&problem.structure, &weights.networks);
        self.programs.set_parameters(&weights.parameters);
        self.blocks = blocks;
    }

    #[inline(always)]
    fn forward<S: Simd>(&mut self, simd: S, problem: &Problem, weights: &Weights) {
        self.sums = [0.0; 2];
        for (chunk, record) in chunks(&self.blocks, problem, weights) {
            let rollout = rollout(simd, problem, weights, chunk);
            let scratch = &mut self.workspace.scratch;
            let record = &mut self.records[record];
            let sums = rollout.forward(&mut self.programs, scratch, record);
            for (sum, more) in self.sums.iter_mut().zip(sums) {
                *sum += more;
            }
        }
    }

    #[inline(always)]
    fn reverse<S: Simd>(&mut self, simd: S, problem: &Problem, weights: &Weights, seeds: [f32; 2]) {
        let Self {
            programs,
            workspace,
            ..
        } = self;
        workspace.clear_sums::<S>(&problem.structure, &weights.networks);
        let is_recorded = problem.keeps_records(&weights.networks);
        for (chunk, record) in chunks(&self.blocks, problem, weights) {
            let rollout = rollout(simd, problem, weights, chunk);
            let record = &mut self.records[record];
            if !is_recorded {
                rollout.forward(programs, &mut workspace.scratch, record);
            }
            rollout.reverse(programs, workspace, record, seeds);
        }
        self.add_up(simd);
    }

    /// Adds up the lanes of the derivatives.
    #[inline(always)]
    fn add_up<S: Simd>(&mut self, simd: S) {
        let workspace = &mut self.workspace;
        self.by_networks
            .resize(workspace.network_sums.len(), Vec::new());
        for (to, sums) in self.by_networks.iter_mut().zip(&mut workspace.network_sums) {
            let sums = sums.registers::<S>();
            to.resize(sums.len(), 0.0);
            for (to, sum) in to.iter_mut().zip(sums) {
                *to = Vector::<S, f32>::new(simd, *sum).sum();
            }
        }
        self.by_parameters
            .resize(workspace.parameter_sums.len(), 0.0);
        for (to, sum) in self.by_parameters.iter_mut().zip(&workspace.parameter_sums) {
            *to = total(simd, sum);
        }
    }
}

/// The chunks of some blocks, each with the range of its record.
fn chunks(
    blocks: &Range<usize>,
    problem: &Problem,
    weights: &Weights,
) -> impl Iterator<Item = (Range<usize>, Range<usize>)> + use<> {
    let (first, last) = (blocks.start, blocks.end);
    let keeps = problem.keeps_records(&weights.networks);
    let rows = problem.recorded(&weights.networks);
    (first..last).step_by(CHUNK).map(move |start| {
        let chunk = start..last.min(start + CHUNK);
        let before = if keeps { start - first } else { 0 };
        let record = before * rows..(before + chunk.len()) * rows;
        (chunk, record)
    })
}

fn rollout<'a, S: Simd>(
    simd: S,
    problem: &'a Problem,
    weights: &'a Weights,
    chunk: Range<usize>,
) -> Rollout<'a, S> {
    Rollout {
        simd,
        layout: Layout::new(problem, &weights.networks, chunk.len()),
        problem,
        weights,
        chunk,
    }
}
