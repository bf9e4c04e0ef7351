use residyn_core::lanes::Row;
use residyn_core::sim::batch::{Rows, W};

/// Segments in blocks of [`W`], one in each lane. The last segment is repeated to fill the last block, and the copies
/// do not count.
#[derive(Debug)]
pub struct Blocks {
    pub(super) joints: usize,
    /// Number of states: positions, velocities, then internal states.
    pub(super) states: usize,
    pub(super) steps: usize,
    /// Number of segments.
    pub(super) size: usize,
    rows: Vec<Rows>,
    /// 1 if a row of the last block counts, else 0.
    last: Rows,
}

/// The data of one step.
pub(super) struct StepData<'a> {
    /// At its start.
    pub state: &'a [Rows],
    /// `n`, held.
    pub input: &'a [Rows],
    /// s
    pub dt: &'a Rows,
    /// When the step begins, s.
    pub time: &'a Rows,
    /// At its end.
    pub next: &'a [Rows],
}

impl Blocks {
    /// Blocks of `size` segments; `segment` gives a segment's values: for each step, the state, the input, and the
    /// step's length and start, followed by the last state.
    pub(crate) fn new(
        [joints, states]: [usize; 2],
        steps: usize,
        size: usize,
        segment: impl Fn(usize) -> Vec<f32>,
    ) -> Self {
        let mut blocks = Self {
            joints,
            states,
            steps,
            size,
            rows: Vec::new(),
            last: Rows::splat(0.0),
        };
        let (count, stride) = (blocks.count(), blocks.stride());
        blocks.rows.resize(count * stride, Rows::splat(0.0));
        blocks.last[..size - (count - 1) * W].fill(1.0);
        for (block, rows) in blocks.rows.chunks_mut(stride).enumerate() {
            for lane in 0..W {
                let values = segment((block * W + lane).min(size - 1));
                for (rows, value) in rows.iter_mut().zip(values) {
                    rows[lane] = value;
                }
            }
        }
        blocks
    }

    /// Number of blocks.
    pub(super) fn count(&self) -> usize {
        self.size.div_ceil(W)
    }

    /// 1 in the rows of a block that count, else 0.
    pub(super) fn counted(&self, block: usize) -> &Rows {
        const ALL: &Rows = &Row([1.0; W]);
        if block + 1 < self.count() {
            ALL
        } else {
            &self.last
        }
    }

    /// The data of step `k`.
    #[inline(always)]
    pub(super) fn step(&self, block: usize, k: usize) -> StepData<'_> {
        let (n, states) = (self.joints, self.states);
        let (stride, step) = (self.stride(), self.step_rows());
        let rows = &self.rows[block * stride + k * step..][..step + states];
        let (state, held) = rows[..step].split_at(states);
        StepData {
            state,
            input: &held[..n],
            dt: &held[n],
            time: &held[n + 1],
            next: &rows[step..],
        }
    }

    /// Number of rows of a step.
    fn step_rows(&self) -> usize {
        self.states + self.joints + 2
    }

    /// Number of rows of a block.
    fn stride(&self) -> usize {
        self.steps * self.step_rows() + self.states
    }
}
