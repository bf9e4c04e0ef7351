use std::ops::Range;

use pulp::{Simd, WithSimd};

use super::plan::{CHUNK, Numbers, Plan};
use super::record::Layout;
use super::worker::{Scratch, Worker, total};
use crate::batch::{Rows, W};
use crate::expr::{Program, Tape};
use crate::lanes::{Element, Vector};

/// Records of more rows than these together, 1 GiB, are not kept: the way back then begins with the way there again.
const KEPT: usize = (1 << 30) / size_of::<Rows>();

/// One thread's share of a loss, with memory that serves again for the next.
#[derive(Debug, Default)]
pub(super) struct Part {
    /// The blocks that it works on.
    blocks: Range<usize>,
    /// Whether the records of all chunks are kept, or that of one at a time.
    keeps: bool,
    records: Vec<Rows>,
    pub scratch: Scratch,
    /// For each network the derivatives by its features.
    pub by_features: Vec<Vec<Rows>>,
    /// For each network the derivatives by its numbers, a register each.
    pub network_sums: Vec<Vec<f32>>,
    /// The derivative by each parameter that is not fixed.
    pub parameter_sums: Vec<Rows>,
    /// Sums of the squared errors and of the squared residuals.
    pub sums: [f64; 2],
    /// Derivatives by the numbers of each network.
    pub by_networks: Vec<Vec<f32>>,
    /// Derivatives by the free parameters, in their units.
    pub by_parameters: Vec<f64>,
}

impl Part {
    /// Make ready for the loss on these blocks.
    pub(super) fn begin(&mut self, blocks: Range<usize>, plan: &Plan, numbers: &Numbers) {
        let (states, networks) = (2 * plan.frame.joints, &numbers.networks);
        let rows = |blocks| {
            Layout::new(plan.frame.joints, networks, plan.stages(), blocks).rows(plan.blocks.steps)
        };
        self.keeps = rows(plan.blocks.count()) <= KEPT;
        let kept = if self.keeps {
            blocks.len()
        } else {
            CHUNK.min(blocks.len())
        };
        self.records.resize(rows(kept), Rows::splat(0.0));
        self.scratch.resize(CHUNK * states);
        self.by_features.resize(networks.len(), Vec::new());
        for (by, network) in self.by_features.iter_mut().zip(networks) {
            by.resize(CHUNK * network.features(), Rows::splat(0.0));
        }
        self.blocks = blocks;
    }

    /// The chunks, each with where its record begins.
    fn chunks(&self, rows: usize) -> impl Iterator<Item = (Range<usize>, usize)> + use<> {
        let (first, last, keeps) = (self.blocks.start, self.blocks.end, self.keeps);
        (first..last).step_by(CHUNK).map(move |start| {
            let record = if keeps { (start - first) * rows } else { 0 };
            (start..last.min(start + CHUNK), record)
        })
    }
}

/// The loss on the blocks of a part.
pub(super) struct Forward<'a> {
    pub plan: &'a Plan,
    pub numbers: &'a Numbers,
    pub part: &'a mut Part,
}

/// Its derivative, after it.
pub(super) struct Backward<'a> {
    pub plan: &'a Plan,
    pub numbers: &'a Numbers,
    pub part: &'a mut Part,
    /// Derivatives by the sums that the loss made.
    pub seeds: [f32; 2],
}

impl WithSimd for Forward<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self {
            plan,
            numbers,
            part,
        } = self;
        let mut program = tape(&plan.frame.program, numbers);
        part.sums = [0.0; 2];
        for (chunk, first) in part.chunks(block_rows(plan, numbers)) {
            let worker = worker(simd, plan, numbers, chunk);
            let rows = worker.layout.rows(plan.blocks.steps);
            let record = &mut part.records[first..][..rows];
            let sums = worker.forward(&mut program, &mut part.scratch, record);
            for (sum, more) in part.sums.iter_mut().zip(sums) {
                *sum += more;
            }
        }
    }
}

impl WithSimd for Backward<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self {
            plan,
            numbers,
            part,
            seeds,
        } = self;
        let frame = &plan.frame;
        let free = frame.parameters().iter().filter(|p| !p.fixed).count();
        part.parameter_sums.clear();
        part.parameter_sums.resize(free, Rows::splat(0.0));
        part.network_sums.resize(numbers.networks.len(), Vec::new());
        for (sums, network) in part.network_sums.iter_mut().zip(&numbers.networks) {
            sums.clear();
            sums.resize(network.numbers() * f32::lanes::<S>(), 0.0);
        }
        let mut program = tape(&frame.program, numbers);
        let mut adjoints =
            [&frame.adjoint, &frame.parameter_adjoint].map(|program| tape(program, numbers));
        let mut records = std::mem::take(&mut part.records);
        for (chunk, first) in part.chunks(block_rows(plan, numbers)) {
            let worker = worker(simd, plan, numbers, chunk);
            let rows = worker.layout.rows(plan.blocks.steps);
            let record = &mut records[first..][..rows];
            if !part.keeps {
                worker.forward(&mut program, &mut part.scratch, record);
            }
            worker.backward(&mut adjoints, part, record, seeds);
        }
        part.records = records;
        part.add_up(simd);
    }
}

impl Part {
    /// From sums lane by lane to numbers.
    #[inline(always)]
    fn add_up<S: Simd>(&mut self, simd: S) {
        self.by_networks.resize(self.network_sums.len(), Vec::new());
        for (to, sums) in self.by_networks.iter_mut().zip(&self.network_sums) {
            let sums = f32::registers::<S>(sums);
            to.resize(sums.len(), 0.0);
            for (to, sum) in to.iter_mut().zip(sums) {
                *to = Vector::<S, f32>::new(simd, *sum).sum();
            }
        }
        self.by_parameters.resize(self.parameter_sums.len(), 0.0);
        for (to, sum) in self.by_parameters.iter_mut().zip(&self.parameter_sums) {
            *to = total(simd, sum);
        }
    }
}

fn worker<'a, S: Simd>(
    simd: S,
    plan: &'a Plan,
    numbers: &'a Numbers,
    chunk: Range<usize>,
) -> Worker<'a, S> {
    let layout = Layout::new(
        plan.frame.joints,
        &numbers.networks,
        plan.stages(),
        chunk.len(),
    );
    Worker {
        simd,
        plan,
        numbers,
        chunk,
        layout,
    }
}

/// Rows of one block's record.
fn block_rows(plan: &Plan, numbers: &Numbers) -> usize {
    Layout::new(plan.frame.joints, &numbers.networks, plan.stages(), 1).rows(plan.blocks.steps)
}

/// A program with the parameters, its last inputs, in place.
fn tape<'p>(program: &'p Program, numbers: &Numbers) -> Tape<'p, f32, W> {
    let first = program.inputs().len() - numbers.parameters.len();
    let mut tape = program.tape_with_held(first);
    let slots = &mut tape.inputs()[first..];
    for (slot, value) in slots.iter_mut().zip(&numbers.parameters) {
        slot.fill(*value);
    }
    tape
}
