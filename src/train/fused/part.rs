use std::ops::Range;

use pulp::{Simd, WithSimd};

use super::plan::{CHUNK, Numbers, Plan};
use super::record::Layout;
use super::tapes::Tapes;
use super::worker::{Desk, Worker, total};
use crate::lanes::{Element, Vector};
use crate::sim::batch::Rows;
use crate::train::Frame;

/// One thread's share of a loss, with memory that serves again for the next.
#[derive(Debug)]
pub(super) struct Part {
    /// The blocks that it works on.
    blocks: Range<usize>,
    /// Of all chunks, or of one at a time.
    records: Vec<Rows>,
    tapes: Tapes,
    desk: Desk,
    /// Sums of the squared errors and of the squared residuals.
    pub sums: [f64; 2],
    /// Derivatives by the numbers of each network.
    pub by_networks: Vec<Vec<f32>>,
    /// Derivatives by the free parameters, in their units.
    pub by_parameters: Vec<f64>,
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

impl Part {
    pub(super) fn new(frame: &Frame) -> Self {
        Self {
            blocks: 0..0,
            records: Vec::new(),
            tapes: Tapes::new(frame),
            desk: Desk::default(),
            sums: [0.0; 2],
            by_networks: Vec::new(),
            by_parameters: Vec::new(),
        }
    }

    /// Make ready for the loss on these blocks.
    pub(super) fn begin(&mut self, blocks: Range<usize>, plan: &Plan, numbers: &Numbers) {
        let kept = match plan.keeps(&numbers.networks) {
            true => blocks.len(),
            false => blocks.len().min(CHUNK),
        };
        let rows = kept * plan.recorded(&numbers.networks);
        self.records.resize(rows, Rows::splat(0.0));
        self.desk.begin(&plan.frame, &numbers.networks);
        self.tapes.set_parameters(&numbers.parameters);
        self.blocks = blocks;
    }

    /// From sums lane by lane to numbers.
    #[inline(always)]
    fn add_up<S: Simd>(&mut self, simd: S) {
        let desk = &self.desk;
        self.by_networks.resize(desk.network_sums.len(), Vec::new());
        for (to, sums) in self.by_networks.iter_mut().zip(&desk.network_sums) {
            let sums = f32::registers::<S>(sums);
            to.resize(sums.len(), 0.0);
            for (to, sum) in to.iter_mut().zip(sums) {
                *to = Vector::<S, f32>::new(simd, *sum).sum();
            }
        }
        self.by_parameters.resize(desk.parameter_sums.len(), 0.0);
        for (to, sum) in self.by_parameters.iter_mut().zip(&desk.parameter_sums) {
            *to = total(simd, sum);
        }
    }
}

/// The chunks of some blocks, each with the number of its first block in the records.
fn chunks(
    blocks: &Range<usize>,
    keeps: bool,
) -> impl Iterator<Item = (Range<usize>, usize)> + use<> {
    let (first, last) = (blocks.start, blocks.end);
    (first..last).step_by(CHUNK).map(move |start| {
        let recorded = if keeps { start - first } else { 0 };
        (start..last.min(start + CHUNK), recorded)
    })
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
        part.sums = [0.0; 2];
        let (keeps, rows) = (
            plan.keeps(&numbers.networks),
            plan.recorded(&numbers.networks),
        );
        for (chunk, first) in chunks(&part.blocks, keeps) {
            let record = &mut part.records[first * rows..][..chunk.len() * rows];
            let worker = worker(simd, plan, numbers, chunk);
            let sums = worker.forward(&mut part.tapes, &mut part.desk.scratch, record);
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
        part.desk.clear_sums::<S>(&plan.frame, &numbers.networks);
        let (keeps, rows) = (
            plan.keeps(&numbers.networks),
            plan.recorded(&numbers.networks),
        );
        for (chunk, first) in chunks(&part.blocks, keeps) {
            let record = &mut part.records[first * rows..][..chunk.len() * rows];
            let worker = worker(simd, plan, numbers, chunk);
            if !keeps {
                worker.forward(&mut part.tapes, &mut part.desk.scratch, record);
            }
            worker.backward(&mut part.tapes, &mut part.desk, record, seeds);
        }
        part.add_up(simd);
    }
}

fn worker<'a, S: Simd>(
    simd: S,
    plan: &'a Plan,
    numbers: &'a Numbers,
    chunk: Range<usize>,
) -> Worker<'a, S> {
    let (joints, blocks) = (plan.frame.joints, chunk.len());
    Worker {
        simd,
        plan,
        numbers,
        chunk,
        layout: Layout::new(joints, &numbers.networks, plan.stages(), blocks),
    }
}
