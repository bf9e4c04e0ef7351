use super::Evaluate;
use residyn_core::sim::batch::{Block, Rows};

/// Initial condition of a plan: state (positions, then velocities), time, and the torques commanded before.
#[derive(Debug, Clone, PartialEq)]
pub struct Start {
    state: Vec<f32>,
    time_s: f32,
    /// `[step][joint]`, oldest first.
    past: Vec<Vec<f64>>,
}

impl Start {
    /// From f64; no torque was commanded before.
    pub fn new(state: &[f64], time_s: f64) -> Self {
        Self::after(state, time_s, &[])
    }

    /// After the torques `past` (`[step][joint]`, oldest first), each held for a step of the model, the last one until
    /// `time_s`. The oldest was held for ever before; the last [`Rollouts::memory`](residyn_core::sim::batch::Rollouts::memory)
    /// of them matter.
    #[allow(clippy::cast_possible_truncation)] // planning runs in f32
    pub fn after(state: &[f64], time_s: f64, past: &[Vec<f64>]) -> Self {
        Self {
            state: state.iter().map(|x| *x as f32).collect(),
            time_s: time_s as f32,
            past: past.to_vec(),
        }
    }
}

/// An initial condition with the part of the acting torques that earlier commands cause.
#[derive(Debug, Clone, PartialEq)]
pub struct Prepared {
    start: Start,
    carried: Vec<f32>,
}

impl Evaluate for Block<'_> {
    type Start = Start;
    type Prepared = Prepared;

    fn prepare(&self, start: Start, steps: usize) -> Prepared {
        let carried = self.rollouts().carried(&start.past, steps);
        Prepared { start, carried }
    }

    fn returns(&mut self, prepared: &Prepared, inputs: &[Rows], returns: &mut Rows) {
        let Prepared { start, carried } = prepared;
        Block::returns(self, &start.state, start.time_s, carried, inputs, returns);
    }
}
